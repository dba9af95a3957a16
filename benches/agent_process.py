"""What it costs that agents have a process of their own: a round's way there and back, and a whole evaluation."""

import math
import multiprocessing
import os
import statistics
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from evonav._core import RunImage
from evonav.agents.agent import AgentAction, SensorConfig, Stop
from evonav.agents.hosting.sandbox import sandbox_problem
from evonav.component import Component
from evonav.evaluation.hosting.agent import RemoteAgent
from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.hosting.processes import AgentProcesses
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.parallel.local import one_thread_each
from evonav.sensors.observation import Detections, MapFrame, Observation, View, VisibleOccupancy
from evonav.tasks.listing import BUNDLED_TASKS, task_files
from evonav.tasks.public import Goal, TaskInfo
from evonav.world.pose import Pose
from evonav.world.run_images import unexpanded
from evonav.world.simulator import Intrinsics

NOTES = """\
A round: the observation to an agent that does nothing, and its answer; the peer sends it pickled, by
`multiprocessing.Pipe`. CPU is the sum of both processes. Below: `fu`; stages/s at 1 and 2 workers.
"""
SIDE_PX = 300
NUM_ROUNDS = 200
NUMS_OF_VIEWS = (0, 1, 3, 7)
NUM_TASKS = 4
NUM_PAIRS = 2


class Idle:
    """Does nothing."""

    sensors = SensorConfig()

    def begin_task(self, task: TaskInfo) -> None:
        """Nothing."""

    def begin_stage(self, goal: Goal) -> None:
        """Nothing."""

    def act(self, observation: Observation) -> AgentAction:
        """Nothing."""
        return Stop()


def run() -> str:
    """All tables."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, range(os.cpu_count() or 1))  # two processes at a time
    return "\n".join([*_rounds(), "", *_evaluations(), "", *_sandboxes()])


# A round


def _rounds() -> Iterator[str]:
    yield "| views of 300x300, with colours | wall | CPU | by pipe: wall | CPU | CPU ratio |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for num_views in NUMS_OF_VIEWS:
        seen, pickled = _observation(num_views), _observation(num_views)
        with _agent() as agent, _by_pipe() as pipe:
            ours, peers = [], []
            for _ in range(NUM_ROUNDS):
                ours.append(_timed_agent(agent, seen))
                peers.append(_timed_pipe(pipe, pickled))
        (wall_ms, cpu_ms), (peer_wall_ms, peer_cpu_ms) = _figures(ours), _figures(peers)
        ratio = peer_cpu_ms / cpu_ms
        peer = f"{peer_wall_ms:.2f} ms | {peer_cpu_ms:.2f} ms | {ratio:.1f}"
        yield f"| {num_views} | {wall_ms:.2f} ms | {cpu_ms:.2f} ms | {peer} |"


def _figures(times_s: list[tuple[float, float]]) -> tuple[float, float]:
    """Least wall time and mean CPU time in milliseconds, the first tenth left out."""
    kept = times_s[len(times_s) // 10 :]
    return 1e3 * min(wall_s for wall_s, _ in kept), 1e3 * statistics.mean(cpu_s for _, cpu_s in kept)


@contextmanager
def _agent() -> Iterator[RemoteAgent]:
    with closing(AgentProcesses(AgentHosting())) as processes:
        agent = RemoteAgent(
            processes, "benches.agent_process:Idle", Component("evonav.decision.backends:text_match"), 0
        )
        agent.begin_task(TaskInfo("bench", 1, 50, MapFrame(100, 100, 0.1, (0.0, 0.0)), 0))
        agent.begin_stage(Goal(1, "Chair", "", "", "", np.zeros((SIDE_PX, SIDE_PX, 3), np.uint8)))
        yield agent


def _timed_agent(agent: RemoteAgent, seen: Observation) -> tuple[float, float]:
    wall_s, cpu_s = time.perf_counter(), time.process_time() + agent.cpu_s
    agent.look(seen)
    agent.act()
    return time.perf_counter() - wall_s, time.process_time() + agent.cpu_s - cpu_s


@contextmanager
def _by_pipe() -> Iterator[Connection]:
    context = multiprocessing.get_context("spawn")
    near, far = context.Pipe()
    with one_thread_each():
        process = context.Process(target=_receive, args=(far,), daemon=True)
        process.start()
    far.close()
    yield near
    near.close()
    process.join()


def _receive(connection: Connection) -> None:
    while True:
        try:
            connection.recv()
        except EOFError:
            return
        connection.send_bytes(repr(time.process_time()).encode())


_peer_cpu_s = 0.0


def _timed_pipe(pipe: Connection, seen: Observation) -> tuple[float, float]:
    global _peer_cpu_s
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    pipe.send(seen)
    there_s = float(pipe.recv_bytes())
    spent_s = there_s - _peer_cpu_s if there_s > _peer_cpu_s else there_s
    _peer_cpu_s = there_s
    return time.perf_counter() - wall_s, time.process_time() - cpu_s + spent_s


def _observation(num_views: int) -> Observation:
    rng = np.random.default_rng(0)
    size = (SIDE_PX, SIDE_PX)
    views = tuple(
        View(
            pose=Pose(0.0, 1.575, 0.0, 0.0),
            intrinsics=Intrinsics(SIDE_PX, SIDE_PX, math.pi / 2),
            depth_m=rng.random(size, dtype=np.float32),
            detections=Detections(_masks(rng), ("Chair",) * 20, np.ones(20, dtype=np.float32)),
            occupancy=VisibleOccupancy(np.zeros((700, 2), np.int32), np.zeros((200, 2), np.int32)),
            rgb=rng.integers(0, 256, (*size, 3), dtype=np.uint8),
        )
        for _ in range(num_views)
    )
    return Observation(views, Pose(0.0, 0.9, 0.0, 0.0), is_action_success=True, num_rounds_left=10)


def _masks(rng: np.random.Generator) -> NDArray[np.int32]:
    """Three runs of pixels a row, as many as a view of a house has, and as perception passes them on."""
    numbers = rng.integers(-1, 20, (SIDE_PX, 3), dtype=np.int32)
    return unexpanded(RunImage.of(np.repeat(numbers, SIDE_PX // 3, axis=1)))


# An evaluation


def _evaluations() -> Iterator[str]:
    yield "| `fu`, bundled | CPU a stage | in one process | ratio | stages/s: 1 | 2 | in one process: 1 | 2 |"
    yield "| --- | --- | --- | --- | --- | --- | --- | --- |"
    own, shared = [], []
    for _ in range(NUM_PAIRS):
        own.append((_evaluated(1, AgentHosting()), _evaluated(2, AgentHosting())))
        within = AgentHosting("none")
        shared.append((_evaluated(1, within), _evaluated(2, within)))
    cpu_ms = 1e3 * statistics.median(one[0] for one, _ in own)
    shared_ms = 1e3 * statistics.median(one[0] for one, _ in shared)
    ratio = statistics.median(a[0][0] / b[0][0] for a, b in zip(own, shared, strict=True))
    rates = [statistics.median(pair[k][1] for pair in pairs) for pairs in (own, shared) for k in (0, 1)]
    said = " | ".join(f"{rate:.2f}" for rate in rates)
    yield f"| {NUM_TASKS} tasks | {cpu_ms:.0f} ms | {shared_ms:.0f} ms | {ratio:.3f} | {said} |"


def _evaluated(num_workers: int, hosting: AgentHosting) -> tuple[float, float]:
    """CPU seconds a stage, and stages a second."""
    config = RunConfig(hosting=hosting)
    with TemporaryDirectory() as folder:
        began_s = time.perf_counter()
        evaluate(["fu"], task_files(BUNDLED_TASKS, NUM_TASKS), Path(folder), config=config, num_workers=num_workers)
        wall_s = time.perf_counter() - began_s
        with RunStore(Path(folder)) as store:
            cpu_s = [cpu_s for _, cpu_s in store.timings().values()]
    return statistics.mean(cpu_s), len(cpu_s) / wall_s


# A sandbox


def _sandboxes() -> Iterator[str]:
    yield "| `fu`, bundled | CPU a stage: sandbox | process | ratio | start: sandbox | process |"
    yield "| --- | --- | --- | --- | --- | --- |"
    if reason := sandbox_problem():
        yield f"| none here | {reason} |"
        return
    hostings = (AgentHosting("sandbox"), AgentHosting())
    pairs = [[_evaluated(1, hosting)[0] for hosting in hostings] for _ in range(2 * NUM_PAIRS + 1)]
    starts = [[_start_s(hosting) for hosting in hostings] for _ in range(2 * NUM_PAIRS + 1)]
    ratio = statistics.median(shut / free for shut, free in pairs)
    shut_ms, free_ms = (1e3 * statistics.median(column) for column in zip(*pairs, strict=True))
    start_s = " | ".join(f"{statistics.median(column):.2f} s" for column in zip(*starts, strict=True))
    yield f"| {NUM_TASKS} tasks | {shut_ms:.0f} ms | {free_ms:.0f} ms | {ratio:.3f} | {start_s} |"


def _start_s(hosting: AgentHosting) -> float:
    """Wall seconds until a process waits for requests."""
    began_s = time.perf_counter()
    with closing(AgentProcesses(hosting)) as processes:
        processes.lend("fu")
        return time.perf_counter() - began_s
