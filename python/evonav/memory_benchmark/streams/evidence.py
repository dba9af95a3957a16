"""Say what a frame shows: pixels of objects, pixels that look through vacated places, the object of each detection.

Only what lies within `EVIDENCE_RANGE_M` of the camera on the ground plane is evidence, as for agents
(`evonav.evaluation.episode.staleness`).
"""

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.evaluation.episode.staleness import EVIDENCE_RANGE_M
from evonav.memory_benchmark.truth import ChangeKind, TrueChange
from evonav.perception.ground_truth import DETECTED_KINDS
from evonav.sensors.observation import Detections
from evonav.world.camera import camera_axes, project
from evonav.world.pose import Pose
from evonav.world.simulator import Frame, Intrinsics, SceneObject

MOVED_MIN_M = 0.1
"""Distance beyond which an object has moved (the paper's limit for *relocated*, Sec. 3.2)."""
TOUCH_M = 0.02
"""Depth up to which boxes only touch, and up to which a surface is a box's own far side: the table that it stood on."""
MIN_IOU = 0.25
"""Smallest overlap, intersection over union, of a detection with the object that it is a detection of."""

F64 = NDArray[np.float64]
Bodies = Sequence[SceneObject]


def objects_of(bodies: Bodies) -> tuple[SceneObject, ...]:
    """Return what the judge calls objects: no walls, floors, ceilings, doors and windows."""
    return tuple(body for body in bodies if body.kind == "object")


def changes_between(
    before: Bodies, after: Bodies, positions_m: Sequence[Mapping[str, tuple[float, float, float]]], frame: int
) -> list[TrueChange]:
    """Return what moved, vanished and appeared from one arrangement to the next, in the order of the objects.

    Opening a fridge changes its box, too, and is no change: what counts is the position in the house's file.

    Args:
        positions_m: Position of each object by id in the file of the house before, and after.
        frame: First frame at which the changes are true.
    """
    then, now = ({body.id: body for body in bodies} for bodies in (before, after))
    found = []
    for object_id in dict.fromkeys([*then, *now]):
        old, new = then.get(object_id), now.get(object_id)
        if old is not None and new is not None:
            if math.dist(positions_m[0][object_id], positions_m[1][object_id]) <= MOVED_MIN_M:
                continue
            kind: ChangeKind = "moved"
        else:
            kind = "removed" if new is None else "added"
        body = new or old
        assert body is not None
        found.append(TrueChange(object_id, body.category, kind, frame, old, new))
    return found


def is_taken(place: SceneObject, before: Bodies, now: Bodies) -> bool:
    """Return whether something stands now in the box that an object has left, which did not stand there before.

    Args:
        before: All objects while it was there.
    """
    others = {body for body in before if body.id != place.id}
    return any(body not in others and _overlap(place, body) for body in now)


def _overlap(a: SceneObject, b: SceneObject) -> bool:
    edges = zip(a.centre_m, a.size_m, b.centre_m, b.size_m, strict=True)
    return all((size + other_size) / 2.0 - abs(at - other) > TOUCH_M for at, size, other, other_size in edges)


def visible_px(frame: Frame, bodies: Bodies, range_m: float = EVIDENCE_RANGE_M) -> dict[str, int]:
    """Return the pixels of each object in a frame, without those of 0 pixels and those out of range.

    Args:
        frame: Rendered with instances.
        bodies: The simulator's bodies, in instance order.
        range_m: Largest distance on the ground plane between camera and centre of the object.
    """
    assert frame.stored_instances is not None
    areas = _core.instance_areas(frame.stored_instances, len(bodies))
    found = {}
    for index in np.flatnonzero(areas).tolist():
        body = bodies[index]
        if body.kind == "object" and _distance_m(frame.pose, body) <= range_m:
            found[body.id] = int(areas[index])
    return found


def empty_px(
    frame: Frame, places: Iterable[tuple[int, SceneObject]], range_m: float = EVIDENCE_RANGE_M
) -> dict[int, int]:
    """Return the pixels that look through each vacated place, without those of 0 pixels and those out of range.

    Args:
        frame: The frame with its ideal depth.
        places: Index of the change, and the object at the place that it has left.
        range_m: Largest distance on the ground plane between camera and place.
    """
    found = {}
    for index, place in places:
        if _distance_m(frame.pose, place) <= range_m:
            number = num_looks_through(frame.depth_m, frame.pose, frame.intrinsics, place)
            if number:
                found[index] = number
    return found


def num_looks_through(depth_m: NDArray[np.float32], pose: Pose, intrinsics: Intrinsics, place: SceneObject) -> int:
    """Return the number of pixels whose rays meet a box, and behind which the depth image shows something.

    Args:
        depth_m: `(H, W)` planar depth; `inf` is behind everything.
        pose: Pose of the camera itself.
    """
    low_m = np.array(place.centre_m) - np.array(place.size_m) / 2.0
    high_m = low_m + np.array(place.size_m)
    corners_m = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * (high_m - low_m) + low_m
    rows, cols = _rectangle(project(corners_m, pose, intrinsics), intrinsics)
    if not (len(rows) and len(cols)):
        return 0
    # A ray's parameter is its planar depth, since its direction has length 1 along the optical axis.
    right, up, forward = camera_axes(pose)
    across = ((cols + 0.5 - intrinsics.width_px / 2.0) / intrinsics.focal_px)[None, :]
    down = ((rows + 0.5 - intrinsics.height_px / 2.0) / intrinsics.focal_px)[:, None]
    eye_m = (pose.x_m, pose.y_m, pose.z_m)
    enter = np.full((len(rows), len(cols)), 0.0)
    leave = np.full((len(rows), len(cols)), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for axis in range(3):
            along = forward[axis] + across * right[axis] - down * up[axis]
            a, b = (low_m[axis] - eye_m[axis]) / along, (high_m[axis] - eye_m[axis]) / along
            np.fmax(enter, np.minimum(a, b), out=enter)
            np.fmin(leave, np.maximum(a, b), out=leave)
    seen = depth_m[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
    return int(np.count_nonzero((enter < leave) & (seen >= leave - TOUCH_M)))


def _rectangle(corners: F64, intrinsics: Intrinsics) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the rows and columns that a projected box covers; all of them if a corner is not in front."""
    if np.isnan(corners).all():
        return np.arange(0), np.arange(0)
    edges = []
    for axis, length in ((1, intrinsics.height_px), (0, intrinsics.width_px)):
        first, last = 0, length
        if not np.isnan(corners).any():
            first = max(0, math.floor(corners[:, axis].min()))
            last = min(length, math.ceil(corners[:, axis].max()))
        edges.append(np.arange(first, max(first, last)))
    return edges[0], edges[1]


def _distance_m(pose: Pose, body: SceneObject) -> float:
    return math.hypot(body.centre_m[0] - pose.x_m, body.centre_m[2] - pose.z_m)


def detected_ids(detections: Detections, frame: Frame, bodies: Bodies) -> tuple[str | None, ...]:
    """Return the object, door or window of each detection: the one of largest overlap, if it is at least `MIN_IOU`.

    Args:
        frame: The frame in which they were made, with instances.
        bodies: The simulator's bodies, in instance order.
    """
    assert frame.instances is not None
    count = len(detections.labels)
    if not count:
        return ()
    is_in = detections.masks >= 0
    keys = detections.masks[is_in].astype(np.int64) * (len(bodies) + 1) + frame.instances[is_in]
    both = np.bincount(keys, minlength=count * (len(bodies) + 1)).reshape(count, -1)[:, 1:].astype(np.float64)
    areas = _core.instance_areas(frame.instances, len(bodies)).astype(np.float64)
    sizes = np.bincount(detections.masks[is_in], minlength=count).astype(np.float64)
    ious = both / np.maximum(areas[None, :] + sizes[:, None] - both, 1.0)
    ious[:, [body.kind not in DETECTED_KINDS for body in bodies]] = 0.0
    best = ious.argmax(axis=1)
    return tuple(
        bodies[index].id if ious[number, index] >= MIN_IOU else None for number, index in enumerate(best.tolist())
    )
