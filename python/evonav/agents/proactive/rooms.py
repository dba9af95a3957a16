"""Rooms of the agent's own map: free floor, cut where it is as narrow as a door."""

import math

import numpy as np
from numpy.typing import NDArray

from evonav.decision.candidates import ObjectCandidate, Point2
from evonav.memory.occupancy import FREE
from evonav.sensors.observation import MapFrame

NO_ROOM = -1
DOOR_HALF_WIDTH_M = 0.6
"""Floor less than twice this wide is a neck: ProcTHOR's doorways are about a metre wide."""
MIN_ROOM_M2 = 0.25
"""Smallest core of a room: what is left of it after this width is taken from all of its edges."""
SHRINK = 2
"""Rooms are found on a grid of blocks of this many rows and columns of cells."""
MAX_GROWTH_M = 2.0
"""Distance over which rooms grow back from their cores."""


def rooms_of(cells: NDArray[np.uint8], frame: MapFrame, furniture: list[ObjectCandidate]) -> NDArray[np.int32]:
    """Return the room of each cell.

    Args:
        cells: `(R, C)` of the agent's map.
        frame: Frame of the map.
        furniture: Remembered objects; the floor under them belongs to a room, as they are no walls.

    Returns:
        `(R, C)` numbers of rooms from 0, by row and column of their first core cell; `NO_ROOM` elsewhere.
    """
    floor = cells == FREE
    for one in furniture:
        if one.centre_m[1] - one.size_m[1] / 2 < 0.3:  # it stands on the floor
            floor[box_slices(one, frame, 0.0)] = True
    edge_m, (rows, cols) = frame.cell_m * SHRINK, (size // SHRINK for size in floor.shape)
    blocks = floor[: rows * SHRINK, : cols * SHRINK].reshape(rows, SHRINK, cols, SHRINK)
    depth = max(1, round(DOOR_HALF_WIDTH_M / edge_m))
    cores = numbered(eroded(blocks.all(axis=(1, 3)), depth), min_cells=max(1, round(MIN_ROOM_M2 / edge_m**2)))
    small_rooms = grown(cores, blocks.any(axis=(1, 3)), round(MAX_GROWTH_M / edge_m))
    rooms = np.full(floor.shape, NO_ROOM, np.int32)
    large = small_rooms.repeat(SHRINK, axis=0).repeat(SHRINK, axis=1)
    rooms[: large.shape[0], : large.shape[1]] = large
    rooms[~floor] = NO_ROOM
    return rooms


def box_slices(one: ObjectCandidate, frame: MapFrame, margin_m: float) -> tuple[slice, slice]:
    """Return the rows and columns of the cells within a distance of an object's box."""
    slices = []
    for axis, corner, size in ((2, frame.corner_m[1], frame.rows), (0, frame.corner_m[0], frame.cols)):
        half_m = one.size_m[axis] / 2 + margin_m
        low = int(np.floor((one.centre_m[axis] - half_m - corner) / frame.cell_m))
        high = int(np.ceil((one.centre_m[axis] + half_m - corner) / frame.cell_m))
        slices.append(slice(min(max(low, 0), size), min(max(high, 0), size)))
    return slices[0], slices[1]


def box_distance_m(one: ObjectCandidate, place_m: Point2) -> float:
    """Return the distance of a place from an object's box on the ground plane; 0 inside."""
    gaps = (
        max(0.0, abs(place - one.centre_m[axis]) - one.size_m[axis] / 2.0)
        for place, axis in zip(place_m, (0, 2), strict=True)
    )
    return math.hypot(*gaps)


def eroded(floor: NDArray[np.bool_], depth: int) -> NDArray[np.bool_]:
    """Return the cells whose square of `depth` cells in each direction is all floor."""
    for axis in (0, 1):
        padded = np.pad(floor, [(depth, depth) if a == axis else (0, 0) for a in (0, 1)])
        sums = np.cumsum(padded, axis=axis, dtype=np.int32)
        zero = np.zeros_like(np.take(sums, [0], axis=axis))
        sums = np.concatenate((zero, sums), axis=axis)
        width = 2 * depth + 1
        size = floor.shape[axis]
        ends, starts = np.arange(width, width + size), np.arange(size)
        floor = np.take(sums, ends, axis=axis) - np.take(sums, starts, axis=axis) == width
    return floor


def numbered(cells: NDArray[np.bool_], min_cells: int) -> NDArray[np.int32]:
    """Return the 4-connected groups of at least `min_cells` cells, numbered in row-major order; -1 elsewhere."""
    parents: list[int] = []
    runs: list[tuple[int, int, int]] = []

    def root(one: int) -> int:
        while parents[one] != one:
            parents[one] = parents[parents[one]]
            one = parents[one]
        return one

    previous: list[int] = []
    edges = np.diff(np.pad(cells.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    for row in range(len(cells)):
        starts, ends = np.flatnonzero(edges[row] == 1).tolist(), np.flatnonzero(edges[row] == -1).tolist()
        present = []
        for start, end in zip(starts, ends, strict=True):
            index = len(runs)
            runs.append((row, start, end))
            parents.append(index)
            present.append(index)
            for other in previous:
                _, other_start, other_end = runs[other]
                if other_start < end and start < other_end:
                    a, b = root(other), root(index)
                    parents[max(a, b)] = min(a, b)
        previous = present
    sizes: dict[int, int] = {}
    for index, (_, start, end) in enumerate(runs):
        sizes[root(index)] = sizes.get(root(index), 0) + end - start
    large = [one for one in sorted(sizes) if sizes[one] >= min_cells]
    numbers = {one: number for number, one in enumerate(large)}
    rooms = np.full(cells.shape, NO_ROOM, np.int32)
    for index, (row, start, end) in enumerate(runs):
        rooms[row, start:end] = numbers.get(root(index), NO_ROOM)
    return rooms


def grown(rooms: NDArray[np.int32], floor: NDArray[np.bool_], max_steps: int) -> NDArray[np.int32]:
    """Return the rooms after growing over the floor, a cell a step in four directions; the larger number wins a tie."""
    rooms = rooms.copy()
    for _ in range(max_steps):
        padded = np.pad(rooms, 1, constant_values=NO_ROOM)
        near = np.maximum.reduce([padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:]])
        new = floor & (rooms == NO_ROOM) & (near != NO_ROOM)
        if not new.any():
            break
        rooms[new] = near[new]
    return rooms
