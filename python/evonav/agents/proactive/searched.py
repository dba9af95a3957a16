"""Cells of the floor, and what the views of a stage, and of all stages, would have shown if it were there."""

import math

import numpy as np
from numpy.typing import NDArray

from evonav.agents.grid import CoarseFrame
from evonav.agents.proactive.config import ProactiveConfig
from evonav.agents.proactive.presence import NUM_SECTORS
from evonav.sensors.observation import MapFrame, View
from evonav.world.camera import thinned, unproject

RANGES_M = (0.9, 1.3, 1.8, 2.5, 3.5)
"""Distances on the ground plane up to which things of different sizes are detected."""
STRIDES = (5, 3)
"""Every fifth pixel of every fifth row is looked at, if the size of the image allows it; else every third, or all."""


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
