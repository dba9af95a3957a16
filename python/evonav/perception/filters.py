"""Filter detections as 3D-Mem and UniGoal do: pure functions on masks, boxes and confidences.

Lengths and areas in pixels are meant for images of the size that the original looks at and are scaled with the image:
3D-Mem renders 1280x1280, our protocol 300x300.
"""

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from evonav.perception.detector import Found
from evonav.records import Options, Share

_Edge = Annotated[int, Field(gt=0)]


class FilterConfig(Options):
    """3D-Mem's values."""

    of = "FilterConfig"
    reference_px: tuple[_Edge, _Edge] = (1280, 1280)
    """Height and width of the images for which the values in pixels are meant."""
    background: tuple[str, ...] = ("wall", "floor", "ceiling", "carpet", "rug", "bath mat")
    """Labels that are no objects. 3D-Mem's list has `door` as well, which its agent drops (`NavigatorConfig`)."""
    min_area_fraction: Share = 0.001
    """Smallest part of the image that a mask covers."""
    min_confidence: Share = 0.4
    max_mask_iou: Share = 0.9
    """Above it, of two masks the one with less confidence goes."""
    min_centre_distance_px: Annotated[float, Field(ge=0.0)] = 20.0
    """Limit for two boxes: of two with centres nearer than this, the smaller is dropped."""
    min_area_px: Annotated[float, Field(ge=0.0)] = 25.0
    max_box_fraction: Share = 0.5
    """Largest part of the image that a box covers."""
    max_share_of_outer: Share = 0.7
    min_share_of_inner: Share = 0.8
    """Smallest share of the inner box that lies in the outer one.

    A box that covers less than `max_share_of_outer` of another is a thing on it: the other mask loses it.
    """

    def scale_of(self, shape: tuple[int, int]) -> float:
        """Return the length of a pixel of the original in an image of `(H, W)`."""
        return math.sqrt(shape[0] * shape[1] / (self.reference_px[0] * self.reference_px[1]))


def filtered(found: Found, config: FilterConfig) -> Found:
    """Return the remaining detections of an image, the most confident first; masks may still overlap.

    Args:
        found: Detections in one image.
    """
    remaining = without_small_and_doubtful(found, config)
    remaining = without_doubles(remaining, config)
    remaining = without_specks_and_giants(remaining, config)
    return without_contained(remaining, config)


def without_small_and_doubtful(found: Found, config: FilterConfig) -> Found:
    """Drop background, masks that are too small a part of the image and detections of little confidence.

    Background goes first: a wall's box is no reason to drop the picture on it.
    """
    order = np.argsort(-found.confidences, kind="stable")
    areas_px = mask_areas_px(found.masks)
    min_area_px = config.min_area_fraction * found.masks.shape[1] * found.masks.shape[2]
    return found.taken(
        [
            index
            for index in order.tolist()
            if found.labels[index] not in config.background
            and areas_px[index] >= min_area_px
            and areas_px[index] > 0
            and found.confidences[index] >= config.min_confidence
        ]
    )


def without_doubles(found: Found, config: FilterConfig) -> Found:
    """Drop what is found twice: nearly the same mask, or boxes around one middle.

    Args:
        found: The most confident first.
    """
    ious = mask_ious(found.masks)
    areas_px = box_areas_px(found.boxes_px)
    centres_px = (found.boxes_px[:, :2] + found.boxes_px[:, 2:]) / 2.0
    near_px = config.min_centre_distance_px * config.scale_of(found.masks.shape[1:])
    remaining: list[int] = []
    for index in range(len(found)):
        if any(ious[index, other] > config.max_mask_iou for other in remaining):
            continue
        apart_px = np.hypot(*(centres_px[remaining] - centres_px[index]).T)
        rivals = [other for other, px in zip(remaining, apart_px.tolist(), strict=True) if px < near_px]
        if all(areas_px[index] > areas_px[other] for other in rivals):
            remaining = [other for other in remaining if other not in rivals] + [index]
    return found.taken(sorted(remaining))


def without_specks_and_giants(found: Found, config: FilterConfig) -> Found:
    """Drop masks of a few pixels and boxes over much of the image."""
    height_px, width_px = found.masks.shape[1:]
    min_area_px = config.min_area_px * config.scale_of((height_px, width_px)) ** 2
    max_box_px = config.max_box_fraction * height_px * width_px
    is_plausible = (mask_areas_px(found.masks) >= min_area_px) & (box_areas_px(found.boxes_px) <= max_box_px)
    return found.taken(np.flatnonzero(is_plausible))


def without_contained(found: Found, config: FilterConfig) -> Found:
    """Take the pillow's mask off the sofa's; drop a mask of which nothing is left."""
    boxes = found.boxes_px.astype(np.float64)
    low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
    shared_px = np.clip(high - low, 0.0, None).prod(axis=2)
    areas_px = np.maximum(box_areas_px(found.boxes_px), 1e-9)
    is_on = (shared_px / areas_px[:, None] < config.max_share_of_outer) & (
        shared_px / areas_px[None, :] > config.min_share_of_inner
    )
    if not is_on.any():
        return found
    masks = found.masks.copy()
    for outer, inner in np.argwhere(is_on):
        masks[outer] &= ~found.masks[inner]
    left = Found(masks, found.boxes_px, found.labels, found.confidences, found.features)
    return left.taken(np.flatnonzero(mask_areas_px(masks) > 0))


def joined(first: Found, second: Found, max_iou: float) -> Found:
    """Join the detections of two detectors in one image; of a thing that both found, take the first's.

    Args:
        first: Detections of one detector.
        second: Detections of the other; features are included if both have some.
        max_iou: Masks that overlap by more are the same thing.
    """
    ious = mask_ious(np.concatenate([first.masks, second.masks]))[len(first) :, : len(first)]
    new = second.taken(np.flatnonzero(~(ious > max_iou).any(axis=1)))
    features = None
    if first.features is not None and new.features is not None:
        features = np.concatenate([first.features, new.features])
    return Found(
        masks=np.concatenate([first.masks, new.masks]),
        boxes_px=np.concatenate([first.boxes_px, new.boxes_px]),
        labels=first.labels + new.labels,
        confidences=np.concatenate([first.confidences, new.confidences]),
        features=features,
    )


def one_label_a_pixel(masks: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return the mask that each pixel belongs to: of several, the one with the fewest pixels.

    What lies on or before something is smaller than that in most images, and a mask of the larger thing often covers
    it; the other way round the small thing would vanish from every map. Among masks of equal size the first one wins.

    Args:
        masks: `(N, H, W)`.

    Returns:
        `(H, W)` index, -1 where no mask is.
    """
    image = np.full(masks.shape[1:], -1, np.int32)
    for index in np.argsort(-mask_areas_px(masks)[::-1], kind="stable"):
        mask = len(masks) - 1 - int(index)
        image[masks[mask]] = mask
    return image


def mask_areas_px(masks: NDArray[np.bool_]) -> NDArray[np.int64]:
    """`(N,)` pixels of `(N, H, W)` masks."""
    return np.array([np.count_nonzero(mask) for mask in masks], np.int64)


def mask_ious(masks: NDArray[np.bool_]) -> NDArray[np.float64]:
    """`(N, N)` intersection over union of `(N, H, W)` masks; 0 for two empty ones.

    Pixels are compared where the extents of two masks meet, which for most pairs is nowhere.
    """
    areas_px = mask_areas_px(masks)
    ious = np.diag((areas_px > 0).astype(np.float64))
    extents = [_extent(mask) for mask in masks]
    for i, (top, left, bottom, right) in enumerate(extents):
        for j in range(i):
            other = extents[j]
            rows = slice(max(top, other[0]), min(bottom, other[2]))
            cols = slice(max(left, other[1]), min(right, other[3]))
            if rows.start >= rows.stop or cols.start >= cols.stop:
                continue
            shared_px = np.count_nonzero(masks[i, rows, cols] & masks[j, rows, cols])
            ious[i, j] = ious[j, i] = shared_px / (areas_px[i] + areas_px[j] - shared_px)
    return ious


def _extent(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """Return the first row and column of a mask, and the ones after its last."""
    rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return (int(rows[0]), int(cols[0]), int(rows[-1]) + 1, int(cols[-1]) + 1) if len(rows) else (0, 0, 0, 0)


def box_areas_px(boxes_px: NDArray[np.float32]) -> NDArray[np.float64]:
    """`(N,)` areas of `(N, 4)` boxes, left, top, right, bottom."""
    sides_px = np.clip(boxes_px[:, 2:].astype(np.float64) - boxes_px[:, :2], 0.0, None)
    areas: NDArray[np.float64] = sides_px[:, 0] * sides_px[:, 1]
    return areas
