"""Boxes and thinned points of a view's detections, against what is read off masks and depth one by one."""

import numpy as np
import pytest

from evonav.memory.clouds import clouds_of
from evonav.memory.views import boxes_of
from evonav.sensors.observation import Detections, View, VisibleOccupancy
from evonav.world.camera import unproject
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics

NO_CELLS = VisibleOccupancy(np.zeros((0, 2), np.int32), np.zeros((0, 2), np.int32))


def random_view(rng, num):
    rows, cols = int(rng.integers(10, 40)), int(rng.integers(1, 40))
    masks = np.full((rows, cols), -1, np.int32)
    for index in range(num):
        masks[rng.random(masks.shape) < 0.05] = index
    depth_m = rng.uniform(0.5, 6.0, masks.shape).astype(np.float32)
    depth_m[rng.random(masks.shape) < 0.1] = np.inf
    return View(
        pose=Pose(1.0, 1.575, -2.0, 0.7, 0.3),
        intrinsics=Intrinsics(cols, rows, np.pi / 2),
        depth_m=depth_m,
        detections=Detections(masks, tuple(f"Thing{i}" for i in range(num)), np.ones(num, np.float32)),
        occupancy=NO_CELLS,
    )


@pytest.mark.parametrize("seed", range(30))
def test_boxes_and_points_are_those_of_each_mask(seed):
    rng = np.random.default_rng(seed)
    view = random_view(rng, int(rng.integers(0, 7)))
    clouds, boxes = clouds_of(view), boxes_of(view.detections)
    points_m = unproject(view.depth_m, view.pose, view.intrinsics)
    for index in range(len(view.detections.labels)):
        rows, cols = np.nonzero(view.detections.masks == index)
        box_px = (cols.min(), rows.min(), cols.max() + 1, rows.max() + 1) if len(rows) else (0, 0, 0, 0)
        assert boxes[index] == (len(rows), box_px)
        expected = points_m[(view.detections.masks == index) & np.isfinite(view.depth_m)]
        assert np.allclose(clouds.points_m(index), expected, atol=6e-4)
        box_m = clouds.boxes_m[index]
        assert (box_m is None) == (len(expected) == 0)
        if box_m is not None:
            assert np.allclose(box_m[0], (expected.min(axis=0) + expected.max(axis=0)) / 2, atol=1e-5)
            assert np.allclose(box_m[1], np.ptp(expected, axis=0), atol=1e-5)


def test_a_large_mask_is_thinned_evenly():
    view = random_view(np.random.default_rng(1), 0)
    masks = np.zeros(view.depth_m.shape, np.int32)
    view = View(
        view.pose, view.intrinsics, view.depth_m, Detections(masks, ("Wall",), np.ones(1, np.float32)), NO_CELLS
    )
    num = int(np.isfinite(view.depth_m).sum())
    assert num > 200
    assert len(clouds_of(view, max_points=100).points_m(0)) == -(-num // -(-num // 100))
