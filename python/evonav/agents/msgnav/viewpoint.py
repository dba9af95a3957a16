"""Find where to stand so that remembered points show most of an object (MSGNav's viewpoint decision)."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evonav.memory.objects import ObjectMap
from evonav.points import Point2
from evonav.sensors.observation import MapFrame

NUM_CANDIDATES = 20
"""Number of places to try, evenly spaced on a circle around the mean of the object's points (MSGNav)."""
RADIUS_M = 0.75
"""Radius of that circle."""
EYE_HEIGHT_M = 1.5
"""Height of the eye over the floor."""


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """A place to stand."""

    position_m: Point2
    share: float
    """Share of the object's points that are seen from there."""
    found: Literal["circle", "snapped", "box"]
    """The place is on the circle; on free floor near it; or, if no place shows the object, at the object's box."""


def visible_viewpoint(
    objects: ObjectMap,
    target_m: NDArray[np.float32],
    is_free: NDArray[np.bool_],
    frame: MapFrame,
    here_m: Point2,
) -> Viewpoint:
    """Return the place that shows most of an object, the first of equals.

    Candidates lie on a circle around the object where the floor is free. If none of them shows anything, all of them
    are moved to the nearest free cells. If those show nothing either, the place is the middle of the bottom edge of the
    object's box that is nearest to the agent, free or not: the planner ends at the nearest free point.

    Args:
        objects: Remembered objects, which may hide the target.
        target_m: `(N, 3)` points of the object, at least one.
        is_free: `(R, C)`, cells known to be free.
        here_m: `(x, z)` of the agent.
    """
    mean_m = target_m.mean(axis=0, dtype=np.float64)
    angles_rad = np.arange(NUM_CANDIDATES) * (math.tau / NUM_CANDIDATES)
    offsets = np.stack([np.sin(angles_rad), np.cos(angles_rad)], axis=1)
    circle_m = mean_m[[0, 2]] + RADIUS_M * offsets
    best = _best(objects, target_m, circle_m[_are_free(circle_m, is_free, frame)])
    if best is not None:
        return Viewpoint(*best, "circle")
    best = _best(objects, target_m, _snapped(circle_m, is_free, frame))
    if best is not None:
        return Viewpoint(*best, "snapped")
    low, high = target_m.min(axis=0).astype(np.float64), target_m.max(axis=0).astype(np.float64)
    x_m, _, z_m = ((low + high) / 2.0).tolist()
    (low_x_m, _, low_z_m), (high_x_m, _, high_z_m) = low.tolist(), high.tolist()
    middles_m = [(low_x_m, z_m), (high_x_m, z_m), (x_m, low_z_m), (x_m, high_z_m)]
    return Viewpoint(min(middles_m, key=lambda middle_m: math.dist(middle_m, here_m)), 0.0, "box")


def _best(
    objects: ObjectMap, target_m: NDArray[np.float32], places_m: NDArray[np.float64]
) -> tuple[Point2, float] | None:
    """Return the first of the places that show most; `None` if none shows anything."""
    if len(places_m) == 0:
        return None
    eyes_m = np.insert(places_m, 1, EYE_HEIGHT_M, axis=1)
    shares = objects.visible_shares(target_m, eyes_m)
    index = int(shares.argmax())
    if shares[index] <= 0.0:
        return None
    return (float(places_m[index, 0]), float(places_m[index, 1])), float(shares[index])


def _are_free(places_m: NDArray[np.float64], is_free: NDArray[np.bool_], frame: MapFrame) -> NDArray[np.bool_]:
    rows, cols = frame.cells_at(places_m).T
    is_inside = (rows >= 0) & (rows < frame.rows) & (cols >= 0) & (cols < frame.cols)
    found: NDArray[np.bool_] = is_inside & is_free[rows.clip(0, frame.rows - 1), cols.clip(0, frame.cols - 1)]
    return found


def _snapped(places_m: NDArray[np.float64], is_free: NDArray[np.bool_], frame: MapFrame) -> NDArray[np.float64]:
    """Return the middles of the free cells that are nearest to some places; none if no cell is free."""
    cells = np.argwhere(is_free)
    if len(cells) == 0:
        return np.empty((0, 2))
    middles_m = frame.centres_m(cells)
    nearest = [int(((middles_m - place_m) ** 2).sum(axis=1).argmin()) for place_m in places_m]
    snapped: NDArray[np.float64] = np.ascontiguousarray(middles_m[nearest])
    return snapped
