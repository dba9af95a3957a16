"""Grids of cells: a coarser grid over a map, groups of neighbouring cells, and the cells under an object."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav.decision.candidates import ObjectCandidate
from evonav.memory import Frontier
from evonav.points import Point2
from evonav.sensors.observation import MapFrame

COARSE_M = 0.25
"""Wanted edge of a coarse cell, which is a whole number of the map's cells."""
NO_GROUP = -1
"""Number of a cell that belongs to no group."""


@dataclass(frozen=True, slots=True)
class CoarseFrame:
    """A grid of coarser cells over a map."""

    frame: MapFrame
    step: int
    """Number of the map's cells along the edge of a coarse one."""

    @classmethod
    def over(cls, frame: MapFrame) -> "CoarseFrame":
        """Return the grid over a map."""
        step = max(1, round(COARSE_M / frame.cell_m))
        return cls(
            MapFrame(math.ceil(frame.rows / step), math.ceil(frame.cols / step), frame.cell_m * step, frame.corner_m),
            step,
        )

    def taken(self, cells: NDArray[np.generic], rest: int) -> NDArray[np.generic]:
        """Return `(step * step, R, C)`: the map's cells in each coarse one; `rest` stands beyond the map's edges."""
        rows, cols, step = self.frame.rows, self.frame.cols, self.step
        padded = np.full((rows * step, cols * step), rest, cells.dtype)
        padded[: cells.shape[0], : cells.shape[1]] = cells
        return padded.reshape(rows, step, cols, step).transpose(1, 3, 0, 2).reshape(step * step, rows, cols)

    def value_at(self, values: NDArray[np.float64], place_m: tuple[float, float]) -> float:
        """Return the value of the `(R, C)` cells at a place, or at the nearest cell."""
        return float(values[self.frame.cell_at(place_m)])


def numbered(cells: NDArray[np.bool_], min_cells: int) -> NDArray[np.int32]:
    """Return the 4-connected groups of at least `min_cells` cells, numbered in row-major order; -1 elsewhere."""
    edges = np.diff(np.pad(cells.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    rows, starts = np.nonzero(edges == 1)
    _, ends = np.nonzero(edges == -1)
    runs = list(zip(rows.tolist(), starts.tolist(), ends.tolist(), strict=True))
    parents = list(range(len(runs)))

    def root(one: int) -> int:
        while parents[one] != one:
            parents[one] = parents[parents[one]]
            one = parents[one]
        return one

    first = 0  # run that may touch the present one from the row before
    for index, (row, start, end) in enumerate(runs):
        while runs[first][0] < row - 1 or (runs[first][0] < row and runs[first][2] <= start):
            first += 1
        other = first
        while runs[other][0] < row and runs[other][1] < end:
            a, b = root(other), root(index)
            parents[max(a, b)] = min(a, b)
            other += 1
    sizes: dict[int, int] = {}
    for index, (_, start, end) in enumerate(runs):
        sizes[root(index)] = sizes.get(root(index), 0) + end - start
    large = [one for one in sorted(sizes) if sizes[one] >= min_cells]
    numbers = {one: number for number, one in enumerate(large)}
    groups = np.full(cells.shape, NO_GROUP, np.int32)
    for index, (row, start, end) in enumerate(runs):
        groups[row, start:end] = numbers.get(root(index), NO_GROUP)
    return groups


def grown(groups: NDArray[np.int32], floor: NDArray[np.bool_], max_steps: int) -> NDArray[np.int32]:
    """Return the groups, grown over the floor, a cell a step in four directions; the larger number wins a tie."""
    padded = np.full((groups.shape[0] + 2, groups.shape[1] + 2), NO_GROUP, np.int32)
    inner = padded[1:-1, 1:-1]
    inner[:] = groups
    is_open = floor & (groups == NO_GROUP)
    for _ in range(max_steps):
        near = np.maximum(padded[:-2, 1:-1], padded[2:, 1:-1])
        np.maximum(near, padded[1:-1, :-2], out=near)
        np.maximum(near, padded[1:-1, 2:], out=near)
        is_new = is_open & (near != NO_GROUP)
        if not is_new.any():
            break
        inner[is_new] = near[is_new]
        is_open &= ~is_new
    return inner.copy()


def owners_of(
    frontiers: Sequence[Frontier], is_open: NDArray[np.bool_], coarse: CoarseFrame, reach_m: float
) -> NDArray[np.int32]:
    """Return the frontier behind which each coarse cell lies.

    Args:
        is_open: `(R, C)` coarse cells that a frontier can lead to.
        reach_m: Number of steps over such cells, times their edge, up to which they count as behind a frontier.

    Returns:
        `(R, C)` index of the frontier to whose region a cell belongs, or from which it is reached first over open
        cells; `NO_GROUP` elsewhere.
    """
    owners = np.full((coarse.frame.rows, coarse.frame.cols), NO_GROUP, np.int32)
    for index, frontier in enumerate(frontiers):
        owners[frontier.cells[:, 0] // coarse.step, frontier.cells[:, 1] // coarse.step] = index
    return grown(owners, is_open, round(reach_m / coarse.frame.cell_m))


def eroded(floor: NDArray[np.bool_], depth: int) -> NDArray[np.bool_]:
    """Return the cells whose square of `depth` cells in each direction is all floor."""
    if depth == 0:
        return floor
    width = 2 * depth + 1
    for _ in range(2):  # along the rows, then along the columns
        sums = np.zeros((len(floor) + width, floor.shape[1]), np.int32)
        np.cumsum(floor, axis=0, out=sums[depth + 1 : depth + 1 + len(floor)])
        sums[depth + 1 + len(floor) :] = sums[depth + len(floor)]
        floor = (sums[width:] - sums[:-width] == width).T
    return floor


def box_slices(one: ObjectCandidate, frame: MapFrame, margin_m: float) -> tuple[slice, slice]:
    """Return the rows and columns of the cells within a distance of an object's box."""
    slices = []
    for axis, corner, size in ((2, frame.corner_m[1], frame.rows), (0, frame.corner_m[0], frame.cols)):
        half_m = one.size_m[axis] / 2 + margin_m
        low = math.floor((one.centre_m[axis] - half_m - corner) / frame.cell_m)
        high = math.ceil((one.centre_m[axis] + half_m - corner) / frame.cell_m)
        slices.append(slice(min(max(low, 0), size), min(max(high, 0), size)))
    return slices[0], slices[1]


def box_distance_m(one: ObjectCandidate, place_m: Point2) -> float:
    """Return the distance of a place from an object's box on the ground plane; 0 inside."""
    gaps = (
        max(0.0, abs(place - one.centre_m[axis]) - one.size_m[axis] / 2.0)
        for place, axis in zip(place_m, (0, 2), strict=True)
    )
    return math.hypot(*gaps)
