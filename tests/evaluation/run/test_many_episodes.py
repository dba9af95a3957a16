"""Several episodes at once on a worker: the same records, one episode's end is no other's, and little memory."""

import os
import signal
import sys
import time
import weakref
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from chaos import num_recorded
from processes import children, is_running
from toy_run import CHEAP, HERE_ALONE, many_tasks, started_driver, texts

from evonav.component import Component
from evonav.errors import InvalidArgumentError, StoreError
from evonav.evaluation.hosting.fork_server import IS_SUPPORTED
from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.hosting.process import AgentFailedError
from evonav.evaluation.hosting.processes import AgentProcesses
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState, ErrorKind
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate, evaluate_all
from evonav.evaluation.run.run import Evaluation
from evonav.evaluation.run.run_settings import RunSettings
from evonav.evaluation.run.settings import DecisionSettings, SimulatorSettings
from evonav.evaluation.run.worker import WorkerContext, WorkerSetup
from evonav.parallel.worker import Workforce

WAITING = "waiting_parts:Waiting"


@pytest.mark.parametrize("isolation", ["process", "none"])
def test_episodes_share_a_task_unless_their_agents_could_change_it(isolation):
    hosting = AgentHosting(isolation)
    setup = WorkerSetup(Backend(tasks=Component("collections:UserString")), ProtocolConfig(), hosting)
    with closing(WorkerContext(setup, lambda: None)) as context:
        first = context.task("one")
        assert first == "one"
        assert (context.task("one") is first) is (isolation == "process")
        assert context.task("two") == "two"
        assert (context.task("one") is first) is (isolation == "process")
        context.task("two")
        known = weakref.ref(first)
        del first
        assert known() is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "kind", "num_retries"),
    [("exit", ErrorKind.CRASH, 0), ("exit", ErrorKind.CRASH, 1), ("hang", ErrorKind.TIMEOUT, 0)],
)
def test_an_episode_that_ends_its_worker_is_errored_and_no_other(tmp_path, how, kind, num_retries):
    tasks = many_tasks(tmp_path / "tasks", 5)
    deadly = Component("waiting_parts:Deadly", {"task_id": tasks[2].task_id, "how": how})
    config = replace(CHEAP, backend=replace(CHEAP.backend, perception=deadly))
    if how == "hang":
        config = replace(config, stage_timeout_s=4.0, hosting=replace(CHEAP.hosting, timeout_s=4.0))
    for at_once in (1, 4):
        evaluate(
            [WAITING], tasks, tmp_path / str(at_once), config=config, episodes_at_once=at_once, num_retries=num_retries
        )
    assert texts(tmp_path / "4") == texts(tmp_path / "1")
    with RunStore(tmp_path / "4") as store:
        records = list(store.records())
        final = [failure for failure in store.failures() if not failure.is_retried]
    errored = [record for record in records if record.state is EndState.ERRORED]
    assert [(record.task_id, record.stage, record.error.kind) for record in errored] == [(tasks[2].task_id, 2, kind)]
    assert [(one.task_id, one.stage, one.kind) for one in final] == [(tasks[2].task_id, 2, kind)]
    assert len(records) == 15


@pytest.mark.slow
def test_agents_that_fail_cost_their_own_stages(tmp_path):
    tasks = many_tasks(tmp_path / "tasks", 2)
    failing = {"toy_agents:Dying", "toy_agents:Raising", "toy_agents:Hanging"}
    config = replace(CHEAP, hosting=replace(CHEAP.hosting, timeout_s=4.0))
    for at_once in (1, 4):
        run = tmp_path / str(at_once)
        evaluate([*sorted(failing), WAITING], tasks, run, config=config, episodes_at_once=at_once, num_retries=0)
    assert texts(tmp_path / "4") == texts(tmp_path / "1")
    with RunStore(tmp_path / "4") as store:
        assert {record.agent for record in store.records() if record.error is not None} == failing


@pytest.mark.slow
def test_cells_with_more_configurations_than_a_worker_keeps_share_it(tmp_path):
    tasks = tuple(many_tasks(tmp_path / "tasks", 2))
    requests = [
        Evaluation(
            (WAITING,), tasks, tmp_path / str(rounds), replace(CHEAP, protocol=ProtocolConfig(max_rounds=rounds))
        )
        for rounds in (2, 3, 4, 5)
    ]
    evaluate_all(requests, Workforce(1, jobs_at_once=8))
    for request in requests:
        config = replace(request.config, hosting=AgentHosting())
        evaluate([WAITING], tasks, tmp_path / "alone" / request.run_dir.name, config=config, num_workers=0)
        assert texts(tmp_path / "alone" / request.run_dir.name) == texts(request.run_dir)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # Ray's own
def test_ray_runs_many_at_once(tmp_path, monkeypatch):
    pytest.importorskip("ray")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    monkeypatch.setenv("RAY_TMPDIR", "/tmp")  # paths of sockets have a greatest length
    tasks = tuple(many_tasks(tmp_path / "tasks", 6))
    config = replace(CHEAP, hosting=AgentHosting())
    evaluate_all([Evaluation((WAITING,), tasks, tmp_path / "run", config)], Workforce(1, "ray", jobs_at_once=4))
    evaluate([WAITING], tasks, tmp_path / "local", config=config, num_workers=0)
    assert texts(tmp_path / "run") == texts(tmp_path / "local")


def agents_of(pid):
    return [child for child, line in children(pid).items() if line.startswith("evonav-agent\n")]


def waited_for(condition, timeout_s=60.0):
    until_s = time.monotonic() + timeout_s
    while not (found := condition()):
        assert time.monotonic() < until_s
        time.sleep(0.05)
    return found


@pytest.mark.slow
@pytest.mark.skipif(not IS_SUPPORTED, reason="needs forks")
@pytest.mark.parametrize("kill", [signal.SIGINT, signal.SIGKILL])
def test_a_run_that_is_ended_leaves_no_process_and_is_resumed(tmp_path, kill):
    tasks = many_tasks(tmp_path / "tasks", 8)
    run = started_driver(tmp_path, agents=[WAITING], episodes_at_once=6)
    waited_for(lambda: len(agents_of(run.pid)) == 6)
    waited_for(lambda: num_recorded(tmp_path / "run") >= 2)
    with pytest.raises(StoreError, match=rf"another evonav is writing here \(process {run.pid} on "):
        evaluate([WAITING], tasks, tmp_path / "run", config=CHEAP, episodes_at_once=6)
    assert len(agents_of(run.pid)) == 6
    everything = list(children(run.pid))
    run.send_signal(kill)
    assert run.wait(timeout=30) != 0
    waited_for(lambda: not any(map(is_running, everything)), 10.0)
    assert num_recorded(tmp_path / "run") < 24
    evaluate([WAITING], tasks, tmp_path / "run", config=CHEAP, episodes_at_once=6)
    evaluate([WAITING], tasks, tmp_path / "whole", **HERE_ALONE)
    assert texts(tmp_path / "run") == texts(tmp_path / "whole")


@pytest.mark.slow
@pytest.mark.skipif(not IS_SUPPORTED, reason="needs forks")
def test_an_episode_that_waits_needs_little_memory(tmp_path):
    """Proportional set sizes of all processes of a run: with ten more episodes that wait, a tenth of the difference."""
    many_tasks(tmp_path / "tasks", 12)
    used_mb = {}
    for at_once in (2, 12):
        run = started_driver(tmp_path, agents=["waiting_parts:Standing"], episodes_at_once=at_once)
        try:
            waited_for(lambda pid=run.pid, number=at_once: len(agents_of(pid)) == number)
            time.sleep(2.0)
            used_mb[at_once] = sum(map(_pss_mb, [run.pid, *children(run.pid)]))
        finally:
            run.kill()
            run.wait()
    assert (used_mb[12] - used_mb[2]) / 10 < 15.0


def _pss_mb(pid):
    fields = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()[1:])
    return int(fields["Pss"].split()[0]) / 1024.0


@pytest.mark.skipif(not IS_SUPPORTED, reason="needs forks")
def test_forks_are_their_own(tmp_path):
    """They end alone, and a server that is lost is replaced."""
    with closing(AgentProcesses(CHEAP.hosting)) as processes:
        first, second = processes.lend("waiting_parts:Waiting"), processes.lend("waiting_parts:Waiting")
        assert first._process.pid != second._process.pid
        os.kill(first._process.pid, signal.SIGKILL)
        with pytest.raises(AgentFailedError, match=r"the agent's process died \(killed by signal 9\)"):
            first.ask("entries")
        assert second.is_usable
        processes.take_back(first)
        os.kill(processes._fork_server._pid, signal.SIGKILL)
        waited_for(lambda: not is_running(second._process.pid))
        with pytest.raises(AgentFailedError, match=r"the agent's process died \(killed by signal 9\)"):
            second.ask("entries")
        processes.take_back(second)
        assert processes.lend("waiting_parts:Waiting").is_usable


def test_the_default_number_is_for_models_that_are_waited_for():
    rules, model = DecisionSettings(), DecisionSettings(kind="vlm", model="m")
    here, client = SimulatorSettings(), SimulatorSettings(kind="ai2thor")

    def number(settings, decisions, simulators):
        kinds = [[one.kind for one in these] for these in (decisions, simulators)]
        return settings.with_episodes(*kinds).workforce().jobs_at_once

    assert number(RunSettings(workers=2), [rules], [here]) == 1
    assert number(RunSettings(workers=2), [rules, model], [here]) == 16
    assert number(RunSettings(workers=2), [model], [here, client]) == 1
    assert number(RunSettings(workers=0), [model], [here]) == 1
    assert number(RunSettings(workers=2, isolation="none"), [model], [here]) == 1
    assert number(RunSettings(workers=2, episodes_at_once=3), [rules], [client]) == 3
    assert RunSettings(workers=2, episodes_at_once=3).num_episodes == 6
    for settings in (RunSettings(workers=0, episodes_at_once=2), RunSettings(isolation="none", episodes_at_once=2)):
        with pytest.raises(InvalidArgumentError, match="2: needs workers, and agents in processes of their own"):
            settings.workforce()
    with pytest.raises(InvalidArgumentError, match="jobs_at_once = 0"):
        Workforce(1, jobs_at_once=0)
