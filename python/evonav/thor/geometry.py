"""Compute vectors and boxes as several actions need them."""

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from evonav.world.simulator import SceneObject

Vec3 = tuple[float, float, float]
Point = tuple[float, float]
"""`(x, z)` in metres."""


def vector(values: Iterable[float]) -> dict[str, float]:
    """Return Unity's `Vector3` as JSON."""
    return dict(zip("xyz", values, strict=True))


def box_around(bodies: Iterable[SceneObject]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the least and the greatest corner of the box around some bodies, at least one."""
    boxes_m = np.array([(body.centre_m, body.size_m) for body in bodies])
    centres_m, halves_m = boxes_m[:, 0], 0.5 * boxes_m[:, 1]
    return (centres_m - halves_m).min(axis=0), (centres_m + halves_m).max(axis=0)


def ground_gap_m(point_m: Point, centre_m: Sequence[float], size_m: Sequence[float]) -> float:
    """Return the distance on the ground plane from a point to a box, 0 inside it."""
    right_m, ahead_m = (
        max(abs(value - centre_m[axis]) - size_m[axis] / 2, 0.0) for axis, value in zip((0, 2), point_m, strict=True)
    )
    return math.hypot(right_m, ahead_m)
