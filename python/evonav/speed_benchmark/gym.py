"""Environment steps: the vector environment against Gymnasium's own, and one image against other renderers."""

import os
import statistics
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from evonav.speed_benchmark.image_peers import image_peers, our_renderer, views_of_houses
from evonav.speed_benchmark.rendering import prepare_all, require_same
from evonav.speed_benchmark.timing import Row, Sampling, compare, one_core, rows_of
from evonav.world.simulator import SimulatorConfig

NAME, TITLE = "gym", "Gymnasium"
NOTES = """\
`evonav/LifelongNav-v0` over the bundled tasks: 128x128 depth, random moves, new houses as in training; two threads.
Times are CPU time of all threads and processes; steps/s are by the wall clock, at that load.
"""
ENV_ID = "evonav.gym:evonav/LifelongNav-v0"
NUM_ENVS = (1, 8, 64)
STEPS, ROUNDS = 64, 3
MAX_ASYNC = 8
NUM_HOUSES = 12
SETTINGS: dict[str, Any] = {"observations": ("depth", "pose", "category", "steps_left")}
SIDE_PX = 128
ACTIONS = (0.597, 0.199, 0.199, 0.005)
VECTORS = {"sync": "gymnasium SyncVectorEnv", "async": "gymnasium AsyncVectorEnv"}
IMAGE_PEERS = ("embreex", "moderngl")


def measure(sampling: Sampling, *, num_envs: Sequence[int] = NUM_ENVS, num_steps: int = STEPS) -> Iterator[Row]:
    """Yield the time of a step for each number of environments, and of one image.

    Args:
        sampling: Its `limit` is the number of houses of which images are drawn.
        num_envs: Sizes of the vector environments.

    Raises:
        StoreError: A named peer is not installed.
    """
    chosen = sampling.chosen((*VECTORS, *IMAGE_PEERS))
    for number in num_envs:
        yield from _steps_of(number, [name for name in VECTORS if name in chosen], sampling, num_steps)
    config = SimulatorConfig(width_px=SIDE_PX, height_px=SIDE_PX)
    simulators, views = views_of_houses(config, sampling.limit or NUM_HOUSES)
    ours = our_renderer(simulators, views, rgb=False)
    images = replace(
        sampling, peers=None if sampling.peers is None else [name for name in chosen if name in IMAGE_PEERS]
    )
    with one_core():
        peers = image_peers(images, simulators, views, config, rgb=False)
        require_same(ours, peers, len(views))
        houses = [view.name for view in views]
        operation = f"one image: depth + instances, {SIDE_PX}x{SIDE_PX}"
        yield from compare(operation, ours, peers, houses, sampling=images, prepare=prepare_all(peers))


def _steps_of(num_envs: int, vectors: Sequence[str], sampling: Sampling, num_steps: int) -> list[Row]:
    load = {"load": os.getloadavg()[0]} if hasattr(os, "getloadavg") else {}
    envs = _made(num_envs, vectors)
    try:
        wall_s, cpu_ms = _rounds(envs, sampling, num_steps)
    finally:
        for one in envs.values():
            one.close()
    num = num_envs * num_steps
    facts = {"steps/s": num / statistics.median(wall_s), **load}
    operation = f"a step of one of {num_envs}" if num_envs > 1 else "a step of one environment"
    ours_ms = cpu_ms.pop("evonav")
    peers_ms = {VECTORS[name]: times_ms for name, times_ms in cpu_ms.items()}
    return rows_of(operation, ours_ms, peers_ms, ["bundled"] * len(ours_ms), facts)


def _made(num_envs: int, vectors: Sequence[str]) -> dict[str, Any]:
    """Make the environments, those with processes first: they are forked from a process without threads."""
    envs: dict[str, Any] = {}
    for name in ("async", "sync"):
        if name in vectors and (name == "sync" or (num_envs <= MAX_ASYNC and Path("/proc/self/stat").exists())):
            envs[name] = gymnasium.make_vec(ENV_ID, num_envs=num_envs, vectorization_mode=name, **SETTINGS)
    envs["evonav"] = gymnasium.make_vec(ENV_ID, num_envs=num_envs, num_threads=2, **SETTINGS)
    return envs


def _rounds(envs: Mapping[str, Any], sampling: Sampling, num_steps: int) -> tuple[list[float], dict[str, list[float]]]:
    """Return our wall times of a round in seconds, and the CPU times of a step of everybody in milliseconds."""
    for one in envs.values():
        one.reset(seed=0)
        _step(one, 8)
    wall_s: list[float] = []
    cpu_ms: dict[str, list[float]] = {name: [] for name in envs}
    num_rounds = ROUNDS * sampling.repeats
    for turn in range(num_rounds):
        for name, one in envs.items():
            start_s, start_cpu_s = time.perf_counter(), _cpu_s(one)
            _step(one, num_steps, turn)
            if name == "evonav":
                wall_s.append(time.perf_counter() - start_s)
            cpu_ms[name].append(1e3 * (_cpu_s(one) - start_cpu_s) / (one.num_envs * num_steps))
        sampling.on_progress(turn + 1, num_rounds, f"environments: {envs['evonav'].num_envs}")
    return wall_s, cpu_ms


def _step(envs: Any, num_steps: int, seed: int = 0) -> None:  # noqa: ANN401 - of any kind
    random = np.random.default_rng(seed)
    for _ in range(num_steps):
        envs.step(random.choice(4, p=ACTIONS, size=envs.num_envs))


def _cpu_s(envs: Any) -> float:  # noqa: ANN401 - of any kind
    """Return the CPU time of this process and of the environments' own."""
    total_s = time.process_time()
    for process in getattr(envs, "processes", ()):
        fields = Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        total_s += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return total_s
