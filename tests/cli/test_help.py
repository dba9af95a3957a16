"""Every command says by examples how it is used; the shell completes; neither slows the command's start."""

import json
import shlex
import subprocess
import sys

import pytest
import typer
from typer.testing import CliRunner

from evonav.cli import app
from evonav.cli.examples import EXAMPLES
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


@pytest.mark.parametrize("words", [example for examples in EXAMPLES.values() for example in examples])
def test_an_example_is_a_command_with_options_that_there_are(words):
    group, rest = GROUP, shlex.split(words)[1:]
    context = group.make_context("evonav", rest)
    while hasattr(group, "commands"):
        name, command, rest = group.resolve_command(context, [*context._protected_args, *context.args])
        context = command.make_context(name, rest, parent=context)
        group = command


def test_examples_are_shown_below_the_help():
    shown = CliRunner().invoke(app, ["sweep", "--help"], env={"COLUMNS": "160"}).stdout
    assert all(example in shown for example in EXAMPLES["sweep"])
    assert shown.index("Examples:") > shown.index("--schema")


def test_agents_are_completed_also_after_a_comma():
    assert completion.agents("ft") == ["ftu"]
    assert completion.agents("fu,stag") == ["fu,stage-reset"]
    assert "fu,fu" not in completion.agents("fu,")
    assert "shortest-path" in completion.agents("")


def test_runs_and_subsets_are_completed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("out/one", "out/other", "tasks"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "out/one/records.sqlite").touch()
    (tmp_path / "tasks/dataset.json").write_text(json.dumps({"split": "test", "num_tasks": 40}))
    assert completion.runs("o") == ["out/"]
    assert completion.runs("out/o") == ["out/one", "out/other/"]
    assert completion.runs("nowhere/") == []
    assert completion.task_folders("ta") == ["tasks"]

    class Context:
        params = {"tasks": tmp_path / "tasks"}  # noqa: RUF012

    assert completion.subsets(Context, "test") == ["test-10", "test-30", "test-40"]
    Context.params = {"tasks": None}
    assert completion.subsets(Context, "") == []


def test_the_shell_gets_its_answers():
    """As bash asks: the words so far in the environment."""
    code = "from evonav.cli import app; app(prog_name='evonav')"
    asked = {"_EVONAV_COMPLETE": "complete_bash", "COMP_WORDS": "evonav evaluate --agents stag", "COMP_CWORD": "3"}
    done = subprocess.run([sys.executable, "-c", code], env={"PATH": "", **asked}, capture_output=True, text=True)
    assert done.stdout.split() == ["stage-reset"], done.stderr


def test_completion_does_not_slow_the_start():
    """Neither defining completions nor examples loads what they are about."""
    heavy = ("evonav.agents", "evonav.decision", "rich.live", "tomllib", "tomli")
    code = f"import sys, evonav.cli; print([m for m in sys.modules if m.startswith({heavy})])"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == "[]"
