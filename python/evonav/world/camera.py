"""The pinhole camera of frames and views: AI2-THOR's, pixel centres at half-integers, planar depth."""

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics


def unproject(depth_m: NDArray[np.float32], pose: Pose, intrinsics: Intrinsics) -> NDArray[np.float64]:
    """World points behind a depth image.

    Args:
        depth_m: `(H, W)` planar z.
        pose: The camera's own, as `Frame.pose` is.
        intrinsics: Of the image.

    Returns:
        `(H, W, 3)` metres, not finite where the depth is not.

    Raises:
        InvalidArgumentError: The depth image is not C-contiguous, or pose or field of view are not finite.
    """
    return _core.unproject_image(
        depth_m,
        vertical_fov_rad=intrinsics.vertical_fov_rad,
        position_m=pose.position_m,
        yaw_rad=pose.yaw_rad,
        horizon_rad=pose.horizon_rad,
    )


def project(points_m: NDArray[np.float64], pose: Pose, intrinsics: Intrinsics) -> NDArray[np.float64]:
    """Where a camera sees points.

    Args:
        points_m: `(N, 3)`, world frame.
        pose: The camera's own, as `Frame.pose` is.
        intrinsics: Of the image.

    Returns:
        `(N, 3)` image column and row in pixels (a pixel's centre is at half-integers; the borders are not checked) and
        planar depth; NaN for points that are not in front of the camera.

    Raises:
        InvalidArgumentError: The points are not a C-contiguous `(N, 3)`, or pose or field of view are not finite.
    """
    return _core.project_points(
        points_m,
        image_px=(intrinsics.width_px, intrinsics.height_px),
        vertical_fov_rad=intrinsics.vertical_fov_rad,
        position_m=pose.position_m,
        yaw_rad=pose.yaw_rad,
        horizon_rad=pose.horizon_rad,
    )
