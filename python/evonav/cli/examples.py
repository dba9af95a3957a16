"""Keep what is shown below the `--help` of every command: examples, and the address of its documentation."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import typer

DOCS = "https://github.com/evonav/evonav/blob/main/docs"
"""Address of the pages of the documentation, which an installed package does not have."""

EXAMPLES: dict[str, tuple[str, ...]] = {
    "evaluate": (
        "quickstart.md",
        "evonav evaluate --agent fu,ftu --tasks tasks --subset test-90 --out out/run",
        "evonav evaluate --agent ./my_agent.py:MyAgent --limit 6 --out out/mine",
        "evonav evaluate --decision looks --set decision.eagerness=0.5 --out out/looks",
        "evonav evaluate --decision vlm --model gpt-4o --dry-run --out out/gpt",
    ),
    "sweep": (
        "sweeps.md",
        "evonav sweep sweep.toml --dry-run",
        "evonav sweep sweep.toml",
        "evonav sweep sweep.toml --set 'seeds=[0,1,2]' --only '*__s0' --workers 8",
    ),
    "demo": ("quickstart.md", "evonav demo", "evonav demo --limit 4 --out out/short"),
    "failures": ("reliability.md", "evonav failures out/run", "evonav failures out/run --agent fu --brief"),
    "report": (
        "report.md",
        "evonav report out/run",
        "evonav report out/run --replays all",
        "evonav report out/run --text --agent fu,ftu",
    ),
    "compare": (
        "statistics.md",
        "evonav compare out/run ftu fu",
        "evonav compare out/gpt-4o out/rules --out out/compare.html",
        "evonav compare out/run --baseline fu",
    ),
    "breakdown": (
        "statistics.md",
        "evonav breakdown out/run",
        "evonav breakdown out/run fu ftu --by path-length --measure spl --out out/length.pdf",
        "evonav breakdown out/gpt-4o out/rules --by num_stale_at_start --out out/stale.csv",
    ),
    "export": (
        "metrics.md",
        "evonav export out/run --out out/stages.csv --out out/stages.parquet",
        "evonav export out/run --rounds --out out/rounds.parquet",
    ),
    "video": (
        "report.md",
        "evonav video out/run",
        "evonav video out/run --agent ftu --stage 2 --out stage.mp4",
        "evonav video out/run --out episode.rrd",
    ),
    "paper": ("parity.md", "evonav paper out/run", "evonav paper out/run --out out/tables.tex"),
    "perception": (
        "perception-quality.md",
        "evonav perception --perception gt --perception noisy:poor --limit 10 --out out/perception",
        "evonav perception --tasks tasks --perception predicted:mini --views-per-room 24 --workers 4 --out out/mini",
    ),
    "bench speed": (
        "benchmarks.md",
        "evonav bench speed render --limit 2 --out out/bench",
        "evonav bench speed navigation --against out/bench/navigation/speed.json",
        "evonav bench speed gym --envs 1,16 --peer sync",
    ),
    "bench memory export": (
        "memory-benchmark.md",
        "evonav bench memory export out/streams --streams S1 --quick --layout replica",
    ),
    "bench memory score": (
        "memory-benchmark.md",
        "evonav bench memory score out/streams",
        "evonav bench memory score out/streams/S1_bundled-0001_0 answers.jsonl --system mine",
    ),
    "view": ("report.md", "evonav view out/run --open", "evonav view out/run --agent ftu --stage 2"),
    "tasks generate": (
        "tasks.md",
        "evonav tasks generate --houses bundled --limit 20 --out tasks",
        "evonav tasks generate --houses procthor-10k:test --subset test-90 --workers 8 --out tasks",
    ),
    "leaderboard": (
        "submission.md",
        "evonav leaderboard packs --out leaderboard.html",
        "evonav leaderboard packs --tasks tasks --subset test-90 --page-title 'Our lab' --workers 8",
    ),
    "check-agent": ("agents.md", "evonav check-agent ./my_agent.py:MyAgent", "evonav check-agent ftu"),
    "new-agent": ("tutorial-agent.md", "evonav new-agent my_agent.py"),
    "pack": (
        "submission.md",
        "evonav pack out/run --title 'Our agent' --authors 'A. Author'",
        "evonav pack out/run --agent ftu --url https://example.org",
    ),
    "verify": (
        "submission.md",
        "evonav verify out/run.evonav.jsonl.gz",
        "evonav verify out/run.evonav.jsonl.gz --tasks tasks --subset test-90",
    ),
    "doctor": ("quickstart.md", "evonav doctor", "evonav doctor --no-network --json"),
    "agents": ("agents.md", "evonav agents"),
    "houses list": ("houses.md", "evonav houses list", "evonav houses list houses.jsonl.gz --limit 10"),
    "houses show": (
        "houses.md",
        "evonav houses show bundled:3 --out house.html",
        "evonav houses show house.json --assets sizes.json --start auto",
    ),
    "houses check": (
        "houses.md",
        "evonav houses check houses.jsonl.gz --only-wrong",
        "evonav houses check bundled --limit 10",
    ),
    "houses make": (
        "houses.md",
        "evonav houses make --count 100 --seed 7 --out houses.jsonl.gz",
        "evonav houses make --count 10 --config flats.toml --out flats.jsonl",
    ),
    "houses stats": ("houses.md", "evonav houses stats bundled endless:7 --limit 150"),
    "houses fetch": (
        "houses.md",
        "evonav houses fetch procthor-10k --split test",
        "evonav houses fetch evonav-10k --split train --workers 8",
    ),
    "tasks list": ("tasks.md", "evonav tasks list", "evonav tasks list tasks --limit 10"),
    "tasks schema": ("tasks.md", "evonav tasks schema task", "evonav tasks schema --out schemas"),
    "tasks show": ("tasks.md", "evonav tasks show", "evonav tasks show tasks --task TASK --stage 2 --out stage.svg"),
    "tasks stats": ("tasks.md", "evonav tasks stats", "evonav tasks stats tasks --reweight procthor-10k"),
    "tasks subset": ("tasks.md", "evonav tasks subset tasks test-90"),
    "tasks validate": ("tasks.md", "evonav tasks validate", "evonav tasks validate tasks --json"),
    "tasks write": ("tasks.md", "evonav tasks write tasks --model gpt-4o --dry-run"),
    "controlled generate": ("controlled.md", "evonav controlled generate --houses bundled --limit 60 --out out/fixed"),
    "controlled evaluate": ("controlled.md", "evonav controlled evaluate out/fixed --agent fu,stage-reset,ftu"),
    "controlled report": ("controlled.md", "evonav controlled report out/fixed"),
    "controlled picture": ("controlled.md", "evonav controlled picture out/fixed --agent fu --out pair.svg"),
}
"""Page of the documentation and examples of each command."""


def add_examples(app: "typer.Typer", before: str = "") -> None:
    """Show examples and the address of a page below the help of every command of an app."""
    for command in app.registered_commands:
        name = command.name or getattr(command.callback, "__name__", "").replace("_", "-")
        page, *examples = EXAMPLES[f"{before}{name}"]
        lines = ["Examples:", *(f"  {example}" for example in examples), f"Documentation: {DOCS}/{page}"]
        # The terminal decides where lines of a paragraph end. A blank line keeps lines apart; a bracket would be taken
        # for a style.
        paragraphs = ((command.callback and command.callback.__doc__) or "").split("\n\n")
        command.help = "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)
        command.epilog = "\n\n".join(line.replace("[", r"\[") for line in lines)
    for group in app.registered_groups:
        if group.typer_instance is not None:
            add_examples(group.typer_instance, f"{before}{group.name} ")
