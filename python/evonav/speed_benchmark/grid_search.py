"""The peers of navigation: searches on the 8-connected grid of a house's reachable positions, in steps of 0.05 m."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.component import optional_module
from evonav.speed_benchmark.timing import INSTALL
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.simulator import SimulatorConfig

GRID_M = 0.05

Position3 = tuple[float, float, float]
Cell = tuple[int, int]
Search = Callable[["Grid", Cell, Cell], NDArray[np.intp]]
"""Returns the `(N, 2)` cells of a path."""


@dataclass(frozen=True)
class Grid:
    """The free space of a house."""

    costs: NDArray[np.float32]
    """`[row = z, col = x]`: 1 where reachable, else infinite."""
    corner_m: NDArray[np.float64]
    """`(x, z)` of cell (0, 0)."""

    def cell(self, position_m: Position3) -> Cell:
        """Return `(row, col)` of a position."""
        col, row = np.rint((np.array([position_m[0], position_m[2]]) - self.corner_m) / GRID_M).astype(int)
        return int(row), int(col)


def grid_of(house_json: str) -> Grid:
    """Return the grid of a house."""
    fine = EmbeddedSimulator(SimulatorConfig(grid_m=GRID_M))
    fine.reset(house_json)
    points_m = fine.reachable_positions()[:, [0, 2]]
    corner_m = points_m.min(axis=0)
    cells = np.rint((points_m - corner_m) / GRID_M).astype(int)
    costs = np.full(cells.max(axis=0)[::-1] + 1, np.inf, dtype=np.float32)
    costs[cells[:, 1], cells[:, 0]] = 1.0
    return Grid(costs, corner_m)


def grid_search(name: str) -> Search:
    """Return the search of a peer: `pyastar2d` or `scikit-image`."""
    if name == "pyastar2d":
        astar = optional_module("pyastar2d", "the peer pyastar2d needs its library", INSTALL).astar_path
        return lambda grid, start, target: np.asarray(
            astar(grid.costs, start, target, allow_diagonal=True), dtype=np.intp
        )
    route = optional_module("skimage.graph", "the peer scikit-image needs its library", INSTALL).route_through_array
    return lambda grid, start, target: np.asarray(
        route(grid.costs, start, target, fully_connected=True, geometric=True)[0], dtype=np.intp
    )


def distance_field(grid: Grid) -> Callable[[Cell], NDArray[np.float64]]:
    """Return SciPy's Dijkstra from one cell to all, in metres, on a graph that is made once."""
    dijkstra = optional_module("scipy.sparse.csgraph", "the peer scipy needs its library", INSTALL).dijkstra
    graph, num_cols = _graph(grid.costs), grid.costs.shape[1]
    return lambda start: np.asarray(dijkstra(graph, indices=start[0] * num_cols + start[1]), np.float64)


def _graph(costs: NDArray[np.float32]) -> Any:  # noqa: ANN401 - a sparse matrix of SciPy
    """Connect the free cells to their 8 neighbours, in metres."""
    sparse = optional_module("scipy.sparse", "the peer scipy needs its library", INSTALL)
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
    return sparse.csr_matrix((np.concatenate([lengths_m, lengths_m]), both_ways), shape=(costs.size, costs.size))
