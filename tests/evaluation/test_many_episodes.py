"""Several episodes at once on a worker: the same records, one episode's end is no other's, and little memory."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
import weakref
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from chaos import num_recorded
from processes import children
from short_tasks import short_tasks
from test_agent_end import is_running
from test_nothing_lost import many_tasks
from test_run import TOY, texts

from evonav.component import Component
from evonav.decision.vlm.mock_answers import mock_answer
from evonav.decision.vlm.mock_server import FAULTS
from evonav.errors import InvalidArgumentError, StoreError
from evonav.evaluation.hosting.fork_server import IS_SUPPORTED
from evonav.evaluation.hosting.isolation import AgentHosting, usual_isolation
from evonav.evaluation.hosting.process import AgentFailedError
from evonav.evaluation.hosting.processes import AgentProcesses
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState, ErrorKind
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate, evaluate_all
from evonav.evaluation.run.run import Evaluation, RunConfig
from evonav.evaluation.run.run_settings import RunSettings
from evonav.evaluation.run.settings import DecisionSettings, SimulatorSettings
from evonav.evaluation.run.worker import WorkerContext, WorkerSetup
from evonav.parallel.worker import Workforce
from evonav.tasks.listing import BUNDLED_TASKS
from vlm_stub import serving

WAITING = "waiting_parts:Waiting"
CHEAP = RunConfig(
    backend=replace(TOY, tasks=Component("chaos_house:load_spec")),
    protocol=ProtocolConfig(max_rounds=3),
    hosting=AgentHosting(usual_isolation()),
)
NAMES_OF_FAULTS = ("server_error", "malformed", "truncated", "refusal", "broken_json")


def faulty_reply(request):
    """Answers after a while; which requests meet a fault, about a tenth, is decided by what they ask alone."""
    number = int(hashlib.sha256(json.dumps(request, sort_keys=True).encode()).hexdigest()[:8], 16)
    reply = {"text": mock_answer(request)} if number % 10 else FAULTS[NAMES_OF_FAULTS[number // 10 % 5]]
    return {**reply, "hang_s": 0.05}


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["bundled", "toy"])
def test_records_with_a_model_are_the_same_for_any_number_at_once(tmp_path, monkeypatch, backend):
    """Bundled tasks ask much and with images; toy ones are many, and all ask the same at once."""
    monkeypatch.setenv("OPENAI_API_KEY", "none")
    found, most, cpu_s = {}, {}, {}
    toy_tasks = many_tasks(tmp_path / "tasks", 6)
    for num_workers, at_once in ((1, 1), (1, 3), (2, 2)) if backend == "bundled" else ((1, 1), (1, 6), (2, 3)):
        name = f"{num_workers}-{at_once}"
        with serving(faulty_reply) as stub:
            tasks, reader = short_tasks(BUNDLED_TASKS, 1, 3)
            host = {
                "server": {"base_url": stub.url, "max_retries": 0},
                "cache": str(tmp_path / f"{name}.exchanges"),
                "ledger": str(tmp_path / f"{name}.spending"),
                "mode": "auto",
            }
            parts = Backend(tasks=reader) if backend == "bundled" else CHEAP.backend
            decision = Component("evonav.decision.backends:vlm", {"model": "m"}, host)
            config = replace(CHEAP, backend=replace(parts, decision=decision))
            evaluate(
                ["fu"],
                tasks if backend == "bundled" else toy_tasks,
                tmp_path / name,
                config=config,
                num_workers=num_workers,
                episodes_at_once=at_once,
            )
            most[name] = stub.most_at_once
        found[name] = (texts(tmp_path / name), (tmp_path / name / "summary.json").read_bytes())
        with RunStore(tmp_path / name) as store:
            cpu_s[name] = sum(one["cpu_s"] for one in store.costs().values())
        assert cpu_s[name] > 0.0
        # Of each episode its own, not that of all on the worker; each worker also imports what it needs.
        assert num_workers > 1 or cpu_s[name] < (1.0 + at_once / 2.0) * cpu_s["1-1"]
    assert most.pop("1-1") == 1
    assert all(number > 1 for number in most.values())
    assert all(one == found["1-1"] for one in found.values())
    assert len(found["1-1"][0]) == (3 + 3 if backend == "bundled" else 18 + 18)


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
@pytest.mark.parametrize("agent", ["toy_agents:Dying", "toy_agents:Raising", "toy_agents:Hanging"])
def test_an_agent_that_fails_costs_its_own_stages(tmp_path, agent):
    tasks = many_tasks(tmp_path / "tasks", 2)
    config = replace(CHEAP, hosting=replace(CHEAP.hosting, timeout_s=4.0))
    for at_once in (1, 4):
        run = tmp_path / str(at_once)
        evaluate([agent, WAITING], tasks, run, config=config, episodes_at_once=at_once, num_retries=0)
    assert texts(tmp_path / "4") == texts(tmp_path / "1")
    with RunStore(tmp_path / "4") as store:
        assert {record.agent for record in store.records() if record.error is not None} == {agent}


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


DRIVER = """
import sys
from pathlib import Path
from test_many_episodes import CHEAP
from evonav.evaluation.run.evaluate import evaluate
from evonav.tasks.listing import task_files

tasks, run_dir, agent, at_once = sys.argv[1:]
evaluate([agent], task_files(Path(tasks)), Path(run_dir), config=CHEAP, episodes_at_once=int(at_once))
"""


def driver(tmp_path, agent, at_once):
    """Starts a run of the tasks in a folder."""
    return subprocess.Popen(
        [sys.executable, "-c", DRIVER, str(tmp_path / "tasks"), str(tmp_path / "run"), agent, str(at_once)],
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )


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
def test_an_interrupt_ends_all_and_the_run_is_resumed(tmp_path):
    tasks = many_tasks(tmp_path / "tasks", 8)
    run = driver(tmp_path, WAITING, 6)
    waited_for(lambda: len(agents_of(run.pid)) == 6)
    waited_for(lambda: num_recorded(tmp_path / "run") >= 2)
    everything = list(children(run.pid))
    run.send_signal(signal.SIGINT)
    run.wait(timeout=30)
    waited_for(lambda: not any(map(is_running, everything)), 10.0)
    kept = num_recorded(tmp_path / "run")
    assert kept < 24
    evaluate([WAITING], tasks, tmp_path / "run", config=CHEAP, episodes_at_once=6)
    evaluate([WAITING], tasks, tmp_path / "whole", config=replace(CHEAP, hosting=AgentHosting()), num_workers=0)
    assert texts(tmp_path / "run") == texts(tmp_path / "whole")


@pytest.mark.slow
@pytest.mark.skipif(not IS_SUPPORTED, reason="needs forks")
def test_a_killed_driver_leaves_no_process_and_a_second_one_does_not_disturb_it(tmp_path):
    tasks = many_tasks(tmp_path / "tasks", 8)
    run = driver(tmp_path, WAITING, 6)
    waited_for(lambda: len(agents_of(run.pid)) == 6)
    waited_for(lambda: num_recorded(tmp_path / "run") >= 2)
    with pytest.raises(StoreError, match=rf"another evonav is writing here \(process {run.pid} on "):
        evaluate([WAITING], tasks, tmp_path / "run", config=CHEAP, episodes_at_once=6)
    assert len(agents_of(run.pid)) == 6
    everything = list(children(run.pid))
    run.kill()
    run.wait(timeout=30)
    waited_for(lambda: not any(map(is_running, everything)), 10.0)
    assert num_recorded(tmp_path / "run") < 24
    evaluate([WAITING], tasks, tmp_path / "run", config=CHEAP, episodes_at_once=6)
    evaluate([WAITING], tasks, tmp_path / "whole", config=replace(CHEAP, hosting=AgentHosting()), num_workers=0)
    assert texts(tmp_path / "run") == texts(tmp_path / "whole")


@pytest.mark.slow
@pytest.mark.skipif(not IS_SUPPORTED, reason="needs forks")
def test_an_episode_that_waits_needs_little_memory(tmp_path):
    """Proportional set sizes of all processes of a run: with ten more episodes that wait, a tenth of the difference."""
    many_tasks(tmp_path / "tasks", 12)
    used_mb = {}
    for at_once in (2, 12):
        run = driver(tmp_path, "waiting_parts:Standing", at_once)
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
        return settings.with_episodes(decisions, simulators).workforce().jobs_at_once

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
