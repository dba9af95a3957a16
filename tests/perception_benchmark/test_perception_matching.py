"""Which detection is which object: cases worked out by hand, and average precision against a plain second version."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evonav.errors import InvalidArgumentError
from evonav.perception import Percept
from evonav.perception_benchmark.average_precision import interpolated, resampled
from evonav.perception_benchmark.matching import (
    IGNORED,
    NONE,
    intersections_over_union,
    main_objects,
    match,
    median_depths_m,
    overlaps_px,
    same_labels,
    true_objects,
)
from evonav.perception_benchmark.rows import check_percept, scored_percept
from evonav.sensors.observation import Detections
from evonav.world.pose import Pose
from evonav.world.simulator import Frame, Intrinsics, SceneObject

OBJECTS = [
    SceneObject(name, category, kind, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    for name, category, kind in (
        ("wall", "Wall", "wall"),
        ("sofa", "Sofa", "object"),
        ("mug", "Mug", "object"),
        ("bed", "Bed", "object"),
        ("window", "Window", "window"),
    )
]


def frame(instances, depth_m=None):
    depth = np.ones(instances.shape, np.float32) if depth_m is None else depth_m
    return Frame(Pose(0, 0, 0, 0), Intrinsics(40, 40, math.pi / 2), depth, instances=instances)


def scene():
    """A sofa of 200 pixels at the left edge, a bed of 100, a mug of 9, a window of 64; all else wall."""
    instances = np.ones((40, 40), np.int32)
    instances[10:20, 0:20] = 2
    instances[30:33, 30:33] = 3
    instances[25:35, 5:15] = 4
    instances[0:8, 30:38] = 5
    return instances


def detections(*parts):
    """Label, confidence, rows and columns of each."""
    masks = np.full((40, 40), -1, np.int32)
    for i, (_, _, rows, cols) in enumerate(parts):
        masks[rows, cols] = i
    return Detections(masks, tuple(p[0] for p in parts), np.array([p[1] for p in parts], np.float32))


def test_small_objects_and_windows_are_ignored_and_walls_are_nothing():
    depth = np.full((40, 40), 2.0, np.float32)
    depth[10:20, 0:20] = 3.0
    depth[12:18, 2:18] = np.inf
    depth[25:35, 0:5], depth[35:, :] = 1.0, 1.94
    truth = true_objects(frame(scene(), depth), OBJECTS)
    assert truth.labels == ("Sofa", "Bed", "Mug", "Window")
    assert truth.num_wanted == 2
    assert truth.areas_px.tolist() == [200, 100, 9, 64]
    assert truth.distances_m.tolist() == [3.0, 2.0, 2.0, 2.0]
    # All around the sofa is nearer, or is the image's border; so is what is left of the bed, but not the floor below.
    assert truth.outline_shares.tolist() == pytest.approx([0, 30 / 40, 1, 24 / 32])
    with pytest.raises(InvalidArgumentError, match="instances"):
        true_objects(Frame(Pose(0, 0, 0, 0), Intrinsics(4, 4, 1.0), np.ones((4, 4), np.float32)), OBJECTS)


def test_pairs_worked_out_by_hand():
    truth = true_objects(frame(scene()), OBJECTS)
    found = detections(
        ("Sofa", 0.9, slice(10, 20), slice(0, 16)),  # 160 of 200: IoU 0.8
        ("Sofa", 0.95, slice(25, 35), slice(5, 17)),  # the bed, by a wrong label: 100 of 120
        ("Window", 0.8, slice(0, 8), slice(30, 38)),  # ignored
        ("Sofa", 0.7, slice(0, 8), slice(0, 8)),  # nothing there
        ("Mug", 0.6, slice(30, 33), slice(30, 34)),  # too small to be wanted: ignored
    )
    ious = intersections_over_union(truth, found)
    assert ious[0, 0] == pytest.approx(0.8)
    assert ious[1, 1] == pytest.approx(100 / 120)
    by_label = match(ious, found.confidences, truth.num_wanted, is_allowed=same_labels(truth, found))
    assert by_label.detection_of.tolist() == [0, NONE, NONE, NONE]
    assert by_label.object_of.tolist() == [0, NONE, IGNORED, NONE, IGNORED]
    assert by_label.ious.tolist() == pytest.approx([0.8, 0, 1.0, 0, 0.75])
    by_place = match(ious, found.confidences, truth.num_wanted)
    assert by_place.object_of.tolist() == [0, 1, IGNORED, NONE, IGNORED]
    assert main_objects(truth, found).tolist() == [1, 3, 4, NONE, 2]


def test_the_surer_of_two_halves_gets_the_object():
    truth = true_objects(frame(scene()), OBJECTS)
    halves = [("Sofa", 0.4, slice(10, 20), slice(0, 10)), ("Sofa", 0.6, slice(10, 20), slice(10, 20))]
    for found, expected in ((detections(*halves), [NONE, 0]), (detections(*halves[::-1]), [0, NONE])):
        ious = intersections_over_union(truth, found)
        assert match(ious, found.confidences, truth.num_wanted).object_of.tolist() == expected


def test_views_without_objects_or_detections():
    nothing = true_objects(frame(np.ones((40, 40), np.int32)), OBJECTS)
    found = detections(("Sofa", 0.9, slice(0, 5), slice(0, 5)))
    for truth, told in (
        (nothing, found),
        (true_objects(frame(scene()), OBJECTS), detections()),
        (nothing, detections()),
    ):
        pairs = match(
            intersections_over_union(truth, told),
            told.confidences,
            truth.num_wanted,
            is_allowed=same_labels(truth, told),
        )
        assert (pairs.object_of == NONE).all()
        assert (pairs.detection_of == NONE).all()
        assert (main_objects(truth, told) == NONE).all()


def test_reported_doors_and_windows_are_not_scored():
    there = frame(scene())
    found = detections(
        ("Doorway", 0.9, slice(0, 8), slice(0, 8)),  # nothing there, and yet no error
        ("Sofa", 0.8, slice(10, 20), slice(0, 16)),
        ("Window", 0.7, slice(0, 3), slice(30, 33)),  # too little of the window for a pair
    )
    scored = scored_percept(there, Percept(found, there.depth_m, there.pose)).detections
    assert scored.labels == ("Sofa",)
    assert ((scored.masks == 0) == (found.masks == 1)).all()
    with pytest.raises(InvalidArgumentError, match="`masks`"):
        scored_percept(there, Percept(replace(found, masks=found.masks + 1), there.depth_m, there.pose))


def test_what_a_perception_may_not_tell_is_named():
    there, good = frame(scene()), detections(("Sofa", 0.9, slice(0, 5), slice(0, 5)))
    percept = Percept(good, there.depth_m, there.pose)
    check_percept(there, percept)
    cases = {
        "masks": (good.masks[:9], good.masks + 1, good.masks - 1, good.masks.astype(np.float32)),
        "confidences": (np.array([1.1], np.float32), np.array([np.nan], np.float32), np.zeros(2, np.float32)),
        "features": (np.zeros((2, 4), np.float32), np.zeros(4, np.float32)),
    }
    for name, values in cases.items():
        for value in values:
            with pytest.raises(InvalidArgumentError, match=f"`{name}`"):
                check_percept(there, replace(percept, detections=replace(good, **{name: value})))
    with pytest.raises(InvalidArgumentError, match="`depth_m`"):
        check_percept(there, replace(percept, depth_m=there.depth_m[:5]))


@given(st.integers(0, 2**32 - 1))
def test_overlaps_and_depths_are_what_counting_gives(seed):
    random = np.random.default_rng(seed)
    a, b = (random.integers(-1, n, (7, 9)).astype(np.int32) for n in (3, 4))
    counted = [[int(((a == i) & (b == j)).sum()) for j in range(4)] for i in range(3)]
    assert overlaps_px(a, 3, b, 4).tolist() == counted
    depth = random.choice([0.5, 1.0, 2.0, 4.0, np.inf], (7, 9)).astype(np.float32)
    medians = median_depths_m(depth, a, 3)
    for i in range(3):
        inside = np.sort(depth[(a == i) & np.isfinite(depth)])
        assert medians[i] == (inside[(len(inside) - 1) // 2] if len(inside) else np.inf)


def average_precision_naive(confidences, is_right, counts, num_true):
    """COCO's definition, in words: at each recall the best precision of any cut that reaches it.

    Every detection is there as many times as `counts` says, all at once.
    """
    cuts, right, seen = [], 0, 0
    for i in sorted(range(len(confidences)), key=lambda i: -confidences[i]):
        right, seen = right + counts[i] * is_right[i], seen + counts[i]
        cuts.append((right / num_true, right / seen if seen else 0.0))
    return sum(max([p for r, p in cuts if r >= step - 1e-9], default=0.0) for step in np.linspace(0, 1, 101)) / 101


CASES = st.integers(1, 30).flatmap(
    lambda n: st.tuples(
        st.lists(st.tuples(st.sampled_from([0.1, 0.5, 0.9, 1.0]), st.booleans(), st.integers(0, 3)), max_size=n),
        st.integers(n, 2 * n),
    )
)


@given(CASES)
def test_average_precision_is_cocos(case):
    rows, num_true = case
    confidences = np.array([row[0] for row in rows], np.float64)
    is_right = np.array([row[1] for row in rows], np.bool_)
    expected = average_precision_naive(confidences, is_right, [1] * len(rows), num_true)
    assert interpolated(confidences, is_right, num_true).mean() == pytest.approx(expected, abs=1e-12)


@given(CASES, st.integers(0, 1000))
def test_a_resample_is_the_average_precision_of_copies(case, seed):
    rows, num_true = case
    random = np.random.default_rng(seed)
    units = np.array([row[2] for row in rows], np.int64)
    confidences = np.array([row[0] for row in rows], np.float64)
    is_right = np.array([row[1] for row in rows], np.bool_)
    wanted = np.bincount(units, minlength=4) + random.integers(0, num_true, 4)
    draws = random.integers(0, 4, (5, 4)).astype(np.float64)
    got = resampled(confidences, is_right, units, wanted.astype(np.float64), draws)
    for row, value in zip(draws.astype(int), got, strict=True):
        total = int(row @ wanted)
        if total == 0:
            assert np.isnan(value)
            continue
        expected = average_precision_naive(confidences, is_right, row[units], total)
        assert value == pytest.approx(expected, abs=1e-9)
