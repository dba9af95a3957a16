"""Shortest paths in bundled houses: any-angle among exact obstacles against searches on fine grids."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np
from numpy.typing import NDArray

from evonav.errors import SimulationError
from evonav.house import bundled_houses
from evonav.speed_benchmark.grid_search import (
    GRID_M,
    Cell,
    Grid,
    Position3,
    Search,
    distance_field,
    grid_of,
    grid_search,
)
from evonav.speed_benchmark.timing import Row, Sampling, compare
from evonav.world.embedded import EmbeddedSimulator

NAME, TITLE = "navigation", "Navigation"
NOTES = """\
Bundled houses, 20 pairs of positions in each. The peers search a grid of 0.05 m that was made beforehand; evonav's
paths are any-angle and exact. *First path*: the house was just loaded. *Longer*: the peer's paths, median.
"""
NUM_HOUSES = 12
PAIRS_PER_HOUSE = 20
PEERS = ("pyastar2d", "scikit-image", "scipy")
TITLES = {"pyastar2d": "pyastar2d", "scikit-image": "scikit-image route_through_array"}
DIJKSTRA = "scipy.sparse.csgraph.dijkstra, 0.05 m field"


@dataclass(frozen=True)
class LoadedHouse:
    """A house, and its free space as a grid."""

    name: str
    json: str
    simulator: EmbeddedSimulator
    reachable_m: NDArray[np.float64]
    """`(N, 3)` positions 0.25 m apart, each one a cell of the grid."""
    grid: Grid | None
    """`None` without peers."""


@dataclass(frozen=True)
class Query:
    """A path to find."""

    house: LoadedHouse
    start_m: Position3
    target_m: Position3


def measure(sampling: Sampling) -> Iterator[Row]:
    """Yield the times of one path, cold and warm, and of distances to all reachable positions.

    Raises:
        SimulationError: A path is longer than a peer's.
        StoreError: A named peer is not installed.
    """
    chosen = sampling.chosen(PEERS)
    queries = _queries(sampling.limit or NUM_HOUSES, has_grid=bool(chosen))
    houses = [query.house.name for query in queries]

    def ours(number: int) -> float:
        query = queries[number]
        corners_m = query.house.simulator.shortest_path(query.start_m, query.target_m)
        return float(np.linalg.norm(np.diff(corners_m, axis=0), axis=1).sum())

    names = map(str, count())  # a house of a known name would be used again, with its graph

    def load(number: int) -> None:
        house = queries[number].house
        house.simulator.reset(house.json, name=next(names))

    peers: dict[str, Callable[[int], float]] = {}
    for name in (name for name in chosen if name in TITLES):
        peer = _length_of(grid_search(name), queries)
        peers[f"{TITLES[name]} ({_percent_longer(peer, ours, len(queries)):.1f}% longer)"] = peer
    yield from compare("first path in a house", ours, peers, houses, sampling=sampling, prepare=load)
    for number in range(len(queries)):
        ours(number)
    yield from compare("path", ours, peers, houses, sampling=sampling, calls=5)

    def distances(number: int) -> object:
        query = queries[number]
        return query.house.simulator.path_lengths_m(query.start_m, query.house.reachable_m)

    fields = _fields(queries) if "scipy" in chosen else {}
    num_positions = int(np.median([len(query.house.reachable_m) for query in queries]))
    operation = f"distances to all reachable positions (median {num_positions})"
    yield from compare(operation, distances, fields, houses, sampling=sampling)


def _queries(num_houses: int, *, has_grid: bool) -> list[Query]:
    random = np.random.default_rng(0)
    queries = []
    for number, house in enumerate(bundled_houses(num_houses)):
        text, simulator = house.to_json(), EmbeddedSimulator()
        simulator.reset(text)
        name = house.name or str(number)
        loaded = LoadedHouse(
            name, text, simulator, simulator.reachable_positions(), grid_of(text) if has_grid else None
        )
        for pair in random.choice(len(loaded.reachable_m), (PAIRS_PER_HOUSE, 2)):
            start_m, target_m = (tuple(loaded.reachable_m[index].tolist()) for index in pair)
            queries.append(Query(loaded, start_m, target_m))
    return queries


def _length_of(search: Search, queries: Sequence[Query]) -> Callable[[int], float]:
    def call(number: int) -> float:
        query, grid = queries[number], queries[number].house.grid
        assert grid is not None, "houses have grids where there are peers"
        cells = search(grid, grid.cell(query.start_m), grid.cell(query.target_m))
        return GRID_M * float(np.linalg.norm(np.diff(cells, axis=0), axis=1).sum())

    return call


def _fields(queries: Sequence[Query]) -> dict[str, Callable[[int], object]]:
    found: dict[str, Callable[[Cell], NDArray[np.float64]]] = {}

    def call(number: int) -> object:
        house, grid = queries[number].house, queries[number].house.grid
        assert grid is not None, "houses have grids where there are peers"
        return found[house.name](grid.cell(queries[number].start_m))

    for query in queries:
        if query.house.name not in found and query.house.grid is not None:
            found[query.house.name] = distance_field(query.house.grid)
    return {DIJKSTRA: call}


def _percent_longer(peer: Callable[[int], float], ours: Callable[[int], float], num_queries: int) -> float:
    lengths_m = np.array([(peer(number), ours(number)) for number in range(0, num_queries, 4)])
    if (lengths_m[:, 1] > lengths_m[:, 0] + 1e-6).any():
        raise SimulationError("a path is longer than the grid's")
    return 100.0 * (float(np.median(lengths_m[:, 0] / np.maximum(lengths_m[:, 1], 1e-9))) - 1.0)
