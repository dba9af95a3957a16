"""Agents in processes of their own: the same records, and nothing that they do costs more than their stage."""

import hashlib
import json
import os
import shutil
import sys
from contextlib import closing, contextmanager
from dataclasses import replace

import numpy as np
import pytest
from toy_house import write_tasks
from toy_run import CONFIG, NEEDS_SANDBOX, SHORT, records, texts

from evonav.agents.hosting.shared_slots import NUM_SLOTS
from evonav.component import Component
from evonav.errors import InvalidArgumentError
from evonav.evaluation.hosting.agent import RemoteAgent
from evonav.evaluation.hosting.isolation import AgentHosting, ProcessSetup
from evonav.evaluation.hosting.process import (
    LOG_NAME,
    AgentFailedError,
    AgentProcess,
    check_importable,
)
from evonav.evaluation.hosting.processes import AgentProcesses
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState, ErrorKind
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.report.pages.run_page import write_report
from evonav.sensors.observation import Detections, MapFrame, Observation, View, VisibleOccupancy
from evonav.tasks.listing import BUNDLED_TASKS, task_files
from evonav.tasks.public import Goal, TaskInfo
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics

CONTAINED = {
    "toy_agents:Raising": (ErrorKind.AGENT, "RuntimeError: no idea [toy_agents:"),
    "toy_agents:Speechless": (ErrorKind.AGENT, "'forward' is no action"),
    "unruly_agents:Undecided": (ErrorKind.DECISION, "no key"),
    "unruly_agents:Pretending": (ErrorKind.AGENT, "SimulatorLostError: gone"),
    "unruly_agents:Amnesiac": (ErrorKind.AGENT, "RuntimeError: who am I? [unruly_agents:"),
}
"""In any process: the agent goes on with the next stage."""

LOST = {
    "toy_agents:Dying": (ErrorKind.CRASH, "exit code 3"),
    "unruly_agents:Exiting": (ErrorKind.CRASH, "exit code 5"),
    "unruly_agents:Segfaulting": (ErrorKind.CRASH, "killed by signal 11"),
    "unruly_agents:LeavingChildren": (ErrorKind.CRASH, "exit code 3"),
    "unruly_agents:Babbling": (ErrorKind.CRASH, "malformed response: "),
    "unruly_agents:Boasting": (ErrorKind.CRASH, "malformed response: 1152921504606846984 bytes: must be at most"),
    "unruly_agents:Deaf": (ErrorKind.CRASH, "the agent's process"),
    "unruly_agents:Hanging": (ErrorKind.TIMEOUT, "no answer to `act` within 4 s"),
    "unruly_agents:Promising": (ErrorKind.TIMEOUT, "no answer to `act` within 4 s"),
}
"""The process is lost, and with it what the agent remembered."""

UNHARMED = ("unruly_agents:Forking", "unruly_agents:Shrinking", "unruly_agents:Printing", "unruly_agents:Keeping")


@pytest.fixture(scope="module")
def tasks(tmp_path_factory):
    folder = tmp_path_factory.mktemp("process")
    write_tasks(folder / "tasks")
    return task_files(folder / "tasks", 1)


@pytest.fixture(scope="module")
def run_dir(tasks, tmp_path_factory):
    """All that keep their processes in one run, so that they share workers, which keep fewer processes."""
    folder = tmp_path_factory.mktemp("run")
    agents = [*CONTAINED, *UNHARMED, "unruly_agents:Unmakeable", "unruly_agents:Farthest"]
    evaluate(agents, tasks, folder, config=SHORT, num_workers=2)
    return folder


@pytest.fixture(scope="module")
def lost_dir(tasks, tmp_path_factory):
    """All others in another run."""
    config = replace(SHORT, hosting=AgentHosting(timeout_s=4.0, memory_mb=8000))
    folder = tmp_path_factory.mktemp("lost")
    evaluate([*LOST, "unruly_agents:Hungry"], tasks, folder, config=config, num_workers=2)
    return folder


@pytest.mark.parametrize(
    ("agent", "folder"),
    [
        *((agent, "run_dir") for agent in CONTAINED),
        *(pytest.param(agent, "lost_dir", marks=pytest.mark.slow) for agent in (*LOST, "unruly_agents:Hungry")),
    ],
)
def test_a_failure_costs_its_stage_alone(request, agent, folder):
    kind, message = (CONTAINED | LOST).get(agent, (ErrorKind.AGENT, "MemoryError"))
    first, second, third = records(request.getfixturevalue(folder), agent)
    assert (first.is_scored, second.state, third.is_scored) == (True, EndState.ERRORED, True)
    assert second.error.kind is kind
    assert message in second.error.message
    assert second.spl is None
    assert [record.failed_before for record in (first, second, third)] == [(), (), (2,)]
    lost_at = 3 if agent in LOST else None
    assert [record.memory_lost_at for record in (first, second, third)] == [None, None, lost_at]
    if kind is not ErrorKind.AGENT:
        assert third.requested_start == second.effective_start  # it had not moved yet


@pytest.mark.slow
def test_what_a_process_says_at_its_end_is_in_the_log(lost_dir):
    lines = (lost_dir / LOG_NAME).read_text().splitlines()
    assert any("Segmentation fault" in line for line in lines if line.startswith("unruly_agents:Segfaulting"))


@pytest.mark.parametrize("agent", UNHARMED)
def test_what_harms_nobody_costs_nothing(run_dir, tasks, tmp_path, agent):
    assert all(record.is_scored for record in records(run_dir, agent))
    evaluate(["toy_agents:Explorer"], tasks, tmp_path, config=SHORT, num_workers=0)
    walked = [[entry.path_m for entry in record.trace] for record in records(tmp_path, "toy_agents:Explorer")]
    assert [[entry.path_m for entry in record.trace] for record in records(run_dir, agent)] == walked


def test_a_place_beyond_every_house_is_no_failure(run_dir):
    assert all(record.is_scored for record in records(run_dir, "unruly_agents:Farthest"))


def test_an_agent_that_cannot_be_made_is_errored_in_every_stage(run_dir):
    for record in records(run_dir, "unruly_agents:Unmakeable"):
        assert record.error.kind is ErrorKind.AGENT
        assert "RuntimeError: not today" in record.error.message
        assert record.memory_lost_at is None


def test_what_agents_print_is_in_the_log(run_dir):
    lines = (run_dir / LOG_NAME).read_text().splitlines()
    about = f"unruly_agents:Printing {records(run_dir, 'unruly_agents:Printing')[0].task_id} stage 2 | "
    assert f"{about}a word on standard output" in lines
    assert f"{about}and one on standard error" in lines


def test_records_are_the_same_in_either_process(run_dir, tasks, tmp_path):
    agents = [*CONTAINED, "unruly_agents:Unmakeable"]
    evaluate(agents, tasks, tmp_path, config=SHORT, num_workers=0)
    with RunStore(run_dir) as own, RunStore(tmp_path) as shared:
        for agent in agents:
            assert list(own.record_texts(agent)) == list(shared.record_texts(agent)), agent


@pytest.mark.parametrize("num_retries", [0, 1])
def test_an_agent_lost_between_stages_fails_the_next_one(tasks, tmp_path, monkeypatch, num_retries):
    """Its process ends as it tells the costs of stage 1: stage 2 is not run by an agent that remembers nothing."""
    monkeypatch.setenv("TOY_ALIVE", str(tmp_path / "alive"))
    config = replace(SHORT, backend=replace(SHORT.backend, decision=Component("unruly_agents:Fatal")))
    arguments = ["toy_agents:Explorer"], tasks[:1], tmp_path / "run"
    evaluate(*arguments, config=config, num_workers=1, num_retries=num_retries)
    found = records(tmp_path / "run", "toy_agents:Explorer")
    assert (tmp_path / "alive").exists()
    assert [record.is_scored for record in found] == [True, num_retries > 0, True]
    assert [record.memory_lost_at for record in found] == [None, None, None if num_retries else 3]
    with RunStore(tmp_path / "run") as store:
        (failure,) = store.failures()
    assert (failure.kind, failure.stage, failure.is_retried) == (ErrorKind.CRASH, 2, num_retries > 0)
    assert "exit code 3" in failure.message


class Killed:
    """A fork server that is killed before it forks."""

    def fork(self, *arguments, **options):
        raise ConnectionResetError("closed")


def test_a_process_that_does_not_start_is_a_crash(tmp_path):
    setup = ProcessSetup(log=str(tmp_path / LOG_NAME), scratch=str(tmp_path))
    with pytest.raises(AgentFailedError, match="the agent's process does not start: closed") as caught:
        AgentProcess("random-walk", AgentHosting("sandbox"), setup, Killed())
    assert caught.value.kind is ErrorKind.CRASH
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_retried_episode_is_run_whole(tasks, tmp_path, monkeypatch):
    """A stage after a loss was run without memory: it is not kept when the lost stage is tried again."""
    monkeypatch.setenv("TOY_ALIVE", str(tmp_path / "alive"))
    arguments = (["toy_agents:DyingOnce"], tasks, tmp_path / "run")
    (summary,) = evaluate(*arguments, config=SHORT, num_workers=1)
    assert summary.counts["errored"] == 1
    assert records(tmp_path / "run", "toy_agents:DyingOnce")[2].memory_lost_at == 3
    before = texts(tmp_path / "run")
    evaluate(*arguments, config=SHORT, num_workers=1)
    assert texts(tmp_path / "run") == before
    (tmp_path / "alive").touch()
    (summary,) = evaluate(*arguments, config=SHORT, num_workers=1, retry_errored=True)
    assert not summary.is_incomplete
    stages = records(tmp_path / "run", "toy_agents:DyingOnce")
    assert [(record.failed_before, record.memory_lost_at) for record in stages] == [((), None)] * 3


@pytest.mark.parametrize("num_workers", [0, 1])
def test_a_task_that_breaks_during_a_run_costs_its_stages_alone(tmp_path, num_workers):
    """A house of one of two bundled tasks is gone when its turn comes."""
    for root in sorted(BUNDLED_TASKS.iterdir())[:2]:
        shutil.copytree(root, tmp_path / "tasks" / root.name)
    both = task_files(tmp_path / "tasks")
    broken = next(path for path in sorted(both[0].path.rglob("*")) if path.is_file() and path.name != "task.json")
    broken.unlink()
    config = RunConfig(protocol=ProtocolConfig(max_rounds=1))
    (summary,) = evaluate(["random-walk"], both, tmp_path / "run", config=config, num_workers=num_workers)
    states = {(r.task_id, r.stage): r for r in records(tmp_path / "run", "random-walk")}
    assert len(states) == sum(task.num_stages for task in both) == summary.num_stages
    first = states[both[0].task_id, 1]
    assert (first.state, first.error.kind) == (EndState.ERRORED, ErrorKind.HARNESS)
    assert "cannot be read" in first.error.message
    assert all(r.state is EndState.NOT_RUN for (task, k), r in states.items() if task == both[0].task_id and k > 1)
    assert all(r.is_scored for (task, _), r in states.items() if task == both[1].task_id)
    assert "cannot be read" in write_report(tmp_path / "run").read_text()


def view(rng, side_px, *, features=None, rgb=True):
    pixels = np.asfortranarray(rng.integers(0, 255, (side_px, side_px, 3), dtype=np.uint8))
    return View(
        pose=Pose(0.0, 1.5, 0.0, 0.0),
        intrinsics=Intrinsics(side_px, side_px, 1.5),
        depth_m=rng.random((2 * side_px, side_px), dtype=np.float32)[::2],  # with gaps
        detections=Detections(np.zeros((side_px, side_px), np.int32), (), np.zeros(0, np.float32), features),
        occupancy=VisibleOccupancy(np.zeros((0, 2), np.int32), np.zeros((3, 2), np.int32)),
        rgb=pixels if rgb else None,
    )


def digests(observation):
    arrays = [a for v in observation.views for a in (v.depth_m, v.rgb, v.detections.features)]
    return [
        None if a is None else [list(a.shape), str(a.dtype), hashlib.sha256(a.tobytes()).hexdigest()] for a in arrays
    ]


def acted(agent, observation):
    agent.look(observation)
    return agent.act()


GOAL = Goal(1, "Chair", "a", "b", "c", np.zeros((8, 8, 3), np.uint8))


@contextmanager
def begun(name, isolation="process"):
    with closing(AgentProcesses(AgentHosting(isolation, timeout_s=30.0))) as processes:
        agent = RemoteAgent(processes, name, Component("evonav.decision.backends:text_match"), 0)
        agent.begin_task(TaskInfo("t", 1, 50, MapFrame(2, 3, 0.1, (0.0, 0.0)), 0))
        agent.begin_stage(GOAL)
        yield agent


@pytest.fixture
def echo():
    with begun("unruly_agents:Echo") as agent:
        yield agent


def test_entries_come_with_the_answer_before_them_where_they_can():
    nothing = Observation((), Pose(0.0, 0.9, 0.0, 0.0), True, 3)

    def known(agent):
        """Ids of entries, and the number of requests that it took to ask for them."""
        before = agent._process._num_asked
        return [entry.entry_id for entry in agent.entries()], agent._process._num_asked - before

    with begun("unruly_agents:Counting") as agent:
        assert known(agent) == ([0], 0)
        assert known(agent) == ([0], 1)
        agent.look(nothing, wants_entries=True)
        agent.act()
        assert agent.diagnostics().details == {"seen": []}
        assert known(agent) == ([1], 0)
        acted(agent, nothing)
        assert known(agent) == ([2], 1)
        agent.look(nothing, wants_entries=True)
        agent.act()  # which is sound
        with pytest.raises(AgentFailedError, match="RuntimeError: who am I"):
            agent.entries()
        agent.look(nothing, wants_entries=True)
        agent.act()
        agent.begin_task(TaskInfo("t", 1, 50, MapFrame(2, 3, 0.1, (0.0, 0.0)), 0))
        assert known(agent) == ([4], 1)  # not those of before


def test_arrays_cross_the_border_whatever_their_layout_and_size(echo):
    rng = np.random.default_rng(0)
    for sides in ((4,), (64, 8, 0), (300,) * 7, (16,)):  # memory grows, and is used again
        features = rng.random((3, 5), dtype=np.float32)[:, ::2]
        seen = Observation(
            tuple(view(rng, side, features=features, rgb=side != 8) for side in sides),
            Pose(1.0, 0.9, 2.0, 0.5),
            True,
            3,
        )
        assert acted(echo, seen).reason == f"{len(sides)} views"
        assert json.loads(json.dumps(echo.diagnostics().details["seen"])) == digests(seen)
    assert echo.cpu_s > 0.0


@pytest.mark.parametrize("isolation", ["process", pytest.param("sandbox", marks=NEEDS_SANDBOX)])
def test_what_an_agent_keeps_is_in_its_own_memory(isolation):
    """The evaluator's grows by a few observations and no more; what it has sent stays as it was."""
    rng = np.random.default_rng(0)
    with begun("unruly_agents:Keeping", isolation) as agent:
        for _ in range(8):
            seen = Observation(tuple(view(rng, 300) for _ in range(3)), Pose(1.0, 0.9, 2.0, 0.5), True, 3)
            before = [one.detections.masks.copy() for one in seen.views]
            acted(agent, seen)
            assert all(np.array_equal(one.detections.masks, was) for one, was in zip(seen.views, before, strict=True))
        size = sum(array.nbytes + 64 for one in seen.views for array in (one.depth_m, one.rgb, one.detections.masks))
        block = agent._process._block
        assert os.fstat(block.descriptor).st_blocks * 512 <= NUM_SLOTS * (size + 4096)


def test_processes_are_reused_and_agents_are_not():
    processes = AgentProcesses(AgentHosting(timeout_s=30.0))
    first, second = (
        RemoteAgent(processes, "toy_agents:Explorer", Component("evonav.decision.backends:text_match"), 0)
        for _ in range(2)
    )
    first.begin_task(TaskInfo("t", 1, 50, MapFrame(2, 3, 0.1, (0.0, 0.0)), 0))
    nothing = Observation((), Pose(0.0, 0.9, 0.0, 0.0), True, 3)
    assert acted(first, nothing).reason == "nothing left to explore"
    first.close()
    first.close()
    process = processes.lend("toy_agents:Explorer")
    processes.take_back(process)
    assert second.sensors == first.sensors
    assert processes.lend("toy_agents:Explorer") is not process  # which `second` has
    with pytest.raises(AgentFailedError, match="'Explorer' object has no attribute"):
        acted(second, nothing)
    processes.close()
    processes.close()
    assert not process.is_usable


def test_agents_are_looked_for_in_a_process_of_their_own():
    check_importable("unruly_agents:Echo", AgentHosting())
    assert "prying_agent" not in sys.modules
    check_importable("prying_agent:Prying", AgentHosting())
    assert "prying_agent" not in sys.modules
    for name in ("nobody", "unruly_agents:Nobody", "no_such_module:Agent", f"{os.devnull}.py:Agent"):
        with pytest.raises(InvalidArgumentError, match=r"no agent|cannot be imported"):
            check_importable(name, AgentHosting())


def test_an_agent_is_loaded_from_its_file(tasks, tmp_path):
    (tmp_path / "neighbour_of_mine.py").write_text("REASON = 'as the file says'\n")
    (tmp_path / "agent_of_mine.py").write_text(
        "from evonav.agents.agent import SensorConfig, Stop\nfrom neighbour_of_mine import REASON\n\n"
        "class Mine:\n    sensors = SensorConfig()\n    def begin_task(self, task): pass\n"
        "    def begin_stage(self, stage): pass\n    def act(self, observation): return Stop(REASON)\n"
    )
    name = f"{tmp_path}/agent_of_mine.py:Mine"
    evaluate([name], tasks, tmp_path / "run", config=CONFIG, num_workers=1)
    assert [record.stop_reason for record in records(tmp_path / "run", name)] == ["as the file says"] * 3
    assert "agent_of_mine" not in sys.modules
