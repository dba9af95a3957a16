"""What one camera pose may learn of the oracle occupancy."""

import math

from evonav import _core
from evonav.sensors.observation import VisibleOccupancy
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics, OccupancyGrid


def visible_occupancy(
    grid: OccupancyGrid, pose: Pose, intrinsics: Intrinsics, range_m: float = 3.0
) -> VisibleOccupancy:
    """Casts every ray of the camera's horizontal field of view over the oracle occupancy.

    The paper gives agents "an occupancy map extracted through ray-casting on the oracle occupancy map" (Sec. C.2).
    The cells are those of the ground plane, so the camera's pitch does not matter. The cell under the agent is always
    seen and never hides another.

    Args:
        grid: The oracle's cells.
        pose: Of the camera, world frame.
        intrinsics: Give the horizontal field of view.
        range_m: Reach of a ray, to where it enters a cell (3D-Mem's depth limit: 3.0 m).

    Returns:
        Free cells, and the first blocked cell of each ray.

    Raises:
        InvalidArgumentError: The pose is off the grid, or a number is not finite or outside its domain.
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
