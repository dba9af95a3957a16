"""Points of every detection of every kept view, thinned: what a stored view knows in three dimensions.

MSGNav keeps depth images to turn a mask of an old view into points. Thinned points of the masks say the same in a
hundredth of the space.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.sensors.observation import View


@dataclass(frozen=True, slots=True)
class ViewClouds:
    """The detections of one view, as millimetres from its camera."""

    camera_m: tuple[float, float, float]
    offsets_mm: NDArray[np.int16]
    """`(N, 3)`, detection by detection."""
    ends: NDArray[np.int64]
    """`(D,)` where each detection's points end."""

    def points_m(self, index: int) -> NDArray[np.float32]:
        """`(N, 3)` points of a detection, world frame."""
        first = int(self.ends[index - 1]) if index else 0
        offsets_m = self.offsets_mm[first : int(self.ends[index])].astype(np.float32) * np.float32(1e-3)
        return offsets_m + np.array(self.camera_m, np.float32)

    def box_m(self, index: int) -> tuple[tuple[float, float, float], tuple[float, float, float]] | None:
        """Middle and edges of the axis-aligned box around a detection; `None` for one without depth."""
        first = int(self.ends[index - 1]) if index else 0
        offsets = self.offsets_mm[first : int(self.ends[index])]
        if len(offsets) == 0:
            return None
        low, high = offsets.min(axis=0).tolist(), offsets.max(axis=0).tolist()
        x_m, y_m, z_m = (origin + (a + b) / 2e3 for origin, a, b in zip(self.camera_m, low, high, strict=True))
        width_m, height_m, depth_m = ((b - a) / 1e3 for a, b in zip(low, high, strict=True))
        return (x_m, y_m, z_m), (width_m, height_m, depth_m)


def clouds_of(view: View, *, max_points: int = 500) -> ViewClouds:
    """The points behind the masks of a view.

    Args:
        view: Its masks, depth, pose and intrinsics are used.
        max_points: Of a detection, every n-th of its pixels.

    Raises:
        InvalidArgumentError: An array does not fit, or holds NaN.
    """
    camera_m = (view.pose.x_m, view.camera_height_m, view.pose.z_m)
    points_m, ends = _core.unproject_masks(
        view.depth_m,
        view.detections.masks,
        num_detections=len(view.detections.labels),
        max_points=max_points,
        vertical_fov_rad=view.intrinsics.vertical_fov_rad,
        position_m=camera_m,
        yaw_rad=view.pose.yaw_rad,
        horizon_rad=view.pose.horizon_rad,
    )
    limit = np.iinfo(np.int16).max
    offsets_mm = np.rint((points_m - np.array(camera_m, np.float32)) * np.float32(1e3))
    return ViewClouds(camera_m, np.clip(offsets_mm, -limit, limit).astype(np.int16), ends)
