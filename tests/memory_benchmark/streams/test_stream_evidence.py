"""The truth of a frame against slow twins and hand-made cases."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import evonav
from evonav.memory_benchmark.streams import make_stream
from evonav.memory_benchmark.streams.evidence import (
    TOUCH_M,
    changes_between,
    detected_ids,
    empty_px,
    is_taken,
    num_looks_through,
    visible_px,
)
from evonav.memory_benchmark.streams.spec import StreamSpec
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.sensors.observation import Detections
from evonav.world.camera import camera_axes, project, unproject
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import Frame, Intrinsics, SceneObject

CAMERA = Intrinsics(12, 9, 1.2)
AHEAD = Pose(0.0, 1.0, 0.0, 0.0, 0.0)


def box(centre_m, size_m, body_id="Vase|1", category="Vase"):
    return SceneObject(body_id, category, "object", centre_m, size_m)


def looks_through_naive(depth_m, pose, intrinsics, place, grow_m):
    """Walk along each pixel's ray in steps of planar depth, and compare its last point in the box with the surface.

    The ray through a pixel comes from unprojecting two depths, not from the camera's axes.
    """
    near = unproject(np.full_like(depth_m, 1.0), pose, intrinsics)
    far = unproject(np.full_like(depth_m, 2.0), pose, intrinsics)
    depths_m = np.arange(0.005, 8.0, 0.005)
    half_m = np.array(place.size_m) / 2.0 + grow_m
    number = 0
    for row in range(depth_m.shape[0]):
        for col in range(depth_m.shape[1]):
            points = near[row, col] + (depths_m[:, None] - 1.0) * (far[row, col] - near[row, col])
            is_inside = (np.abs(points - np.array(place.centre_m)) <= half_m).all(axis=1)
            if is_inside.any():
                number += bool(depth_m[row, col] >= depths_m[is_inside].max() - TOUCH_M - 2.0 * grow_m)
    return number


@given(
    yaw_rad=st.floats(0.0, 6.2),
    horizon_rad=st.floats(-1.2, 1.2),
    centre_m=st.tuples(*[st.floats(-2.5, 2.5)] * 3),
    size_m=st.tuples(*[st.floats(0.1, 2.0)] * 3),
    wall_m=st.floats(0.3, 6.0),
)
def test_pixels_through_a_box_lie_between_those_of_a_smaller_and_a_larger_one(
    yaw_rad, horizon_rad, centre_m, size_m, wall_m
):
    pose = Pose(0.1, 0.2, -0.3, yaw_rad, horizon_rad)
    depth_m = np.full((CAMERA.height_px, CAMERA.width_px), wall_m, np.float32)
    depth_m[:, ::3] = np.inf
    place = box(centre_m, size_m)
    number = num_looks_through(depth_m, pose, CAMERA, place)
    hair_m = 0.012
    fewest = looks_through_naive(depth_m, pose, CAMERA, place, -hair_m)
    most = looks_through_naive(depth_m, pose, CAMERA, place, hair_m)
    assert fewest <= number <= most


def test_the_cameras_axes_are_those_of_the_projection():
    for yaw_rad, horizon_rad in ((0.3, 0.5), (2.0, -0.7), (4.0, 0.0)):
        pose = Pose(1.0, 1.5, -2.0, yaw_rad, horizon_rad)
        axes = camera_axes(pose)
        point = np.array(pose.position_m) + 2.0 * axes[2] + 0.4 * axes[0] + 0.2 * axes[1]
        ((col, row, depth_m),) = project(point[None, :], pose, CAMERA).tolist()
        assert depth_m == pytest.approx(2.0)
        assert col == pytest.approx(CAMERA.width_px / 2 + 0.2 * CAMERA.focal_px)
        assert row == pytest.approx(CAMERA.height_px / 2 - 0.1 * CAMERA.focal_px)


def test_a_surface_before_in_or_behind_a_place():
    place = box((0.0, 1.0, 2.0), (0.5, 0.5, 0.5))
    shape = (CAMERA.height_px, CAMERA.width_px)
    numbers = [
        num_looks_through(np.full(shape, depth_m, np.float32), AHEAD, CAMERA, place)
        for depth_m in (1.0, 2.0, 2.24, 3.0, np.inf)
    ]
    assert numbers[0] == numbers[1] == 0
    assert numbers[2] == numbers[3] == numbers[4] > 0, "what it stood against is behind it"
    assert num_looks_through(np.full(shape, 5.0, np.float32), Pose(0, 1, 0, math.pi, 0), CAMERA, place) == 0


def test_what_is_out_of_range_or_out_of_view_is_no_evidence():
    depth_m = np.full((CAMERA.height_px, CAMERA.width_px), 9.0, np.float32)
    frame = Frame(AHEAD, CAMERA, depth_m, None, np.ones((CAMERA.height_px, CAMERA.width_px), np.int32))
    near, far = box((0.0, 1.0, 3.0), (1.0, 1.0, 1.0)), box((0.0, 1.0, 4.0), (1.0, 1.0, 1.0))
    assert list(empty_px(frame, [(3, near), (7, far)])) == [3]
    assert list(empty_px(frame, [(3, near), (7, far)], range_m=5.0)) == [3, 7]
    assert visible_px(frame, [near]) == {near.id: CAMERA.width_px * CAMERA.height_px}
    assert visible_px(frame, [far]) == {}
    assert visible_px(frame, [SceneObject("door", "Doorway", "door", near.centre_m, near.size_m)]) == {}


def test_visible_pixels_are_those_of_the_instance_image():
    stream = make_stream(StreamSpec("S0", "bundled:4", frames_a_visit=5))
    simulator = EmbeddedSimulator(stream.spec.camera)
    simulator.reset(evonav.load_houses("bundled")[3])
    for index, (_, truth) in enumerate(stream.frames()):
        frame = simulator.render(stream.plan.frames[index].pose, rgb=False)
        expected = {}
        for number, body in enumerate(simulator.objects, start=1):
            count = int((frame.instances == number).sum())
            gap_m = math.hypot(body.centre_m[0] - frame.pose.x_m, body.centre_m[2] - frame.pose.z_m)
            if count and gap_m <= 3.5 and body.kind == "object":
                expected[body.id] = count
        assert truth.visible_px == expected


def test_changes_are_what_moved_vanished_and_appeared():
    stays, moves, goes = (box((float(i), 0.0, 0.0), (0.2, 0.2, 0.2), f"Vase|{i}") for i in range(3))
    moved = box((1.0, 0.0, 3.0), (0.2, 0.2, 0.2), "Vase|1")
    opened = box((0.3, 0.0, 0.0), (0.8, 0.2, 0.2), "Vase|0")
    comes = box((5.0, 0.0, 0.0), (0.2, 0.2, 0.2), "new|1", "Cup")
    before, after = [stays, moves, goes], [opened, moved, comes]
    positions_m = [
        {"Vase|0": stays.centre_m, "Vase|1": moves.centre_m, "Vase|2": goes.centre_m},
        {"Vase|0": (0.05, 0.0, 0.0), "Vase|1": moved.centre_m, "new|1": comes.centre_m},
    ]
    found = changes_between(before, after, positions_m, frame=9)
    assert [(one.kind, one.object_id, one.label) for one in found] == [
        ("moved", "Vase|1", "Vase"),
        ("removed", "Vase|2", "Vase"),
        ("added", "new|1", "Cup"),
    ]
    assert [(one.before, one.after) for one in found] == [(moves, moved), (goes, None), (None, comes)]
    assert {one.frame for one in found} == {9}


def test_a_place_is_taken_by_what_did_not_stand_there_before():
    shelf = box((0.0, 0.5, 0.0), (1.0, 1.0, 1.0), "Shelf|1", "Shelf")
    book = box((0.0, 0.5, 0.0), (0.2, 0.2, 0.2), "Book|1", "Book")
    away = box((3.0, 0.5, 0.0), (0.2, 0.2, 0.2), "Book|1", "Book")
    near = box((0.1, 0.5, 0.0), (0.2, 0.2, 0.2), "Book|1", "Book")
    bowl = box((0.0, 0.5, 0.1), (0.2, 0.2, 0.2), "Bowl|1", "Bowl")
    beside = box((0.21, 0.5, 0.0), (0.2, 0.2, 0.2), "Bowl|1", "Bowl")
    assert not is_taken(book, [shelf, book], [shelf, away]), "the shelf was around it before"
    assert is_taken(book, [shelf, book], [shelf, near]), "it moved by less than its width"
    assert is_taken(book, [shelf, book], [shelf, away, bowl])
    assert not is_taken(book, [shelf, book], [shelf, away, beside])
    assert not is_taken(book, [shelf, book, bowl], [shelf, away, bowl])


def test_a_taken_place_is_never_seen_empty_again():
    stream = make_stream(StreamSpec("S3", "bundled:4", frames_a_visit=40))
    truths = [truth for _, truth in stream.frames()]
    scenes = {id(truth.objects): truth.objects for truth in truths}
    assert len(scenes) == 4
    for number, change in enumerate(stream.changes):
        before = truths[change.frame - 1].objects
        is_over = False
        for truth in truths[change.frame :]:
            is_over |= is_taken(change.before, before, truth.objects)
            assert not (is_over and number in truth.empty_px)
    assert not any(index < stream.changes[number].frame for index, one in enumerate(truths) for number in one.empty_px)


def test_detections_belong_to_the_object_that_they_overlap_most():
    instances = np.zeros((4, 10), np.int32)
    instances[:, :4], instances[:, 4:7] = 1, 2
    masks = np.full((4, 10), -1, np.int32)
    masks[:, :3], masks[:, 3:6], masks[:1, 6:7], masks[:, 8:] = 0, 1, 2, 3
    bodies = [box((0, 0, 1), (1, 1, 1), "a"), box((0, 0, 1), (1, 1, 1), "b")]
    frame = Frame(AHEAD, CAMERA, np.ones((4, 10), np.float32), None, instances)
    found = Detections(masks, ("Vase",) * 4, np.ones(4, np.float32))
    assert detected_ids(found, frame, bodies) == ("a", "b", None, None)
    none = Detections(np.full((4, 10), -1, np.int32), (), np.empty(0, np.float32))
    assert detected_ids(none, frame, bodies) == ()


def test_ground_truths_detections_are_all_of_their_own_objects():
    stream = make_stream(StreamSpec("S0", "bundled:4", frames_a_visit=8))
    simulator = EmbeddedSimulator(stream.spec.camera)
    simulator.reset(evonav.load_houses("bundled")[3])
    for index, (_, truth) in enumerate(stream.frames()):
        frame = simulator.render(stream.plan.frames[index].pose, rgb=False)
        _, numbers = GroundTruthPerception().number(frame, simulator.objects)
        assert truth.detected_ids == tuple(simulator.objects[number].id for number in numbers)
