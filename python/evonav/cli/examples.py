"""Keep the examples that are shown below the `--help` of every command."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import typer

EXAMPLES: dict[str, tuple[str, ...]] = {
    "evaluate": (
        "evonav evaluate --limit 5 --out out/first",
        "evonav evaluate --agents fu,ftu,msgnav --tasks tasks --subset test-90 --out out/run",
        "evonav evaluate --agent ./examples/own_agent.py:OwnAgent --agent fu --out out/mine",
        "evonav evaluate --perception noisy:poor,miss_rate=0.3 --out out/poor",
        "evonav evaluate --decision vlm --model gpt-4o --dry-run --out out/gpt",
    ),
    "sweep": (
        "evonav sweep examples/sweeps/noise.toml",
        "evonav sweep examples/sweeps/noise.toml --dry-run",
        "evonav sweep sweep.toml --set 'seeds=[0,1,2]' --only '*__s0' --workers 8",
    ),
    "demo": ("evonav demo", "evonav demo --limit 4 --out out/short"),
    "failures": ("evonav failures out/run", "evonav failures out/run --agent fu --brief"),
    "report": ("evonav report out/run", "evonav report out/run --replays all"),
    "compare": (
        "evonav compare out/run fu ftu",
        "evonav compare out/gpt-4o out/rules --html out/compare.html",
        "evonav compare out/run --baseline fu",
    ),
    "measures": ("evonav measures out/run", "evonav measures out/run --agents fu,ftu --out out/measures.md"),
    "breakdown": (
        "evonav breakdown out/run",
        "evonav breakdown out/run fu ftu --by path-length --measure spl --plot out/length.pdf",
        "evonav breakdown out/gpt-4o out/rules --by num_stale_at_start --csv out/stale.csv",
    ),
    "export": (
        "evonav export out/run --csv out/stages.csv --parquet out/stages.parquet",
        "evonav export out/run --rounds --parquet out/rounds.parquet",
    ),
    "video": ("evonav video out/run --out episode.mp4", "evonav video out/run --agent ftu --stage 2 --out stage.mp4"),
    "rerun": ("evonav rerun out/run --agent ftu --out episode.rrd",),
    "paper": ("evonav paper out/run", "evonav paper out/run --latex out/tables.tex"),
    "perception": (
        "evonav perception --perception gt --perception noisy:poor --limit 10 --out out/perception",
        "evonav perception tasks --perception predicted:mini --views-per-room 24 --workers 4 --out out/mini",
    ),
    "strip": ("evonav strip out/run --agents fu,ftu --out episode.svg",),
    "view": ("evonav view out/run --open", "evonav view out/run --agent ftu --stage 2"),
    "generate": (
        "evonav generate --houses houses.jsonl.gz --out tasks",
        "evonav generate --houses procthor-10k:test --subset test-90 --workers 8 --out tasks",
    ),
    "check-agent": ("evonav check-agent ./examples/own_agent.py:OwnAgent", "evonav check-agent ftu"),
    "pack": ("evonav pack out/run --title 'Our agent' --authors 'A. Author'",),
    "verify": ("evonav verify out/run.evonav.zip", "evonav verify out/run.evonav.zip --tasks tasks --subset test-90"),
    "mock-vlm": ("evonav mock-vlm --port 8000", "evonav mock-vlm --faults refusal=0.1,rate_limit=0.05 --latency 0.5"),
    "doctor": ("evonav doctor", "evonav doctor --no-network --json"),
    "agents": ("evonav agents",),
    "version": ("evonav version",),
    "houses list": ("evonav houses", "evonav houses list houses.jsonl.gz --limit 10"),
    "houses fetch": ("evonav houses fetch procthor-10k --split test",),
    "tasks list": ("evonav tasks list tasks",),
    "tasks schema": ("evonav tasks schema task", "evonav tasks schema --out schemas"),
    "tasks show": ("evonav tasks show tasks", "evonav tasks show tasks --task TASK --stage 2 --out stage.svg"),
    "tasks stats": ("evonav tasks stats tasks --reweight procthor-10k",),
    "tasks subset": ("evonav tasks subset tasks test-90",),
    "tasks validate": ("evonav tasks validate tasks",),
    "tasks write": ("evonav tasks write tasks --dry-run",),
    "controlled generate": ("evonav controlled generate houses.jsonl.gz --out out/fixed --limit 60",),
    "controlled evaluate": ("evonav controlled evaluate out/fixed --agents fu,stage-reset,ftu",),
    "controlled report": ("evonav controlled report out/fixed",),
    "controlled picture": ("evonav controlled picture out/fixed --agent fu --out pair.svg",),
}
"""Examples by command."""


def add_examples(app: "typer.Typer", before: str = "") -> None:
    """Show examples below the help of every command of an app."""
    for command in app.registered_commands:
        name = command.name or getattr(command.callback, "__name__", "").replace("_", "-")
        examples = EXAMPLES.get(f"{before}{name}")
        if examples:
            lines = ("Examples:", *(f"  {example}" for example in examples))
            # A blank line keeps lines apart; a bracket would be taken for a style.
            command.epilog = "\n\n".join(line.replace("[", r"\[") for line in lines)
    for group in app.registered_groups:
        if group.typer_instance is not None:
            add_examples(group.typer_instance, f"{before}{group.name} ")
