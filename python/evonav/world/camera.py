"""Project with AI2-THOR's pinhole camera: pixel centres at half-integers, planar depth."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics


@dataclass(frozen=True, slots=True)
class CameraView:
    """A camera anywhere in the scene, as AI2-THOR's third-party cameras."""

    pose: Pose
    """Pose of the optical centre; any horizon, also straight down (`pi / 2`)."""
    width_px: int = 300
    height_px: int = 300
    vertical_fov_rad: float = math.pi / 2
    """Field of view between the upper and the lower border; an orthographic view does not use it."""
    near_m: float = 0.1
    far_m: float = 20.0
    """Planar depths between which surfaces are drawn, `near_m` to `far_m`."""
    roll_rad: float = 0.0
    """Turn about the optical axis before all others, as Unity's z rotation: the image's right side goes up."""
    orthographic_half_height_m: float | None = None
    """Half of the image's height in metres (Unity's `orthographicSize`); `None` for a perspective view."""


class Images(NamedTuple):
    """The images of one camera."""

    depth_m: NDArray[np.float32]
    """`(H, W)` planar depth in metres, `inf` where nothing is."""
    rgb: NDArray[np.uint8] | None
    """`(H, W, 3)` colours; `None` if not requested."""
    instances: NDArray[np.int32] | None
    """`(H, W)` instance ids: 0 where nothing is, else 1 + index of the body; `None` if not requested."""


def thinned(
    depth_m: NDArray[np.float32], intrinsics: Intrinsics, *strides_px: int
) -> tuple[NDArray[np.float32], Intrinsics, slice]:
    """Return every n-th pixel of every n-th row of a depth image, and the camera that has such pixels.

    Args:
        depth_m: `(H, W)` planar depth.
        strides_px: Values for n; the first that divides height and width is taken, else 1.

    Returns:
        `(H / n, W / n)` depth, its intrinsics, and the rows and columns that were taken.
    """
    height_px, width_px = depth_m.shape
    stride = next((one for one in strides_px if height_px % one == width_px % one == 0), 1)
    taken = slice(stride // 2, None, stride)
    fewer = Intrinsics(width_px // stride, height_px // stride, intrinsics.vertical_fov_rad)
    return np.ascontiguousarray(depth_m[taken, taken]), fewer, taken


def unproject(depth_m: NDArray[np.float32], pose: Pose, intrinsics: Intrinsics) -> NDArray[np.float64]:
    """Return the world points behind a depth image.

    Args:
        depth_m: `(H, W)` planar depth.
        pose: Pose of the camera itself, as `Frame.pose`.

    Returns:
        `(H, W, 3)` metres, not finite where the depth is not.

    Raises:
        InvalidArgumentError: The depth image is not C-contiguous, or pose or field of view are not finite.
    """
    return _core.unproject_image(depth_m, pose, intrinsics)


def unproject_pixels(
    rows: NDArray[np.int64], cols: NDArray[np.int64], depth_m: NDArray[np.float32], pose: Pose, intrinsics: Intrinsics
) -> NDArray[np.float64]:
    """Return the world points behind some pixels of a depth image; to a rounding error those of `unproject`.

    Args:
        rows: `(N,)` of the pixels, all of which have a finite depth.
        cols: `(N,)` of the pixels.
        depth_m: `(H, W)` planar depth.
        pose: Pose of the camera itself, as `Frame.pose`.

    Returns:
        `(N, 3)` metres.
    """
    height_px, width_px = depth_m.shape
    depth_m = depth_m[rows, cols]
    focal_px = 0.5 * height_px / math.tan(0.5 * intrinsics.vertical_fov_rad)
    right_m = (cols + 0.5 - 0.5 * width_px) / focal_px * depth_m
    up_m = (0.5 * height_px - rows - 0.5) / focal_px * depth_m
    yaw, horizon = pose.yaw_rad, pose.horizon_rad
    ahead_m = depth_m * math.cos(horizon) + up_m * math.sin(horizon)
    return np.stack(
        [
            pose.x_m + right_m * math.cos(yaw) + ahead_m * math.sin(yaw),
            pose.y_m + up_m * math.cos(horizon) - depth_m * math.sin(horizon),
            pose.z_m - right_m * math.sin(yaw) + ahead_m * math.cos(yaw),
        ],
        axis=1,
    )


def camera_axes(pose: Pose) -> NDArray[np.float64]:
    """Return the unit vectors of a camera's right, up and forward, as `(3, 3)` rows in the world frame."""
    sin_yaw, cos_yaw = math.sin(pose.yaw_rad), math.cos(pose.yaw_rad)
    sin_down, cos_down = math.sin(pose.horizon_rad), math.cos(pose.horizon_rad)
    return np.array(
        [
            [cos_yaw, 0.0, -sin_yaw],
            [sin_yaw * sin_down, cos_down, cos_yaw * sin_down],
            [sin_yaw * cos_down, -sin_down, cos_yaw * cos_down],
        ]
    )


def project(points_m: NDArray[np.float64], pose: Pose, intrinsics: Intrinsics) -> NDArray[np.float64]:
    """Return the image positions of world points.

    Args:
        points_m: `(N, 3)`, world frame.
        pose: Pose of the camera itself, as `Frame.pose`.

    Returns:
        `(N, 3)` image column and row in pixels (a pixel's centre is at half-integers; the borders are not checked) and
        planar depth; NaN for points that are not in front of the camera.

    Raises:
        InvalidArgumentError: The points are not a C-contiguous `(N, 3)`, or pose or field of view are not finite.
    """
    return _core.project_points(points_m, pose, intrinsics)
