"""Match the detections of one view with the objects in it, by the overlap of masks.

Objects that ground-truth perception would report are *wanted*. Smaller ones, doors and windows are *ignored* as in
COCO: finding one is neither required nor counted as an error. Matching is COCO's: detections by falling confidence
each take the free object of largest IoU. Masks of a view do not overlap, and so at most one object has more than half
in common with a detection: with a limit of 0.5, any assignment gives the same pairs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.errors import InvalidArgumentError
from evonav.sensors.observation import Detections
from evonav.world.simulator import Frame, SceneObject

IOU_LIMIT = 0.5
MIN_AREA_PX = 25
MIN_AREA_SHARE = 0.001
"""Limit as in `GroundTruthPerception`: an object of fewer pixels, or a smaller part of the image, is ignored."""
IGNORED_KINDS = ("door", "window")

NONE, IGNORED = -1, -2
"""Marks in place of a partner: there is none, or it does not count."""


@dataclass(frozen=True, slots=True)
class TrueObjects:
    """Objects in a view, the wanted ones first."""

    bodies: NDArray[np.int64]
    """`(T,)` index of each in the simulator's table."""
    num_wanted: int
    labels: tuple[str, ...]
    areas_px: NDArray[np.int64]
    distances_m: NDArray[np.float64]
    """`(T,)` median depth (planar z) of its pixels."""
    outline_shares: NDArray[np.float64]
    """`(T,)` part of its outline that is its own, see `own_outlines`."""
    masks: NDArray[np.int32]
    """`(H, W)`, -1 where none is."""


@dataclass(frozen=True, slots=True)
class Matches:
    """Pairs of one matching."""

    detection_of: NDArray[np.int64]
    """`(T,)` partner of each object, or `NONE`."""
    object_of: NDArray[np.int64]
    """`(D,)` partner of each detection, `NONE`, or `IGNORED` for one that found an ignored object."""
    ious: NDArray[np.float64]
    """`(D,)` with its partner, an ignored one too; 0 without."""


def true_objects(frame: Frame, objects: Sequence[SceneObject]) -> TrueObjects:
    """Collect the objects that are to be found in a frame.

    Args:
        frame: Rendered with instances.
        objects: The simulator's bodies, in instance order.

    Raises:
        InvalidArgumentError: The frame has no instances.
    """
    if frame.instances is None:
        raise InvalidArgumentError("argument `frame` has no instances, expected a frame rendered with them")
    image = frame.instances
    areas = np.bincount(image.ravel(), minlength=len(objects) + 1)[1:]
    there = np.flatnonzero(areas)
    limit_px = max(MIN_AREA_PX, round(MIN_AREA_SHARE * image.size))
    wanted = [i for i in there.tolist() if objects[i].kind == "object" and areas[i] >= limit_px]
    ignored = [
        i
        for i in there.tolist()
        if objects[i].kind in IGNORED_KINDS or (objects[i].kind == "object" and areas[i] < limit_px)
    ]
    bodies = np.array([*wanted, *ignored], np.int64)
    table = np.full(len(objects) + 1, -1, np.int32)
    table[bodies + 1] = np.arange(len(bodies), dtype=np.int32)
    masks = table[image]
    return TrueObjects(
        bodies=bodies,
        num_wanted=len(wanted),
        labels=tuple(objects[i].category for i in bodies.tolist()),
        areas_px=areas[bodies],
        distances_m=median_depths_m(frame.depth_m, masks, len(bodies)),
        outline_shares=own_outlines(masks, frame.depth_m, len(bodies)),
        masks=masks,
    )


def median_depths_m(depth_m: NDArray[np.float32], masks: NDArray[np.int32], num_masks: int) -> NDArray[np.float64]:
    """Return the median of the finite depths in each mask, `(num_masks,)`; `inf` where there is none."""
    inside = (masks >= 0) & np.isfinite(depth_m)
    ids, depths = masks[inside], depth_m[inside]
    order = np.lexsort((depths, ids))
    depths = depths[order]
    counts = np.bincount(ids, minlength=num_masks)
    ends = np.cumsum(counts)
    medians = np.full(num_masks, np.inf)
    full = counts > 0
    medians[full] = depths[(ends - counts + (counts - 1) // 2)[full]]
    return medians


def own_outlines(masks: NDArray[np.int32], depth_m: NDArray[np.float32], num_masks: int) -> NDArray[np.float64]:
    """Return the part of each mask's outline that is cut by nothing nearer, nor by the image's border, `(num_masks,)`.

    A sign of occlusion that needs no second rendering. Nearer is what is so by more than 5 cm and 5%: an object's foot
    on the floor is its own. 1 of a mask without pixels.
    """
    outlines = _core.mask_outlines(masks, depth_m, num_masks=num_masks)
    return np.asarray(1.0 - outlines[:, 1] / np.maximum(outlines[:, 0], 1.0))


def overlaps_px(a: NDArray[np.int32], num_a: int, b: NDArray[np.int32], num_b: int) -> NDArray[np.int64]:
    """Return the pixels that masks of two label images (-1: none) have in common, `(num_a, num_b)`."""
    both = (a >= 0) & (b >= 0)
    pairs = a[both].astype(np.int64) * num_b + b[both]
    return np.bincount(pairs, minlength=num_a * num_b).reshape(num_a, num_b)


def intersections_over_union(truth: TrueObjects, found: Detections) -> NDArray[np.float64]:
    """Return the IoU of every object with every detection, `(T, D)`."""
    num = len(found.labels)
    common = overlaps_px(truth.masks, len(truth.labels), found.masks, num)
    areas = np.bincount(found.masks[found.masks >= 0], minlength=num)
    union = truth.areas_px[:, None] + areas[None, :] - common
    return np.asarray(common / np.maximum(union, 1), np.float64)


def match(
    ious: NDArray[np.float64],
    confidences: NDArray[np.float32],
    num_wanted: int,
    *,
    is_allowed: NDArray[np.bool_] | None = None,
) -> Matches:
    """Pair objects and detections whose IoU is at least `IOU_LIMIT`.

    A detection takes a wanted object before an ignored one, whatever their overlaps; an ignored one is never used up.

    Args:
        ious: `(T, D)`.
        confidences: `(D,)`; of equal ones, the detection that comes first chooses first.
        num_wanted: Objects that count; those behind are ignored.
        is_allowed: `(T, D)` whether a pair may be one, such as by labels; default: all.
    """
    num_true, num_found = ious.shape
    usable = np.where(ious >= IOU_LIMIT, ious, 0.0)
    if is_allowed is not None:
        usable = np.where(is_allowed, usable, 0.0)
    detection_of = np.full(num_true, NONE, np.int64)
    object_of = np.full(num_found, NONE, np.int64)
    pair_ious = np.zeros(num_found)
    for d in np.argsort(-confidences, kind="stable").tolist():
        free = np.where(detection_of[:num_wanted] == NONE, usable[:num_wanted, d], 0.0)
        if free.size and free.max() > 0.0:
            t = int(free.argmax())
            detection_of[t], object_of[d], pair_ious[d] = d, t, free[t]
        elif num_true > num_wanted and usable[num_wanted:, d].max() > 0.0:
            object_of[d], pair_ious[d] = IGNORED, usable[num_wanted:, d].max()
    return Matches(detection_of, object_of, pair_ious)


def same_labels(truth: TrueObjects, found: Detections) -> NDArray[np.bool_]:
    """Return whether a detection has an object's label, `(T, D)`."""
    rows = np.array(truth.labels, dtype=object).reshape(-1, 1)
    columns = np.array(found.labels, dtype=object).reshape(1, -1)
    return np.asarray(rows == columns, np.bool_).reshape(len(truth.labels), len(found.labels))


def main_objects(truth: TrueObjects, found: Detections) -> NDArray[np.int64]:
    """Return the object of most pixels of each detection, `(D,)`, as index in the simulator's table, or `NONE`."""
    num = len(found.labels)
    if not truth.labels or not num:
        return np.full(num, NONE, np.int64)
    common = overlaps_px(truth.masks, len(truth.labels), found.masks, num)
    areas = np.bincount(found.masks[found.masks >= 0], minlength=num)
    best = common.argmax(axis=0)
    return np.where(2 * common.max(axis=0) > areas, truth.bodies[best], NONE)
