"""Single operations of two versions in turn on the same inputs, and of the best peer of each."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import faiss
import numpy as np

from benches import memory
from benches.versions.lines import NONE, Line, milliseconds, pairwise
from benches.versions.version import Version
from evonav.house import bundled_houses
from evonav.speed_benchmark.grid_search import DistanceField, grid_of, grid_search
from evonav.speed_benchmark.image_peers import image_peers
from evonav.speed_benchmark.timing import Sampling, cpu_ms, one_core
from evonav.speed_benchmark.views import views_of_houses
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.simulator import SimulatorConfig

NUM_HOUSES, PAIRS_PER_HOUSE, NUM_MAPS = 12, 20, 5


@dataclass
class Peer:
    """Another implementation, called as an operation of the versions is."""

    name: str
    call: Callable[[int], object]
    prepare: Callable[[int], object] = lambda _: None
    calls: int = 5


def write_inputs(path: Path) -> None:
    """Writes what both versions work on: houses, views, pairs of places, a floor, and views of boxes."""
    houses = [house.to_json() for house in bundled_houses(NUM_HOUSES)]
    _, views = views_of_houses(SimulatorConfig(), NUM_HOUSES)
    random, pairs, pair_houses = np.random.default_rng(0), [], []
    for number, text in enumerate(houses):
        simulator = EmbeddedSimulator()
        simulator.reset(text)
        reachable_m = simulator.reachable_positions()
        pairs += [reachable_m[pair] for pair in random.choice(len(reachable_m), (PAIRS_PER_HOUSE, 2))]
        pair_houses += [number] * PAIRS_PER_HOUSE
    looks = [*memory.looks_at_boxes(), memory.frame()]
    np.savez(
        path,
        houses=np.array(houses),
        views=np.array([[v.house, *v.camera.pose.position_m, v.camera.pose.yaw_rad] for v in views]),
        pairs=np.array(pairs),
        pair_houses=np.array(pair_houses),
        floor=memory.floor().cells,
        floor_views=np.array(memory.WALK),
        floor_agent=np.array(memory.AGENT_M),
        box_depths=np.array([look.depth_m for look in looks]),
        box_masks=np.array([look.detections.masks for look in looks], np.int8),
        box_poses=np.array([[*look.pose.position_m, look.pose.yaw_rad, look.pose.horizon_rad] for look in looks]),
        num_maps=NUM_MAPS,
    )


def lines(before: Version, after: Version) -> Iterator[Line]:
    """The rows of images, memory, navigation and environments."""
    yield from _images(before, after)
    yield _compared(before, after, "frontiers, 400x400", ("frontiers",), 100, _opencv(), "20 times the peer")
    yield _compared(before, after, "frontiers after one view more", ("next_frontiers",), 100, None, "0.03 ms")
    work = "object memory, 20 masks, 100 entries, 0.01 m"
    yield _compared(before, after, work, ("objects",), NUM_MAPS, _open3d(), "1.5 ms, 600 times the peer")
    num_pairs = NUM_HOUSES * PAIRS_PER_HOUSE
    yield _compared(before, after, "first path in a house", ("path",), num_pairs, _astar(), "ahead of the peer")
    work = "distances to all reachable positions"
    yield _compared(before, after, work, ("distances",), num_pairs, _dijkstra(), "5 times the peer")
    for num_envs, num_steps in ((2, 256), (64, 32)):
        yield from _environments(before, after, num_envs, num_steps)


def _compared(
    before: Version, after: Version, work: str, operation: tuple[Any, ...], num: int, peer: Peer | None, aim: str
) -> Line:
    old_ms, new_ms, peer_ms = [], [], []
    numbers = range(num)
    same = sum(before.answer(operation, n) == after.answer(operation, n) for n in numbers[:: max(1, num // 20)])
    with one_core():
        for number in numbers:
            turns = [(before, old_ms), (after, new_ms)]
            for version, times_ms in turns[:: 1 if number % 2 else -1]:
                times_ms.append(version.time(operation, number)["cpu_ms"])
            if peer is not None:
                peer.prepare(number)
                times_ms = [cpu_ms(peer.call, number) for _ in range(peer.calls)]
                peer_ms.append(min(times_ms[1:] or times_ms))
    asked = len(numbers[:: max(1, num // 20)])
    work = work if same == asked else f"{work} (same answer: {same} of {asked})"
    line = Line(work, milliseconds(old_ms), milliseconds(new_ms), pairwise(old_ms, new_ms), aim)
    if peer is None:
        return line
    figure, ratios = milliseconds(peer_ms), (pairwise(peer_ms, old_ms), pairwise(peer_ms, new_ms))
    return Line(line.work, line.before, line.after, line.gain, aim, peer.name, figure, *ratios)


def _images(before: Version, after: Version) -> Iterator[Line]:
    for width_px, height_px, style, aim in (
        (128, 128, None, "0.05 ms"),
        (300, 300, None, "7 times the peer"),
        (300, 300, "plain", "4 times the peer"),
        (640, 480, None, ""),
    ):
        config = SimulatorConfig(width_px=width_px, height_px=height_px)
        simulators, views = views_of_houses(config, NUM_HOUSES)
        peers = image_peers(Sampling(peers=("moderngl",)), simulators, views, config, rgb=style is not None)
        (name, drawn), *_ = peers.items()
        work = f"depth + instances{'' if style is None else f' + colours, {style}'}, {width_px}x{height_px}"
        operation = ("images", width_px, height_px, style)
        yield _compared(before, after, work, operation, len(views), Peer(name, drawn, drawn.prepare), aim)
    with one_core():
        times_ms = [after.time(("images", 300, 300, "default"), number)["cpu_ms"] for number in range(len(views))]
    yield Line("depth + instances + colours, default, 300x300", NONE, milliseconds(times_ms))


def _opencv() -> Peer:
    seen = memory.explored_floor()
    free, unexplored = (seen.cells == 1).astype(np.uint8), (~seen.explored).astype(np.uint8)
    return Peer("OpenCV, regions only", lambda _: memory.frontiers_opencv(free, unexplored, memory.AGENT_CELL))


def _open3d() -> Peer:
    entries, view = memory.full_map(memory.looks_at_boxes()), memory.frame()
    faiss.omp_set_num_threads(1)
    stored = memory.clouds_of(entries)
    return Peer("Open3D + faiss", lambda _: memory.associate_open3d(stored, view, entries.config), calls=1)


def _grids() -> tuple[list[Any], list[tuple[int, Any, Any]]]:
    """Grids of the houses, and a house, a start and an end a pair of places."""
    grids, queries, random = [], [], np.random.default_rng(0)
    for number, house in enumerate(bundled_houses(NUM_HOUSES)):
        simulator = EmbeddedSimulator()
        simulator.reset(house.to_json())
        reachable_m = simulator.reachable_positions()
        grids.append(grid_of(house.to_json()))
        for pair in random.choice(len(reachable_m), (PAIRS_PER_HOUSE, 2)):
            queries.append((number, *(grids[-1].cell(tuple(place)) for place in reachable_m[pair])))
    return grids, queries


def _astar() -> Peer:
    (grids, queries), search = _grids(), grid_search("pyastar2d")

    def call(number: int) -> object:
        house, start, end = queries[number]
        return search(grids[house], start, end)

    return Peer("pyastar2d, its grid ready", call, calls=1)


def _dijkstra() -> Peer:
    grids, queries = _grids()
    fields = [DistanceField(grid) for grid in grids]
    return Peer("SciPy, Dijkstra on a 0.05 m grid", lambda n: fields[queries[n][0]](queries[n][1]), calls=2)


def _environments(before: Version, after: Version, num_envs: int, num_steps: int) -> Iterator[Line]:
    found: dict[str, list[dict[str, float]]] = {"before": [], "after": [], "sync": []}
    for number in range(5):
        for name, version, kind in (("before", before, "own"), ("after", after, "own"), ("sync", after, "sync")):
            found[name].append(version.time(("vector", num_envs, num_steps, kind), number))
    for clock, said, aim in (
        ("cpu_ms", "a CPU second", "3 times the peer"),
        ("wall_ms", "by the wall clock", "30,000" if num_envs == 64 else ""),
    ):
        rates = {name: [1e3 * num_envs * num_steps / turn[clock] for turn in turns] for name, turns in found.items()}
        before_s, after_s, sync_s = (sorted(rates[name])[len(rates[name]) // 2] for name in found)
        gain = pairwise(rates["after"], rates["before"])
        ratios = (pairwise(rates["before"], rates["sync"]), pairwise(rates["after"], rates["sync"]))
        yield Line(
            f"vector environment of {num_envs}, 128x128 depth, steps/s {said}",
            f"{before_s:,.0f}",
            f"{after_s:,.0f}",
            gain,
            aim,
            "Gymnasium's sync",
            f"{sync_s:,.0f}",
            *ratios,
        )
