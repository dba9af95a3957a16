"""check_agent finds what is wrong, says so, and raises nothing."""

import subprocess
import sys

import contract_breakers
import pytest
from typer.testing import CliRunner

import evonav
from evonav.agents.registry import agent_factory
from evonav.cli import app
from evonav.errors import InvalidArgumentError

CHECKS = [
    *("importable", "made", "sensors", "begin_task", "begin_stage", "act", "actions", "budget", "observations"),
    *("diagnostics", "entries", "time", "same seed twice", "own process", "memory", "new task"),
    *("guided stage", "target gone", "failed actions", "failed search", "one room", "all explored", "many rooms"),
    *("never found", "no detections"),
]
NOT_REACHED = {"target gone", "failed actions", "failed search"}
"""Situations that an agent which only turns does not meet."""


def verdicts(report):
    return {check.name: check.verdict for check in report.checks}


def test_a_good_agent_passes_every_check():
    report = evonav.check_agent("contract_breakers:Turning")
    assert [check.name for check in report.checks] == CHECKS
    assert verdicts(report) == {name: "skip" if name in NOT_REACHED else "pass" for name in CHECKS}, str(report)
    assert report.is_ok
    assert str(report).startswith("contract_breakers:Turning: keeps the contract\npass  importable")


@pytest.mark.parametrize(
    ("agent", "check", "verdict", "words"),
    [
        ("Moody", "same seed twice", "fail", "TaskInfo.seed"),
        ("Collective", "same seed twice", "fail", "keep nothing in modules or classes"),
        ("Remembering", "new task", "fail", "must forget everything"),
        ("Scribbling", "observations", "warn", "detections.masks"),
        ("Greedy", "sensors", "fail", "first_round.count = 100"),
        ("Senseless", "sensors", "fail", "set `self.sensors = SensorConfig()`"),
        ("Displaced", "entries", "fail", "entry 4 (Mug)"),
        ("Halting", "begin_stage", "fail", "KeyError"),
        ("Wordless", "actions", "fail", "None is no action"),
        ("Opaque", "diagnostics", "fail", "not JSON-ready"),
        ("Evasive", "diagnostics", "fail", "must be an evonav.Explanation"),
        ("Plain", "diagnostics", "warn", "no `explain()`: pages cannot show what the agent knows"),
        ("Needy", "made", "fail", "it needs the arguments `weights`: give them defaults"),
        ("Quitting", "own process", "fail", "exit code 1"),
        ("Dying", "own process", "fail", "exit code 3"),
        ("Slow", "own process", "fail", "within 3 s"),
        ("Dependent", "own process", "fail", "does it read what is not there"),
        ("Missing", "importable", "fail", "`contract_breakers` has no `Missing`; it defines Turning, Moody"),
        ("Turnin", "importable", "fail", "did you mean `Turning`?"),
        ("Colourful", "act", "fail", "unless the agent asks for colours: `SensorConfig(needs_rgb=True)`"),
    ],
)
def test_a_broken_point_is_named(agent, check, verdict, words):
    report = evonav.check_agent(f"contract_breakers:{agent}", timeout_s=3.0)
    found = {found.name: found for found in report.checks}
    assert found[check].verdict == verdict, str(report)
    assert words in found[check].finding
    assert report.is_ok == (verdict == "warn")
    others = {name: other.verdict for name, other in found.items() if name != check}
    assert "fail" not in others.values(), str(report)


def test_names_that_are_no_agents_are_told():
    for name in ("nobody", "shortest-path", "no_such_module:Agent", "./no_such_file.py:Agent"):
        report = evonav.check_agent(name)
        assert verdicts(report) == {"importable": "fail"}
        assert str(report).startswith(f"{name}: cannot be checked\n")


def test_a_module_beside_a_file_of_its_name_is_told(tmp_path, monkeypatch):
    (tmp_path / "mine.py").touch()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InvalidArgumentError, match=r"did you mean `\./mine\.py:Agent`\?"):
        agent_factory("mine:Agent")
    with pytest.raises(InvalidArgumentError, match=r"no file \./yours\.py"):
        agent_factory("./yours.py:Agent")


def test_classes_and_objects_are_checked_too():
    for agent in (contract_breakers.Turning, contract_breakers.Turning()):
        report = evonav.check_agent(agent)
        assert report.name == "contract_breakers:Turning"
        assert set(verdicts(report).values()) == {"pass", "skip"}

    class Local(contract_breakers.Turning):
        pass

    report = evonav.check_agent(Local)
    assert report.is_ok
    assert verdicts(report)["own process"] == "warn"


def test_a_class_of_a_script_is_found_by_its_file(tmp_path):
    script = tmp_path / "an_agent_of_mine.py"
    script.write_text(
        "import evonav\nfrom evonav.agents.agent import SensorConfig, Stop\n\n"
        "class Mine:\n    sensors = SensorConfig()\n    def begin_task(self, task): pass\n"
        "    def begin_stage(self, stage): pass\n    def act(self, observation): return Stop()\n\n"
        "if __name__ == '__main__':\n    print(evonav.check_agent(Mine))\n"
    )
    printed = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True).stdout
    assert "an_agent_of_mine.py:Mine: keeps the contract" in printed
    assert "pass  own process" in printed
    assert "it never did anything else" in printed


def test_a_script_that_checks_its_agent_when_imported_is_told_so(tmp_path):
    """Its agent's process imports the script, which would check the agent in a process of its own, and so on."""
    script = tmp_path / "a_script_without_a_guard.py"
    script.write_text(
        "import evonav\n\nclass Mine(evonav.Agent):\n    def act(self, observation):\n        return evonav.Stop()\n\n"
        "print(evonav.check_agent(Mine))\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=60, check=True)
    assert "importing it calls `evonav.check_agent`" in done.stdout
    assert 'put that call under `if __name__ == "__main__":`' in done.stdout


def test_the_command_prints_a_table_and_fails_with_the_agent():
    good = CliRunner().invoke(app, ["check-agent", "contract_breakers:Turning"])
    assert good.exit_code == 0
    assert "keeps the contract" in good.stdout
    assert "same seed twice" in good.stdout
    bad = CliRunner().invoke(app, ["check-agent", "contract_breakers:Wordless"])
    assert bad.exit_code == 1
    assert "breaks the contract" in bad.stdout
    missing = CliRunner().invoke(app, ["check-agent", "./missing.py:X"])
    assert (missing.exit_code, "./missing.py:X: cannot be checked" in missing.stdout) == (1, True)
