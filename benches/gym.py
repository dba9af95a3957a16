"""Environment steps a second: the vector environment against Gymnasium's own, other renderers and another world."""

import os
import resource
import statistics
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import evonav.gym
from benches.rendering import _Embree, _OpenGL, _ours, _views
from benches.table import compare
from evonav.gym import ENV_ID
from evonav.world.simulator import SimulatorConfig

NOTES = """`evonav/LifelongNav-v0` over the bundled tasks: 128x128 depth, pose, category and steps left; moves and turns
at random (60% ahead), geodesic progress as reward, a stop in 200 actions, so that new houses are built as they are in
training; two threads on two cores. *Sync* and *async* are Gymnasium's vector environments over the same environment;
async starts a process for each, and is not tried beyond 8. *A CPU second* is a second of one core, summed over all
threads and processes: two cores give two of them a second. A ratio is the median over the rounds, in which all take
turns; above 1 evonav is faster. The wall clock's steps are those of a machine with the load named below.
"""
STEPS = 64
ROUNDS = 3
MAX_ASYNC = 8
NUM_ENVS = (1, 2, 4, 8, 16, 32, 64)
SETTINGS: dict[str, Any] = {"observations": ("depth", "pose", "category", "steps_left")}
PIXELS = 128
ACTIONS = (0.597, 0.199, 0.199, 0.005)


def run() -> str:
    """Two tables: whole environments, and one image of other renderers and worlds."""
    if hasattr(os, "sched_setaffinity"):  # the other sections run on one core
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
    load = os.getloadavg()[0]
    lines = [
        "| environments | evonav, steps/s | a CPU second | sync, a CPU second | ratio | async, a CPU second | ratio |",
        "| --- | --- | --- | --- | --- | --- | --- |",
        *(_line(num_envs) for num_envs in NUM_ENVS),
        "",
        f"Load while measuring: {load:.1f} processes on {os.cpu_count()} cores before it began.",
        "",
        *_images(),
    ]
    return "\n".join(lines)


def _line(num_envs: int) -> str:
    envs: dict[str, Any] = {}
    if num_envs <= MAX_ASYNC:  # first: its processes are forked from one without threads
        envs["async"] = gymnasium.make_vec(ENV_ID, num_envs=num_envs, vectorization_mode="async", **SETTINGS)
    envs["sync"] = gymnasium.make_vec(ENV_ID, num_envs=num_envs, vectorization_mode="sync", **SETTINGS)
    envs["evonav"] = gymnasium.make_vec(ENV_ID, num_envs=num_envs, num_threads=2, **SETTINGS)
    for one in envs.values():
        one.reset(seed=0)
        _steps(one, 8)
    wall: dict[str, list[float]] = {name: [] for name in envs}
    cpu: dict[str, list[float]] = {name: [] for name in envs}
    for turn in range(ROUNDS):
        for name, one in envs.items():
            start_s, cpu_s = time.perf_counter(), _cpu_s(one)
            _steps(one, STEPS, turn)
            wall[name].append(num_envs * STEPS / (time.perf_counter() - start_s))
            cpu[name].append(num_envs * STEPS / (_cpu_s(one) - cpu_s))
    for one in envs.values():
        one.close()
    cells = [f"{statistics.median(wall['evonav']):,.0f}", f"{statistics.median(cpu['evonav']):,.0f}"]
    for name in ("sync", "async"):
        if name not in cpu:
            cells += ["", ""]
            continue
        ratio = statistics.median(ours / theirs for ours, theirs in zip(cpu["evonav"], cpu[name], strict=True))
        cells += [f"{statistics.median(cpu[name]):,.0f}", f"{ratio:.1f}"]
    return f"| {num_envs} | {' | '.join(cells)} |"


def _steps(envs: Any, num_steps: int, seed: int = 0) -> None:  # noqa: ANN401 - of any kind
    random = np.random.default_rng(seed)
    for _ in range(num_steps):
        envs.step(random.choice(4, p=ACTIONS, size=envs.num_envs))


def _cpu_s(envs: Any) -> float:  # noqa: ANN401 - of any kind
    """CPU time of this process and of the environments' own."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    total_s = used.ru_utime + used.ru_stime
    for process in getattr(envs, "processes", ()):
        fields = Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        total_s += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return total_s


def _images() -> list[str]:
    """One image, without an environment around it; and another world's whole step."""
    os.environ["LP_NUM_THREADS"] = "0"
    config = SimulatorConfig(width_px=PIXELS, height_px=PIXELS)
    simulators, views = _views(config)
    embree, opengl = _Embree(simulators, views, config), _OpenGL(simulators, views, config, rgb=False)
    ours = _ours(simulators, views, rgb=False)
    peers = {"embreex": embree, f"moderngl on {opengl.name}": opengl}
    rows = compare("depth + instances", ours, peers, len(views), prepare=embree.prepare)
    lines = [f"| one image, {PIXELS}x{PIXELS} | evonav | peer | its time | ratio |", "| --- | --- | --- | --- | --- |"]
    lines += [
        f"| {row.operation} | {row.evonav_ms:.3g} ms | {row.peer} | {row.peer_ms:.3g} ms | {row.ratio:.1f} |"
        for row in rows
    ]
    return [*lines, *_miniworld()]


def _miniworld() -> list[str]:
    """A step of MiniWorld's FourRooms with its depth image, beside a step of the environment alone and in a batch."""
    try:
        import pyglet

        pyglet.options["headless"] = True
        import miniworld  # noqa: F401 - registers
    except ImportError:
        return ["", "MiniWorld is not installed here (`pip install miniworld`)."]
    their = gymnasium.make("MiniWorld-FourRooms-v0", obs_width=PIXELS, obs_height=PIXELS).unwrapped
    their.reset(seed=0)
    alone = gymnasium.make(ENV_ID, **SETTINGS).unwrapped
    alone.reset(seed=0)
    batch = gymnasium.make_vec(ENV_ID, num_envs=16, num_threads=1, **SETTINGS)
    batch.reset(seed=0)

    def step_theirs(number: int) -> None:
        if any(their.step((2, 2, 2, 0, 1)[number % 5])[2:4]):
            their.reset()
        their.render_depth()

    def step_alone(number: int) -> None:
        if alone.step((0, 0, 0, 1, 2)[number % 5])[2]:
            alone.reset()

    def step_batch(number: int) -> None:
        batch.step(np.full(16, (0, 0, 0, 1, 2)[number % 5]))

    name = "MiniWorld FourRooms, colour + depth, on llvmpipe"
    rows = compare("a step of one environment, depth", step_alone, {name: step_theirs}, 128)
    cpu_s, our_ms = time.process_time(), 0.0
    for number in range(32):
        step_batch(number)
    our_ms = 1e3 * (time.process_time() - cpu_s) / (32 * 16)
    batch.close()
    row = rows[0]
    assert row.peer_ms is not None  # it was run
    their_ms = row.peer_ms
    return [
        f"| {row.operation} | {row.evonav_ms:.3g} ms | {name} | {row.peer_ms:.3g} ms | {row.ratio:.1f} |",
        f"| a step of one of 16, depth | {our_ms:.3g} ms | the same | {their_ms:.3g} ms | {their_ms / our_ms:.1f} |",
    ]


assert evonav.gym.ENV_ID in gymnasium.registry
