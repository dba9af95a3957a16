"""Compute which cells of the oracle occupancy one camera pose reveals."""

import math

from evonav import _core
from evonav.sensors.observation import VisibleOccupancy
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics, OccupancyGrid


def visible_occupancy(
    grid: OccupancyGrid, pose: Pose, intrinsics: Intrinsics, range_m: float = 3.0
) -> VisibleOccupancy:
    """Cast every ray of the camera's horizontal field of view over the oracle occupancy.

    The paper gives agents "an occupancy map extracted through ray-casting on the oracle occupancy map" (Sec. C.2).
    The cells are on the ground plane, so the camera's pitch does not matter. The cell below the agent is always visible
    and never hides another.

    Args:
        grid: The oracle's cells.
        pose: Pose of the camera, world frame.
        intrinsics: Intrinsics, for the horizontal field of view.
        range_m: Reach of a ray, to the point where it enters a cell (3D-Mem's depth limit: 3.0 m).

    Returns:
        Free cells, and the first blocked cell of each ray.

    Raises:
        InvalidArgumentError: The pose is off the grid, or a number is not finite or out of range.
    """
    free, blocked = _core.visible_cells(
        grid.cells,
        cell_m=grid.cell_m,
        corner_m=grid.corner_m,
        origin_m=(pose.x_m, pose.z_m),
        yaw_rad=pose.yaw_rad,
        horizontal_fov_rad=2.0 * math.atan(intrinsics.width_px / 2.0 / intrinsics.focal_px),
        range_m=range_m,
    )
    return VisibleOccupancy(free=free, blocked=blocked)
