"""Commands in the documentation are run where they can be, and parsed where not."""

import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest
import typer
from build_docs import ROOT, pages
from doc_blocks import blocks, command_lines
from typer.testing import CliRunner

from evonav.cli import app
from evonav.evaluation.run.components import check_agent_names

PARSED_ONLY = {
    "evonav bench": "minutes: tests/cli/test_bench_memory.py and tests/speed_benchmark run these commands, smaller",
    "evonav demo": "what `make demo` does; tests/e2e",
    "evonav doctor": "depends on the machine; tests of its own",
    "evonav houses fetch": "network",
    "evonav sweep": "minutes: tests/sweeps/test_sweep.py runs these files, smaller",
    "--houses procthor-10k": "needs what the network brings",
    "evonav-10k": "minutes: tests/house/test_evonav10k.py makes smaller sets",
    "test-90": "needs a whole dataset",
    "--simulator ai2thor": "AI2-THOR: tests/world, tests/thor",
    "--decision vlm": "a model: tests/decision, with a stand-in",
    "evonav tasks write": "a model: tests/decision, with a stand-in",
    "--perception predicted": "weights: tests/models",
    "python -m evonav.decision.vlm.mock_server": "serves until it is stopped: tests/decision",
    "my_package": "a package that is not there",
    "--open": "opens a browser",
    "--assets": "a file of sizes that is not here: tests/house",
    "delay=": "waits",
    "--isolation sandbox": "needs workers, and Linux: tests/agents",
}
"""Commands with these words are not run here, only parsed."""
LIMITED = ("evaluate", "tasks generate", "perception")
"""Commands that get one task, one or two agents and this process: the words are tested, not the machine."""
SLOW = {
    "README.md",
    "docs/agents.md",
    "docs/agents/pro.md",
    "docs/controlled.md",
    "docs/houses.md",
    "docs/perception-quality.md",
    "docs/perception.md",
    "docs/report.md",
}
"""Pages whose commands take longest."""


def filled(line: str, task_id: str) -> str:
    """A command with its placeholders replaced."""
    line = re.sub(r"\bTASK_ID\b|(?<=--task )ID\b", task_id, line)
    return re.sub(r"\s(\.\.\.|…)(?=\s|$)", "", line)


def parse(arguments: list[str]) -> None:
    """Has the command's parser read arguments, without running anything."""
    if "--help" in arguments:
        arguments = arguments[: arguments.index("--help")]
    command: Any = typer.main.get_command(app)
    context, rest = typer.Context(command), arguments
    while hasattr(command, "commands"):
        if command.invoke_without_command and rest[0].startswith("-"):
            command.make_context(command.name, list(rest), parent=context)
            return
        assert rest[0] in command.commands, f"no command {rest[0]}"
        _, command, rest = command.resolve_command(context, rest)  # which adds the options of its settings
        if not rest:
            return  # the help of a command
    command.make_context(command.name, list(rest), parent=context)


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=pytest.mark.slow if page.as_posix() in SLOW else (), id=str(page))
        for page in pages()
        if command_lines(page)
    ],
)
def test_commands_of_a_page_do_what_they_say(page: Path, place: Path) -> None:
    task_id = next(path.name for path in sorted((place / "tasks").iterdir()) if (path / "task.json").exists())
    write_files_of(page, place)
    for line in command_lines(page):
        run_line(filled(line, task_id), place, parses_only="studies" in page.parts)


def write_files_of(page: Path, place: Path) -> None:
    """Blocks that the page says to save."""
    texts: dict[str, str] = {}
    for language, text in blocks(page):
        if language == "python" and (found := re.match(r"# (\w+\.py)\b", text)):
            texts[found[1]] = texts.get(found[1], "") + text
        if language == "toml":
            named = re.match(r"# (\w+\.toml)\b", text)
            texts[named[1] if named else "theta.toml"] = text
    for name, text in texts.items():
        (place / name).write_text(text)


def run_line(line: str, place: Path, *, parses_only: bool) -> None:
    """Runs a command, or parses it where it takes long: commands of studies ran for hours."""
    words = shlex.split(line.removesuffix("&").strip())
    if words[0] == "make":
        targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        assert words[1] in targets, f"{line}: no such target"
    elif words[0] == "pip":
        extras = re.findall(r"evonav\[(\w+)\]", line)
        told = (ROOT / "pyproject.toml").read_text()
        assert all(re.search(rf"^{extra} = \[", told, re.MULTILINE) for extra in extras), f"{line}: no such extra"
    elif words[0].startswith(("python", ".venv")):
        script = next((word for word in words if word.endswith(".py")), None)
        assert script is None or (ROOT / script).is_file(), f"{line}: no such file"
    elif words[0] != "export":
        environment = {}
        while "=" in words[0]:
            name, _, value = words.pop(0).partition("=")
            environment[name] = value
        assert words.pop(0) == "evonav", line
        run_evonav(line, words, environment, place, parses_only=parses_only)


def run_evonav(line: str, words: list[str], environment: dict[str, str], place: Path, *, parses_only: bool) -> None:
    if parses_only or environment or any(part in line for part in PARSED_ONLY):
        parse(words)
        return
    parse(words)
    if words[0] in LIMITED or " ".join(words[:2]) in LIMITED:
        words = made_small(words, place)
    result = CliRunner().invoke(app, words)
    error = result.exception if not isinstance(result.exception, SystemExit) else None
    assert result.exit_code == 0, f"{line}: exit code {result.exit_code}: {error}\n{result.output[-2000:]}"


def made_small(words: list[str], place: Path) -> list[str]:
    options = {"--limit": "1", "--workers": "0"}
    if "--subset" in words:
        del options["--limit"]
    if words.count("--agent") == 1:
        names = words[words.index("--agent") + 1].split(",")
        check_agent_names(names)
        options["--agent"] = ",".join(names if len(names) == 1 else [names[0], names[-1]])
    elif words[0] == "evaluate" and "--agent" not in words:
        options["--agent"] = "ftu" if "--perception" in words else "fu,ftu"
    for option, value in options.items():
        if option in words:
            words[words.index(option) + 1] = value
        else:
            words = [*words, option, value]
    if "--out" in words:  # a page may use a folder's name for several examples
        shutil.rmtree(place / words[words.index("--out") + 1], ignore_errors=True)
    return words
