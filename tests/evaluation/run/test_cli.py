"""The command: what it prints, what it refuses, and with which exit code."""

import json
import re
import subprocess
import sys
import time

import pytest
from typer.testing import CliRunner

from evonav.cli import app, main


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_evaluates_bundled_tasks_and_resumes(tmp_path):
    arguments = ("evaluate", "--agent", "shortest-path, random-walk", "--limit", 1, "--workers", 0, "--out", tmp_path)
    first = run(*arguments)
    assert first.exit_code == 0, first.output
    assert "shortest-path" in first.stdout
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["agents"]["shortest-path"]["sr"] == 1.0
    assert summary["agents"]["shortest-path"]["spl"] == 1.0
    assert set(summary["agents"]["shortest-path"]["counts"]) == {"success", "failure", "errored", "not_run"}
    began_s = time.monotonic()
    again = run(*arguments)
    assert again.exit_code == 0
    assert time.monotonic() - began_s < 5.0
    assert json.loads((tmp_path / "summary.json").read_text()) == summary


def test_goes_on_in_a_folder_whose_run_ended_as_its_file_was_created(tmp_path):
    (tmp_path / "records.sqlite").touch()
    arguments = ("evaluate", "--agent", "stay-still", "--limit", 1, "--workers", 0, "--out", tmp_path)
    assert run(*arguments).exit_code == 0
    assert json.loads((tmp_path / "summary.json").read_text())["agents"]["stay-still"]["counts"]["errored"] == 0
    (tmp_path / "records.sqlite").write_bytes(b"no database" * 100)
    refused = run(*arguments)
    assert "file is not a database" in str(refused.exception)


def test_lists():
    agents = run("agents").stdout
    assert all(name in agents for name in ("fu", "stage-reset", "ftu", "shortest-path"))
    assert "rooms" in run("houses", "--limit", 1).stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("evaluate", "--agent", "nobody", "--out", "OUT"), "no agent `nobody`"),
        (("evaluate", "--tasks", "OUT", "--out", "OUT"), "holds no task"),
        (("evaluate", "--houses", "OUT/none.json", "--out", "OUT"), "none.json"),
        (("report", "OUT"), "no run here"),
        (("houses", "OUT/none.json"), "none.json"),
    ],
)
def test_errors_are_one_line(monkeypatch, capsys, tmp_path, arguments, words):
    monkeypatch.setattr(sys, "argv", ["evonav", *(word.replace("OUT", str(tmp_path)) for word in arguments)])
    with pytest.raises(SystemExit) as exit_:
        main()
    assert exit_.value.code == 1
    error = capsys.readouterr().err
    assert words in error
    assert "Traceback" not in error


def test_contradicting_options_are_wrong_usage(tmp_path):
    assert run("evaluate", "--tasks", tmp_path, "--houses", tmp_path, "--out", tmp_path).exit_code == 2
    assert run("evaluate").exit_code == 2


def test_an_incomplete_run_says_so(tmp_path):
    result = run("evaluate", "--agent", "toy_agents:Raising", "--limit", 1, "--workers", 0, "--out", tmp_path)
    assert result.exit_code == 3
    assert "incomplete" in result.stdout
    assert "1 stage errored: the agent failed" in result.stdout


def test_equal_failures_are_listed_once(tmp_path):
    agent = "toy_agents:AlwaysRaising"
    result = run("evaluate", "--agent", agent, "--limit", 1, "--workers", 0, "--isolation", "none", "--out", tmp_path)
    assert "4 stages errored: the agent failed" in result.stdout
    listed = run("failures", tmp_path, "--agent", agent).stdout
    assert listed.count("RuntimeError: no idea") == 2  # in the heading, and below the only traceback
    assert re.match(rf"{agent} 4 stages, first: bundled-0084-\S+ stage 1: errored, since the agent", listed)
    assert run("failures", tmp_path, "--brief").stdout.count("\n") == 1


@pytest.mark.parametrize(
    ("modules", "heavy"),
    [
        ("evonav, evonav.cli", ("pydantic", "rich", "evonav.ev")),
        ("evonav.evaluation.run, evonav.parallel.local", ("pydantic", "numpy")),  # a worker starts with these
        ("evonav.evaluation.run.evaluate, evonav.report.tables.table", ("jinja2", "matplotlib", "evonav.report.pages")),
    ],
)
def test_importing_is_quick(modules, heavy):
    code = f"import {modules}, sys; print([m for m in sys.modules if m.startswith({heavy})])"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == "[]"


@pytest.mark.parametrize("command", ["evaluate", "demo"])
def test_a_worker_starts_before_the_imports_of_an_evaluation(command):
    code = f"""if True:
        import os, sys
        from evonav.cli import app
        from evonav.cli.run import {command} as module
        module.early_worker = lambda: os._exit(10 + ("evonav.evaluation.run.evaluate" in sys.modules))
        app(["{command}", "--out", "unused"])"""
    assert subprocess.run([sys.executable, "-c", code]).returncode == 10


@pytest.mark.slow
def test_evaluates_through_the_client_of_ai2thor(tmp_path, monkeypatch):
    pytest.importorskip("ai2thor", reason="the thor dependency group (ai2thor) is not installed")
    monkeypatch.setenv("HOME", str(tmp_path))
    options = (
        "--simulator",
        "ai2thor",
        "--set",
        "simulator.executable=evonav",
        "--agent",
        "shortest-path",
        "--limit",
        2,
    )
    out = tmp_path / "run"
    done = run("evaluate", *options, "--workers", 2, "--out", out)
    assert done.exit_code == 0, done.output
    assert json.loads((out / "summary.json").read_text())["agents"]["shortest-path"]["sr"] == 1.0
    # Timeouts may change, the simulator may not.
    assert run("evaluate", *options, "--set", "simulator.timeout_s=50", "--out", out).exit_code == 0
    other = run("evaluate", "--agent", "shortest-path", "--limit", 2, "--out", out)
    assert "another configuration" in str(other.exception)


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (("--simulator", "ai2thor", "--set", "simulator.executable=OUT/none"), 1, "no such executable"),
        (
            ("--simulator", "ai2thor", "--set", "simulator.executable=evonav", "--set", "simulator.gpu_device=0"),
            1,
            "gpu_device = 0",
        ),
        (("--set", "simulator.executable=evonav"), 2, "--set simulator.executable is for simulator ai2thor"),
    ],
)
def test_a_simulator_that_does_not_start_is_told_before_the_run(
    monkeypatch, capsys, tmp_path, arguments, status, words
):
    pytest.importorskip("ai2thor", reason="the thor dependency group (ai2thor) is not installed")
    given = (word.replace("OUT", str(tmp_path)) for word in arguments)
    monkeypatch.setattr(sys, "argv", ["evonav", "evaluate", "--out", str(tmp_path / "run"), *given])
    with pytest.raises(SystemExit) as exit_:
        main()
    assert exit_.value.code == status
    assert words in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
