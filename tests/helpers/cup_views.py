"""Views of a cup before a wall, and of the wall without it, from one place."""

import math

import numpy as np

from evonav.sensors.observation import Detections, View, VisibleOccupancy
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics

SIZE_PX = 60
INTRINSICS = Intrinsics(SIZE_PX, SIZE_PX, math.pi / 2)
WALL_M = 5.0
NOTHING = np.empty((0, 2), np.int32)


def a_view(
    depth_m, masks=None, labels=(), *, pose=None, free=NOTHING, blocked=NOTHING, features=None, intrinsics=INTRINSICS
):
    """A view 1.575 m above the floor, looking along +z."""
    masks = np.full(depth_m.shape, -1, np.int32) if masks is None else masks
    found = Detections(masks, labels, np.ones(len(labels), np.float32), features)
    occupancy = VisibleOccupancy(np.asarray(free, np.int32), np.asarray(blocked, np.int32))
    return View(pose or Pose(0.0, 1.575, 0.0, 0.0, 0.0), intrinsics, depth_m.astype(np.float32), found, occupancy)


def a_cup(label="Cup", col=20):
    """A cup of 20 columns and rows, 2.0 to 2.3 m ahead, before a wall."""
    depth_m = np.full((SIZE_PX, SIZE_PX), WALL_M, np.float32)
    masks = np.full(depth_m.shape, -1, np.int32)
    depth_m[20:40, col : col + 20] = 2.0 + np.linspace(0, 0.3, 20, dtype=np.float32)
    masks[20:40, col : col + 20] = 0
    return a_view(depth_m, masks, (label,))


def a_look(depth_m, cols=slice(None)):
    """A view without detections: a surface at one depth in some columns, elsewhere the cup and the wall."""
    depth = a_cup().depth_m.copy()
    depth[:, cols] = depth_m
    return a_view(depth)


GONE, HIDDEN, UNDETECTED = a_look(WALL_M), a_look(0.8), a_look(0.8, slice(0, 0))
