"""Shortest paths in bundled houses: any-angle among exact obstacles against searches on fine grids."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pyastar2d
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from skimage.graph import route_through_array

from benches.table import Row, compare
from evonav.house import bundled_houses
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.simulator import SimulatorConfig

NOTES = """Bundled houses, 20 pairs of reachable positions in each. The peers search the 8-connected grid of all
positions that are reachable in steps of 0.05 m, made (and for SciPy, turned into a graph) beforehand; evonav's paths
are any-angle and exact. *First path*: the house was just loaded, nothing is cached; *path*: every pair was asked for
once before. *Longer* is the median length of the peer's paths over evonav's, none of which is longer than the peer's.
(pyastar2d counts a diagonal as one step.)
"""
NUM_HOUSES = 12
PAIRS_PER_HOUSE = 20
GRID_M = 0.05

_Position = tuple[float, float, float]


@dataclass(frozen=True)
class House:
    """A loaded house, and its free space as a grid."""

    json: str
    simulator: EmbeddedSimulator
    costs: NDArray[np.float32]
    """`[row = z, col = x]`: 1 where reachable, else infinite."""
    corner_m: NDArray[np.float64]
    """`(x, z)` of cell (0, 0)."""
    graph: csr_matrix
    """Of the cells, 8-connected, metres."""
    reachable_m: NDArray[np.float64]
    """`(N, 3)` positions 0.25 m apart, each one a cell of the grid."""

    def cell(self, position_m: _Position) -> tuple[int, int]:
        """`(row, col)` of a position."""
        col, row = np.rint((np.array([position_m[0], position_m[2]]) - self.corner_m) / GRID_M).astype(int)
        return int(row), int(col)


@dataclass(frozen=True)
class Query:
    """A path to find."""

    house: House
    start_m: _Position
    target_m: _Position


def run() -> list[Row]:
    """Times one path, cold and warm, and distances to all reachable positions."""
    houses = [_load(house.to_json()) for house in itertools.islice(bundled_houses(), NUM_HOUSES)]
    random = np.random.default_rng(0)
    queries = []
    for house in houses:
        for pair in random.choice(len(house.reachable_m), (PAIRS_PER_HOUSE, 2)):
            start_m, target_m = (tuple(house.reachable_m[index].tolist()) for index in pair)
            queries.append(Query(house, start_m, target_m))

    def ours(number: int) -> float:
        query = queries[number]
        corners_m = query.house.simulator.shortest_path(query.start_m, query.target_m)
        return float(np.linalg.norm(np.diff(corners_m, axis=0), axis=1).sum())

    def load(number: int) -> None:
        queries[number].house.simulator.reset(queries[number].house.json)

    peers = {f"{name}{_longer(peer, ours, queries)}": _length_of(peer, queries) for name, peer in _PEERS.items()}
    rows = compare("first path in a house", ours, peers, len(queries), prepare=load)
    for number in range(len(queries)):
        ours(number)
    rows += compare("path", ours, peers, len(queries), repeats=5)

    def distances(number: int) -> object:
        query = queries[number]
        return query.house.simulator.path_lengths_m(query.start_m, query.house.reachable_m)

    def field(number: int) -> object:
        house, row_col = queries[number].house, queries[number].house.cell(queries[number].start_m)
        return dijkstra(house.graph, indices=row_col[0] * house.costs.shape[1] + row_col[1])

    positions = int(np.median([len(house.reachable_m) for house in houses]))
    operation = f"distances to all reachable positions (median {positions})"
    return rows + compare(operation, distances, {"scipy.sparse.csgraph.dijkstra, 0.05 m field": field}, len(queries))


def _load(json: str) -> House:
    fine, simulator = EmbeddedSimulator(SimulatorConfig(grid_m=GRID_M)), EmbeddedSimulator()
    fine.reset(json)
    simulator.reset(json)
    points_m = fine.reachable_positions()[:, [0, 2]]
    corner_m = points_m.min(axis=0)
    cells = np.rint((points_m - corner_m) / GRID_M).astype(int)
    costs = np.full(cells.max(axis=0)[::-1] + 1, np.inf, dtype=np.float32)
    costs[cells[:, 1], cells[:, 0]] = 1.0
    return House(json, simulator, costs, corner_m, _graph(costs), simulator.reachable_positions())


def _graph(costs: NDArray[np.float32]) -> csr_matrix:
    is_free = np.isfinite(costs)
    index = np.arange(costs.size).reshape(costs.shape)
    edges = []
    for d_row, d_col in ((0, 1), (1, 0), (1, 1), (1, -1)):
        rows = slice(0, costs.shape[0] - d_row), slice(d_row, costs.shape[0])
        ahead = slice(0, costs.shape[1] - abs(d_col)), slice(abs(d_col), costs.shape[1])
        cols = ahead if d_col >= 0 else ahead[::-1]
        both = is_free[rows[0], cols[0]] & is_free[rows[1], cols[1]]
        a, b = index[rows[0], cols[0]][both], index[rows[1], cols[1]][both]
        edges.append((a, b, np.full(len(a), GRID_M * float(np.hypot(d_row, d_col)))))
    a, b, lengths_m = (np.concatenate(parts) for parts in zip(*edges, strict=True))
    both_ways = np.concatenate([a, b]), np.concatenate([b, a])
    return csr_matrix((np.concatenate([lengths_m, lengths_m]), both_ways), shape=(costs.size, costs.size))


_Peer = Callable[[House, tuple[int, int], tuple[int, int]], NDArray[np.intp]]


def _astar(house: House, start: tuple[int, int], target: tuple[int, int]) -> NDArray[np.intp]:
    path = pyastar2d.astar_path(house.costs, start, target, allow_diagonal=True)
    return np.asarray(path, dtype=np.intp)


def _route(house: House, start: tuple[int, int], target: tuple[int, int]) -> NDArray[np.intp]:
    path, _ = route_through_array(house.costs, start, target, fully_connected=True, geometric=True)
    return np.asarray(path, dtype=np.intp)


_PEERS: dict[str, _Peer] = {"pyastar2d": _astar, "scikit-image route_through_array": _route}


def _length_of(peer: _Peer, queries: list[Query]) -> Callable[[int], float]:
    def call(number: int) -> float:
        query = queries[number]
        cells = peer(query.house, query.house.cell(query.start_m), query.house.cell(query.target_m))
        return GRID_M * float(np.linalg.norm(np.diff(cells, axis=0), axis=1).sum())

    return call


def _longer(peer: _Peer, ours: Callable[[int], float], queries: list[Query]) -> str:
    call = _length_of(peer, queries)
    lengths_m = np.array([(call(number), ours(number)) for number in range(0, len(queries), 4)])
    ratios = lengths_m[:, 0] / np.maximum(lengths_m[:, 1], 1e-9)
    if (lengths_m[:, 1] > lengths_m[:, 0] + 1e-6).any():
        message = "a path is longer than the grid's"
        raise RuntimeError(message)
    return f" ({100.0 * (float(np.median(ratios)) - 1.0):.1f}% longer)"
