"""Read a home's rooms and walls, the unknown floor and what was searched off the agent's own map."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from evonav.agents.grid import NO_GROUP, CoarseFrame, box_slices, eroded, grown, numbered
from evonav.agents.proactive.config import ProactiveConfig
from evonav.agents.proactive.presence import NUM_SECTORS
from evonav.decision.candidates import ObjectCandidate
from evonav.memory.occupancy import BLOCKED, FREE, UNKNOWN
from evonav.points import Point2
from evonav.sensors.observation import MapFrame, View
from evonav.world.camera import thinned, unproject

DOOR_HALF_WIDTH_M = 0.6
"""Floor less than twice this wide is a neck: ProcTHOR's doorways are about a metre wide."""
MIN_ROOM_M2 = 0.25
"""Smallest core of a room: what is left of it after this width is taken from all of its edges."""
SHRINK = 2
"""Rooms are found on a grid of blocks of this many rows and columns of cells."""
MAX_GROWTH_M = 2.0
"""Distance over which rooms grow back from their cores."""
FULL_KNOWN_SHARE = 0.5
"""Share of a coarse cell's map cells that must be unknown for it to count as unknown."""
NUM_SIGHT_SAMPLES = 8
"""Number of places on a line of sight that must not be in a wall."""
BESIDE_M = 0.25
"""Distance from an object's box within which blocked cells are its own: the agent fits nowhere there."""
RANGES_M = (0.9, 1.3, 1.8, 2.5, 3.5)
"""Distances on the ground plane up to which things of different sizes are detected."""
STRIDES = (5, 3)
"""Every fifth pixel of every fifth row is looked at, if the size of the image allows it; else every third, or all."""


def rooms_of(cells: NDArray[np.uint8], frame: MapFrame, furniture: list[ObjectCandidate]) -> NDArray[np.int32]:
    """Return the room of each cell.

    Args:
        furniture: Remembered objects; the floor under them belongs to a room, as they are no walls.

    Returns:
        `(R, C)` numbers of rooms from 0, by row and column of their first core cell; `NO_GROUP` elsewhere.
    """
    floor = cells == FREE
    for one in furniture:
        if one.centre_m[1] - one.size_m[1] / 2 < 0.3:  # it stands on the floor
            floor[box_slices(one, frame, 0.0)] = True
    edge_m, (rows, cols) = frame.cell_m * SHRINK, (size // SHRINK for size in floor.shape)
    blocks = floor[: rows * SHRINK, : cols * SHRINK].reshape(rows, SHRINK, cols, SHRINK).transpose(1, 3, 0, 2)
    depth = max(1, round(DOOR_HALF_WIDTH_M / edge_m))
    cores = numbered(eroded(blocks.all(axis=(0, 1)), depth), min_cells=max(1, round(MIN_ROOM_M2 / edge_m**2)))
    small_rooms = grown(cores, blocks.any(axis=(0, 1)), round(MAX_GROWTH_M / edge_m))
    rooms = np.full(floor.shape, NO_GROUP, np.int32)
    large = small_rooms.repeat(SHRINK, axis=0).repeat(SHRINK, axis=1)
    rooms[: large.shape[0], : large.shape[1]] = large
    rooms[~floor] = NO_GROUP
    return rooms


def walls_of(cells: NDArray[np.uint8], frame: MapFrame, remembered: Sequence[ObjectCandidate]) -> NDArray[np.bool_]:
    """Return the `(R, C)` blocked cells of the map that are not under or beside anything remembered."""
    walls: NDArray[np.bool_] = cells == BLOCKED
    for one in remembered:
        walls[box_slices(one, frame, BESIDE_M)] = False
    return walls


def unknown_cells(
    coarse: CoarseFrame, blocks: NDArray[np.generic], remembered: Sequence[ObjectCandidate]
) -> NDArray[np.bool_]:
    """Return the `(R, C)` coarse cells that are unknown in most of their area and under nothing remembered.

    Args:
        blocks: The map's cells, as `CoarseFrame.taken` returns them.
    """
    unknown: NDArray[np.bool_] = (blocks == UNKNOWN).mean(axis=0) > FULL_KNOWN_SHARE
    for one in remembered:
        unknown[box_slices(one, coarse.frame, 0.0)] = False
    return unknown


def shown_from(
    place_m: Point2, coarse: CoarseFrame, walls: NDArray[np.bool_], radius_m: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rows and columns of the coarse cells within a distance of a place that no wall hides from it.

    Args:
        walls: `(R, C)` cells of the agent's map that are blocked, and by nothing remembered.
    """
    frame = coarse.frame
    reach = math.ceil(radius_m / frame.cell_m)
    at_row, at_col = ((place_m[axis] - frame.corner_m[axis]) / frame.cell_m - 0.5 for axis in (1, 0))
    low_row, low_col = max(0, round(at_row) - reach), max(0, round(at_col) - reach)
    dy = np.arange(low_row, min(frame.rows, round(at_row) + reach + 1)) - at_row
    dx = np.arange(low_col, min(frame.cols, round(at_col) + reach + 1)) - at_col
    rows, cols = np.nonzero(dy[:, None] ** 2 + dx**2 <= (radius_m / frame.cell_m) ** 2)
    rows, cols = rows + low_row, cols + low_col
    along = np.linspace(0.15, 0.85, NUM_SIGHT_SAMPLES)[:, None]
    fine_rows = ((at_row + along * (rows - at_row) + 0.5) * coarse.step).astype(np.int64)
    fine_cols = ((at_col + along * (cols - at_col) + 0.5) * coarse.step).astype(np.int64)
    np.clip(fine_rows, 0, walls.shape[0] - 1, out=fine_rows)
    np.clip(fine_cols, 0, walls.shape[1] - 1, out=fine_cols)
    is_clear = ~walls.ravel().take(fine_rows * walls.shape[1] + fine_cols).any(axis=0)
    return rows[is_clear], cols[is_clear]


class SearchedCells:
    """Probabilities that a target at each cell would not have been detected."""

    def __init__(self, frame: MapFrame, config: ProactiveConfig) -> None:
        self._config = config
        self.coarse = CoarseFrame.over(frame)
        shape = (self.coarse.frame.rows, self.coarse.frame.cols)
        self._ever = np.ones((len(RANGES_M), *shape))
        self._stage = np.ones((len(RANGES_M), *shape))
        self._sectors = np.zeros((len(RANGES_M), NUM_SECTORS, *shape), np.bool_)

    def begin_stage(self) -> None:
        """Let things have moved to any place."""
        self._stage[:] = 1.0
        self._sectors[:] = False

    def forget(self) -> None:
        """Doubt all earlier looks."""
        self.begin_stage()
        self._ever[:] = 1.0

    def see(self, view: View) -> None:
        """Take in the surfaces that a view shows."""
        frame = self.coarse.frame
        rows, cols = seen_cells(view, frame, self._config.detection_range_m)
        dx_m, dz_m = ((view.pose.x_m, view.pose.z_m) - frame.centres_m(np.stack([rows, cols], axis=-1))).T
        sectors = (np.arctan2(dx_m, dz_m) % math.tau / math.tau * NUM_SECTORS).astype(int) % NUM_SECTORS
        missed = 1.0 - self._config.detection_rate
        gaps_m = np.hypot(dx_m, dz_m)
        cells = rows * frame.cols + cols
        at_sectors = sectors * (frame.rows * frame.cols) + cells
        for index, range_m in enumerate(RANGES_M):
            counts = gaps_m <= range_m
            if self._config.gates_sectors:
                seen = self._sectors[index].reshape(-1)
                counts &= ~seen[at_sectors]
                seen[at_sectors[counts]] = True
            at = cells[counts]
            self._stage[index].reshape(-1)[at] *= missed
            self._ever[index].reshape(-1)[at] *= missed

    def give_up(self, rows: NDArray[np.int64], cols: NDArray[np.int64], factor: float) -> None:
        """Lower the weight of cells that the agent went to see, whatever hides a part of them."""
        self._stage[:, rows, cols] *= factor
        self._ever[:, rows, cols] *= factor

    def missed(self, range_m: float) -> NDArray[np.float64]:
        """Return `(R, C)`: the probability that this stage's views missed a target at a cell.

        Args:
            range_m: Distance up to which the target can be detected.
        """
        found: NDArray[np.float64] = self._stage[_class_of(range_m)]
        return found

    def ever_missed(self, range_m: float) -> NDArray[np.float64]:
        """Return `(R, C)`: the same for the views of all stages."""
        found: NDArray[np.float64] = self._ever[_class_of(range_m)]
        return found


def _class_of(range_m: float) -> int:
    """Return the index of the longest range that is not longer than another, or the shortest."""
    return max(0, sum(one <= range_m for one in RANGES_M) - 1)


def seen_cells(view: View, frame: MapFrame, range_m: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rows and columns of the cells with a surface that a view shows within a distance on the ground plane."""
    depth_m, intrinsics, _ = thinned(view.depth_m, view.intrinsics, *STRIDES)
    points_m = unproject(depth_m, view.pose, intrinsics).reshape(-1, 3)
    dx_m, dz_m = points_m[:, 0] - view.pose.x_m, points_m[:, 2] - view.pose.z_m
    points_m = points_m[dx_m**2 + dz_m**2 <= range_m**2]  # none without a depth: these are not finite
    rows, cols = frame.cells_at(points_m[:, ::2]).T
    is_inside = (rows >= 0) & (rows < frame.rows) & (cols >= 0) & (cols < frame.cols)
    flat = np.zeros(frame.rows * frame.cols, np.bool_)
    flat[rows[is_inside] * frame.cols + cols[is_inside]] = True
    found = np.flatnonzero(flat)
    return found // frame.cols, found % frame.cols
