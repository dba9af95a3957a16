"""Store sampled points of every detection of every stored view: the view's content in three dimensions.

MSGNav stores depth images to turn a mask of an old view into points. Sampled points of the masks contain the same in a
hundredth of the space.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.points import Point3
from evonav.sensors.observation import View

Box = tuple[Point3, Point3]
"""Centre and edges of an axis-aligned box, in metres."""


@dataclass(frozen=True, slots=True)
class ViewClouds:
    """The points of one view's detections, in millimetres relative to its camera."""

    camera_m: Point3
    offsets_mm: NDArray[np.int16]
    """`(N, 3)` points, detection by detection."""
    ends: NDArray[np.int64]
    """`(D,)` end index of each detection's points."""
    boxes_m: tuple[Box | None, ...]
    """Box around each detection's points; `None` for a detection without depth."""

    def points_m(self, index: int) -> NDArray[np.float32]:
        """Return the `(N, 3)` points of a detection, world frame."""
        first = int(self.ends[index - 1]) if index else 0
        offsets_m = self.offsets_mm[first : int(self.ends[index])].astype(np.float32) * np.float32(1e-3)
        return offsets_m + np.array(self.camera_m, np.float32)


def clouds_of(view: View, *, max_points: int = 500) -> ViewClouds:
    """Return the points behind the masks of a view.

    Args:
        view: View with masks, depth, pose and intrinsics.
        max_points: Largest number of points of a detection, taken evenly from its pixels.

    Raises:
        InvalidArgumentError: An array has the wrong shape, or contains NaN.
    """
    camera_m = view.pose.position_m
    points_m, ends = _core.unproject_masks(
        view, view.detections.stored_masks, num_detections=len(view.detections.labels), max_points=max_points
    )
    limit = np.iinfo(np.int16).max
    offsets_mm = np.rint((points_m - np.array(camera_m, np.float32)) * np.float32(1e3))
    return ViewClouds(
        camera_m, np.clip(offsets_mm, -limit, limit).astype(np.int16), ends, _boxes_m(points_m.astype(np.float64), ends)
    )


def _boxes_m(points_m: NDArray[np.float64], ends: NDArray[np.int64]) -> tuple[Box | None, ...]:
    starts = np.concatenate([[0], ends[:-1]])
    has_points = starts < ends
    boxes: list[Box | None] = [None] * len(ends)
    if has_points.any():
        low = np.minimum.reduceat(points_m, starts[has_points])
        high = np.maximum.reduceat(points_m, starts[has_points])
        both = zip(((low + high) / 2.0).tolist(), (high - low).tolist(), strict=True)
        for index, (middle_m, size_m) in zip(np.flatnonzero(has_points).tolist(), both, strict=True):
            boxes[index] = ((middle_m[0], middle_m[1], middle_m[2]), (size_m[0], size_m[1], size_m[2]))
    return tuple(boxes)
