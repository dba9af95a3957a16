"""Make masks of boxes and depths, for detectors that draw boxes alone.

The camera is AI2-THOR's: 90 degrees of vertical field of view, at the height of `SimulatorConfig`.
"""

import math

import numpy as np
from numpy.typing import NDArray

from evonav.perception.detector import DetectorView
from evonav.world.simulator import SimulatorConfig

CENTRE = 0.5
"""Part of the box's width and height, in its middle, whose median depth is taken for the object's."""
REACH = 0.75
"""Depth of the object before and behind that, as a multiple of the box's longer side in metres."""
FLOOR_M = 0.05
"""Height up to which a surface is floor."""


def masks_of_boxes(view: DetectorView, boxes_px: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return the foreground in each box: what is about as far away as the box's middle, and is no floor.

    Args:
        view: View that the boxes are of; its colours are not used.
        boxes_px: `(N, 4)` left, top, right, bottom.

    Returns:
        `(N, H, W)` masks; one is empty where nothing in the box has a depth.
    """
    height_px, width_px = view.depth_m.shape
    focal_px = height_px / 2.0
    above_floor = np.isfinite(view.depth_m) & (_heights_m(view, focal_px) > FLOOR_M)
    masks = np.zeros((len(boxes_px), height_px, width_px), np.bool_)
    for mask, (left, top, right, bottom) in zip(masks, boxes_px.tolist(), strict=True):
        first_col, end_col = _pixels(left, right, width_px)
        first_row, end_row = _pixels(top, bottom, height_px)
        box = np.s_[first_row:end_row, first_col:end_col]
        depth_m = view.depth_m[box]
        middle_m = _middle_m(depth_m)
        if not math.isfinite(middle_m):
            continue
        reach_m = REACH * max(right - left, bottom - top) / focal_px * middle_m
        mask[box] = above_floor[box] & (np.abs(depth_m - middle_m) < reach_m)
    return masks


def _heights_m(view: DetectorView, focal_px: float) -> NDArray[np.float64]:
    """Return each pixel's height above the floor."""
    rows = np.arange(view.depth_m.shape[0])[:, None] + 0.5
    up = (view.depth_m.shape[0] / 2.0 - rows) / focal_px
    rise = up * math.cos(view.horizon_rad) - math.sin(view.horizon_rad)
    # What has no depth is no floor, and infinity times zero is no number.
    depth_m = np.where(np.isfinite(view.depth_m), view.depth_m, 0.0)
    heights_m: NDArray[np.float64] = SimulatorConfig().camera_height_m + depth_m * rise
    return heights_m


def _middle_m(depth_m: NDArray[np.float32]) -> float:
    """Return the median depth in the middle of a box; of the whole box, if the middle has none; else infinity."""
    rows, cols = (int(side * (1.0 - CENTRE) / 2.0) for side in depth_m.shape)
    for part in (depth_m[rows : depth_m.shape[0] - rows, cols : depth_m.shape[1] - cols], depth_m):
        values_m = part[np.isfinite(part)]
        if values_m.size:
            return float(np.median(values_m))
    return math.inf


def _pixels(low: float, high: float, size_px: int) -> tuple[int, int]:
    """Return the first pixel and the end of an interval: at least one pixel, inside the image."""
    first = min(max(round(low), 0), size_px - 1)
    return first, min(max(round(high), first + 1), size_px)
