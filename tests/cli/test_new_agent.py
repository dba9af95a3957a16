"""A developer's way: write an agent, check it, stop at its first error, look around in the debugger."""

import pdb
import re
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from evonav.cli import app
from evonav.evaluation.contract.check import check_agent
from evonav.evaluation.hosting import agent

RAISING = """
import evonav


class Raising(evonav.Agent):
    def begin_task(self, task):
        pass

    def begin_stage(self, goal):
        self.stage = goal.stage

    def act(self, observation):
        return self.typo if self.stage == 2 else evonav.Stop()
"""


def run(*words):
    return CliRunner().invoke(app, [*map(str, words)], env={"COLUMNS": "200"})


def test_a_new_agent_keeps_the_contract_and_is_never_written_over(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written = run("new-agent", "brand_new.py")
    assert "evonav check-agent ./brand_new.py:MyAgent" in written.stdout
    assert "evonav evaluate --agent ./brand_new.py:MyAgent" in written.stdout
    text = Path("brand_new.py").read_text()
    assert re.findall(r"^(?:import|from) .*", text, re.MULTILINE) == ["import math", "import evonav"]
    assert check_agent("./brand_new.py:MyAgent").is_ok
    again = run("new-agent", "brand_new.py")
    assert (again.exit_code, "exists already" in str(again.exception)) == (1, True)
    assert "such as my_agent.py" in str(run("new-agent", "agent.txt").exception)


def test_fail_fast_stops_at_the_first_error_and_runs_it_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("raising_once.py").write_text(RAISING)
    words = ("evaluate", "--agent", "./raising_once.py:Raising", "--limit", 2, "--workers", 0, "--out", "out")
    stopped = run(*words, "--fail-fast")
    assert stopped.exit_code == 3
    assert stopped.stderr.count("has no attribute 'typo'") == 2
    assert "return self.typo if" in stopped.stderr
    assert "stopped at the first errored stage" in stopped.stderr
    Path("raising_once.py").write_text(RAISING.replace("self.typo", "evonav.Stop()"))
    del sys.modules["raising_once"]
    assert run(*words, "--fail-fast").exit_code == 0


def test_the_debugger_opens_where_an_agent_raises(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("raising_too.py").write_text(RAISING)
    words = ("evaluate", "--agent", "./raising_too.py:Raising", "--limit", 1, "--pdb", "--out", "out")
    assert "--pdb needs a terminal" in str(run(*words).exception)
    opened = []
    monkeypatch.setattr(agent, "check_terminal", lambda: None)
    monkeypatch.setattr(pdb, "post_mortem", opened.append)
    assert run(*words).exit_code == 3
    (traceback,) = opened
    while traceback.tb_next is not None:
        traceback = traceback.tb_next
    assert traceback.tb_frame.f_code.co_name == "act"
    assert traceback.tb_frame.f_locals["self"].stage == 2


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("lost_agent:Lost", "did you mean `./lost_agent.py:Lost`?"),
        ("./lost_agent.py:Lots", "did you mean `Lost`?"),
        ("./los_agent.py:Lost", "no file ./los_agent.py"),
    ],
)
def test_a_missing_agent_is_told_with_the_nearest_one(tmp_path, monkeypatch, name, told):
    monkeypatch.chdir(tmp_path)
    Path("lost_agent.py").write_text("class Lost:\n    pass\n")
    done = run("evaluate", "--agent", name, "--limit", 1, "--workers", 0, "--out", "out")
    assert told in str(done.exception)
