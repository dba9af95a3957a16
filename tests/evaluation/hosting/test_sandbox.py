"""An agent in a sandbox reads no file of the run or the tasks, reaches nobody, and leaves nothing behind."""

import os
import re
from dataclasses import replace
from pathlib import Path

import pytest
import spying_agent
from processes import have_ended
from toy_house import write_tasks
from toy_run import NEEDS_SANDBOX, SHORT, TOY, records

from evonav.agents.hosting import sandbox
from evonav.component import Component
from evonav.errors import InvalidArgumentError
from evonav.evaluation.hosting.isolation import AgentHosting, environment, policy_of
from evonav.evaluation.records.schema import EndState, ErrorKind
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.report.pages.run_page import write_report
from evonav.tasks.listing import task_files

SANDBOX = AgentHosting("sandbox", timeout_s=20.0)


def spied(folder, monkeypatch, *, isolation):
    """Evaluate the spy from a folder that holds its file, notes, the tasks and the run, and return what it reached."""
    project = folder / "project"
    project.mkdir()
    text = Path(spying_agent.__file__).read_text()
    filled = re.sub(r"(?m)^THE_USERS_HOME = .*$", lambda _: f"THE_USERS_HOME = {str(Path.home())!r}", text)
    (project / f"spy_{isolation}.py").write_text(filled)
    (project / "notes.txt").write_text("the agent's own")
    write_tasks(project / "tasks")
    (project / "shortcut").symlink_to(project / "tasks")
    monkeypatch.setenv("SOME_KEY", "canary-of-the-evaluator")
    monkeypatch.chdir(project)
    config = replace(SHORT, hosting=replace(SANDBOX, isolation=isolation))
    tasks = task_files(project / "tasks", 1)
    evaluate([f"./spy_{isolation}.py:Spy"], tasks, project / "run", config=config, num_workers=1)
    (first, *_) = records(project / "run", f"./spy_{isolation}.py:Spy")
    assert first.error is None
    return project, first.trace[0].details


@NEEDS_SANDBOX
def test_a_spy_in_a_sandbox_reaches_nothing(tmp_path, monkeypatch):
    project, found = spied(tmp_path, monkeypatch, isolation="sandbox")
    assert found["files beside"] == ["notes.txt", "spy_sandbox.py"]
    assert found["link"] == []
    assert found["package"] == ["wordpiece.txt.gz"]
    assert found["home"][:-1] == []
    assert Path(found["home"][-1]).name.startswith("evonav-agent-")
    for name in ("passwords", "parent", "own environment", "write beside", "network", "unix socket", "signal"):
        assert found[name] == "PermissionError", name
    assert found["canary"] == []
    assert found["folder"] == []
    assert len(found["descriptors"]) <= 5  # socket, pipe, shared memory twice, its own status
    assert found["write scratch"] == 1
    assert found["pair"] == [None, None]
    assert found["child"] == "15"  # it may start a process, for which the same holds
    assert found["session"] == 7
    assert found["large file"] == "OSError"
    assert found["memory"] in ("OSError", "MemoryError")
    assert (found["trace"], found["namespace"], found["ring"]) == (1, 1, 1)
    assert found["open files"] == sandbox.MAX_OPEN_FILES
    assert not (project / "written").exists()
    assert not Path(found["home"][-1]).exists()
    assert have_ended([found["left child"]])
    with RunStore(project / "run") as store:
        assert store.meta("sessions")[0]["isolation"].startswith("sandbox (Landlock ")
        assert all("agent_peak_rss_mb" in costs for costs in store.costs().values())
    assert "sandbox (Landlock" in write_report(project / "run").read_text(encoding="utf-8")


def test_without_a_sandbox_the_spy_reaches_all_of_it(tmp_path, monkeypatch):
    """Or the test above would show nothing."""
    _, found = spied(tmp_path, monkeypatch, isolation="process")
    assert "records.sqlite" in found["files beside"]
    assert "records.sqlite" in found["link"]
    assert "houses.jsonl.gz" in found["package"]
    assert found["canary"]
    assert found["network"] is None
    assert found["unix socket"] is None
    assert found["signal"] is None
    assert found["write beside"] == 1


@pytest.mark.slow
@NEEDS_SANDBOX
def test_failures_are_contained_as_without_a_sandbox(tasks, tmp_path):
    agents = {"unruly_agents:Segfaulting": ErrorKind.CRASH, "unruly_agents:Hungry": ErrorKind.AGENT}
    agents |= {"unruly_agents:LeavingChildren": ErrorKind.CRASH, "toy_agents:Raising": ErrorKind.AGENT}
    config = replace(SHORT, hosting=SANDBOX)
    evaluate(list(agents), tasks[:1], tmp_path / "run", config=config, num_workers=1)
    for agent, kind in agents.items():
        first, second, third = records(tmp_path / "run", agent)
        assert (first.is_scored, second.state, third.is_scored) == (True, EndState.ERRORED, True)
        assert second.error.kind is kind


@pytest.mark.parametrize(
    ("change", "num_workers", "reason"),
    [
        ({}, 0, "use one worker or more"),
        ({"decision": Component("evonav.decision.backends:custom", {}, {"cache": "x"})}, 1, "needs files or a network"),
        ({"decision": Component("evonav.decision.backends:custom", {"path": "x.py"})}, 1, "needs files or a network"),
    ],
)
def test_what_has_no_sandbox_is_refused_before_it_starts(tasks, tmp_path, monkeypatch, change, num_workers, reason):
    monkeypatch.setattr("evonav.evaluation.run.components.sandbox_problem", lambda: None)
    config = RunConfig(backend=replace(TOY, **change), hosting=SANDBOX)
    with pytest.raises(InvalidArgumentError, match=f"isolation = sandbox: .*{reason}"):
        evaluate(["stay-still"], tasks, tmp_path / "run", config=config, num_workers=num_workers)
    assert not (tmp_path / "run").exists()


def test_a_system_without_one_says_so(tasks, tmp_path, monkeypatch):
    monkeypatch.setattr("evonav.evaluation.run.components.sandbox_problem", lambda: "this kernel offers no Landlock")
    config = RunConfig(backend=TOY, hosting=SANDBOX)
    with pytest.raises(InvalidArgumentError, match="isolation = sandbox: this kernel offers no Landlock"):
        evaluate(["stay-still"], tasks, tmp_path / "run", config=config, num_workers=1)


def test_what_is_hidden_is_left_out_wherever_it_lies(tmp_path):
    for name in ("agent/run/records", "agent/run2", "agent/lib/deep/tasks/a", "agent/lib/other", "scratch"):
        (tmp_path / name).mkdir(parents=True)
    for name in ("agent/mine.py", "agent/lib/weights"):
        (tmp_path / name).write_text("")
    agent = tmp_path / "agent"
    (agent / "link").symlink_to(agent / "run")
    hidden = [str(agent / "run"), str(agent / "lib/deep/tasks")]
    policy = policy_of(f"{agent}/mine.py:Mine", tmp_path / "scratch", hidden, None)
    mine = {path for path in policy.read if path.startswith(str(tmp_path))}
    assert mine == {str(agent / name) for name in ("mine.py", "run2", "lib/other", "lib/weights")}
    named = {path for path in policy.names if path.startswith(str(tmp_path))}
    assert named == {str(agent), str(agent / "lib"), str(agent / "lib/deep")}
    assert policy.write == (str(tmp_path / "scratch"),)
    assert policy.memory_mb > 0
    assert policy_of("fu", tmp_path, [str(Path("/"))], 500).read == ()


def test_the_environment_is_a_list_of_what_is_allowed(tmp_path, monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", "secret")
    monkeypatch.setenv("LANG", "C.UTF-8")
    given = environment(tmp_path)
    assert "secret" not in given.values()
    assert given["LANG"] == "C.UTF-8"
    assert given["HOME"] == given["TMPDIR"] == str(tmp_path)
    assert given["PATH"] == os.environ["PATH"]
