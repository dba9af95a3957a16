"""Every command says by examples how it is used; the shell completes; neither slows the command's start."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from evonav.cli import app
from evonav.cli.examples import DOCS, EXAMPLES
from evonav.cli.options import completion

GROUP = typer.main.get_command(app)


def commands(group=GROUP, before=()):
    """Every command by its words."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, (*before, name))
        else:
            yield " ".join((*before, name)), command


COMMANDS = dict(commands())


def test_every_command_has_examples_and_a_purpose():
    assert set(COMMANDS) - set(EXAMPLES) == set(), "add examples of these to evonav/cli/examples.py"
    assert set(EXAMPLES) - set(COMMANDS) == set(), "no such commands"
    for name, command in COMMANDS.items():
        assert command.get_short_help_str(), name


@pytest.mark.parametrize("words", [example for _, *examples in EXAMPLES.values() for example in examples])
def test_an_example_is_a_command_with_options_that_there_are(words):
    group, rest = GROUP, shlex.split(words)[1:]
    context = group.make_context("evonav", rest)
    while hasattr(group, "commands"):
        name, command, rest = group.resolve_command(context, [*context._protected_args, *context.args])
        context = command.make_context(name, rest, parent=context)
        group = command


def test_examples_are_shown_below_the_help():
    shown = CliRunner().invoke(app, ["sweep", "--help"], env={"COLUMNS": "160"}).stdout
    assert all(example in shown for example in EXAMPLES["sweep"][1:])
    assert shown.index("Examples:") > shown.index("--schema")


def test_the_terminal_decides_where_lines_of_a_help_end():
    shown = CliRunner().invoke(app, ["verify", "--help"], env={"COLUMNS": "300"}).stdout
    assert re.search(r"The scores are computed again\. .* only the first tasks are required and replayed\.", shown)


def test_agents_are_completed_also_after_a_comma():
    assert completion.agents("ft") == ["ftu"]
    assert completion.agents("fu,stag") == ["fu,stage-reset"]
    assert "fu,fu" not in completion.agents("fu,")
    assert "shortest-path" in completion.agents("")


def test_agents_of_a_run_are_completed(tmp_path):
    (tmp_path / "summary.json").write_text('{"agents": {"fu": {}, "./mine.py:Mine": {}}}')

    class Context:
        params = {"run": tmp_path}  # noqa: RUF012

    assert completion.run_agents(Context, "") == ["fu", "./mine.py:Mine"]
    assert completion.run_agents(Context, "fu,") == ["fu,./mine.py:Mine"]
    Context.params = {"run": tmp_path / "nowhere"}
    assert completion.run_agents(Context, "") == []


def test_runs_and_subsets_are_completed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("out/one", "out/other", "out/sweep/runs/cell", "src/deep", "tasks"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "out/one/records.sqlite").touch()
    (tmp_path / "out/sweep/runs/cell/records.sqlite").touch()
    (tmp_path / "tasks/dataset.json").write_text(json.dumps({"split": "test", "num_tasks": 40}))
    assert completion.runs("o") == ["out/"]
    assert completion.runs("") == ["out/"]
    assert completion.runs("out/o") == ["out/one"], "a folder without a run is left out"
    assert completion.runs("out/s") == ["out/sweep/"]
    assert completion.runs("src/") == []
    assert completion.runs("nowhere/") == []
    assert completion.task_folders("ta") == ["tasks"]
    assert completion.task_folders("") == ["bundled", "tasks"]
    monkeypatch.setattr(completion, "MAX_FOLDERS", 1)
    assert completion.runs("") == ["out/"], "a folder with too many folders is offered without a look"

    class Context:
        params = {"tasks": tmp_path / "tasks"}  # noqa: RUF012

    assert completion.subsets(Context, "test") == ["test-10", "test-30", "test-40"]
    Context.params = {"tasks": None}
    assert completion.subsets(Context, "") == []


def test_the_shell_gets_its_answers():
    """As bash asks: the words so far in the environment."""
    code = "from evonav.cli import app; app(prog_name='evonav')"
    asked = {"_EVONAV_COMPLETE": "complete_bash", "COMP_WORDS": "evonav evaluate --agent stag", "COMP_CWORD": "3"}
    done = subprocess.run([sys.executable, "-c", code], env={"PATH": "", **asked}, capture_output=True, text=True)
    assert done.stdout.split() == ["stage-reset"], done.stderr


def test_completion_does_not_slow_the_start():
    """Neither defining completions nor examples loads what they are about."""
    heavy = ("annotated_types", "evonav._core", "evonav.agents", "evonav.decision", "rich.live", "tomllib", "tomli")
    code = f"import sys, evonav.cli; print([m for m in sys.modules if m.startswith({heavy})])"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == "[]"


@pytest.mark.slow
def test_every_help_is_short_plain_and_complete():
    """Flags have no type, brackets are not taken for styles, and each purpose fits on a line."""
    shown = CliRunner().invoke(app, ["-h"], env={"COLUMNS": "80"}).stdout
    places = [shown.index(f"│ {name} ") for name in ("demo", "evaluate", "report", "houses", "paper", "pack", "video")]
    assert places == sorted(places)
    for name, command in COMMANDS.items():
        help_ = CliRunner().invoke(app, [*name.split(), "-h"], env={"COLUMNS": "120"}).stdout
        assert not re.search(r"<bool>|<path>|list\[", help_), name
        purpose = command.get_short_help_str(200)
        assert " " in name or len(purpose) <= 63, f"{name}: `{purpose}` takes two lines of a narrow terminal"
        for param in command.params:
            text = param.help or ""
            assert text or param.hidden, f"{name}: {param.name} has no help"
            assert not re.search(r"\[[a-z#/@]", text), f"{name}: {param.name}: rich would take the bracket for a style"
            assert "docs/" not in text, f"{name}: {param.name}: an installed package has no docs"


def test_the_help_of_evaluate_fits_on_two_screens():
    shown = CliRunner().invoke(app, ["evaluate", "-h"], env={"COLUMNS": "80"}).stdout
    assert len(shown.splitlines()) <= 100
    assert "--set " in shown


def test_options_that_mean_the_same_are_declared_once():
    """One help and one default for an option, but where it says what this very command works on."""
    own = {"out", "seed", "houses", "agent", "task", "tasks", "exchanges", "perceptions", "measure", "latex", "split"}
    own |= {"config", "every", "perception"}
    texts = {}
    for name in set(COMMANDS) - {"sweep", "paper"}:  # whose options change a file, and name the paper's tables
        for param in COMMANDS[name].params:
            if param.param_type_name == "option" and not param.hidden and param.name not in own:
                texts.setdefault(param.opts[0], {}).setdefault((param.help, str(param.default)), []).append(name)
    differing = {option: found for option, found in texts.items() if len(found) > 1}
    assert differing == {}, differing


def test_the_named_pages_of_the_documentation_are_there():
    """An installed package has no pages, so their address is told; it is the project's."""
    root = Path(__file__).parents[2]
    assert {page for page, *_ in EXAMPLES.values() if not (root / "docs" / page).is_file()} == set()
    source = re.search(r'^Source = "(.*)"', (root / "pyproject.toml").read_text(), re.MULTILINE)
    assert source
    assert f"{source[1]}/blob/main/docs" == DOCS
