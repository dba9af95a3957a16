"""UniGoal's bird's-eye map: obstacles, explored cells, and where each category is.

Specification: UniGoal (Yin et al., CVPR 2025), whose mapping is SemExp's; docs/memory.md says where ours differs.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.memory.occupancy import BLOCKED, FREE, UNKNOWN
from evonav.points import Point2
from evonav.sensors.observation import MapFrame, View

Cells = NDArray[np.int32]
"""`(N, 2)` `[row, col]` of a map."""


@dataclass(frozen=True, slots=True)
class BevConfig:
    """UniGoal's constants; strides and depths are those of our camera."""

    size_m: float = 36.0
    """Edge of the map."""
    cell_m: float = 0.05
    """Edge of a cell and of a voxel."""
    block_m: float = 5.0
    """Points up to this far ahead, and half as far to either side, are used."""
    heights_m: tuple[float, float] = (-0.8, 3.6)
    """Heights over the floor of the points that are used."""
    obstacle_min_m: float = 0.35
    """Surfaces from this height on are obstacles ..."""
    obstacle_above_camera_m: float = 0.01
    """... up to this much over the camera."""
    max_depth_m: float = 29.7
    """99% of the original's 30 m; beyond is no measurement."""
    stride_px: int = 2
    """Every second pixel: 150 x 150 points, where the original has 160 x 120."""
    category_points: int = 5
    """Points of a category in a cell that make it certain."""


class BevMap:
    """Everything seen in one task. Nothing is ever taken back: each cell has the maximum of all views."""

    def __init__(self, centre_m: Point2, num_categories: int, config: BevConfig | None = None) -> None:
        """Create an empty map.

        Args:
            centre_m: `(x, z)` of its middle: where the agent starts.
            num_categories: Number of categories that pixels may have.

        Raises:
            InvalidArgumentError: A parameter is outside its domain; the message names it.
        """
        self.config = config = config or BevConfig()
        self.core = _core.BevMap(centre_m, num_categories, config)
        """The map in Rust: what was seen, where the agent has been and collided, and paths."""
        rows, cols = self.core.shape
        self.map_frame = MapFrame(rows, cols, config.cell_m, self.core.corner_m)

    def integrate(self, view: View, categories: NDArray[np.int32] | None = None) -> None:
        """Add a view.

        Args:
            view: A view; only its depth and camera are used.
            categories: `(H, W)` category index of each pixel, -1 for none; `None`: no pixel has one.

        Raises:
            InvalidArgumentError: An image has another shape, or a category is out of range; the map stays as it is.
        """
        self.core.integrate(view, categories)

    def cell_of(self, point_m: Point2) -> tuple[int, int] | None:
        """Return the `(row, col)` of the cell that contains `(x, z)`; `None` off the map."""
        row, col = self.map_frame.cells_at(np.array(point_m)).tolist()
        return (row, col) if 0 <= row < self.map_frame.rows and 0 <= col < self.map_frame.cols else None

    @property
    def cells(self) -> NDArray[np.uint8]:
        """`(R, C)`: `UNKNOWN`, `FREE` or `BLOCKED`, as in other maps."""
        cells = np.full(self.core.shape, UNKNOWN, np.uint8)
        cells[self.core.explored | self.core.visited] = FREE
        cells[self.core.obstacles | self.core.collisions] = BLOCKED
        return cells
