import math

import numpy as np
import pytest

from evonav.agents.agent import EntryBelief
from evonav.evaluation.episode.staleness import (
    EVIDENCE_RANGE_M,
    StalenessTracker,
    TrackedState,
    matched_objects,
    shows_place,
)
from evonav.evaluation.records.schema import Relocation
from evonav.world.pose import Pose
from evonav.world.simulator import Frame, Intrinsics, SceneObject

PX = 40
INTRINSICS = Intrinsics(PX, PX, math.radians(90.0))


def belief(label, x_m, z_m, y_m=0.8, entry_id=1, edge_m=0.2):
    return EntryBelief(entry_id, label, (x_m, y_m, z_m), (edge_m, edge_m, edge_m), 2)


def body(object_id, category, x_m, z_m, y_m=0.8, edge_m=0.2, kind="object"):
    return SceneObject(object_id, category, kind, (x_m, y_m, z_m), (edge_m, edge_m, edge_m))


def frame(instance=0, num_px=PX * PX, depth_m=9.0, pose=None):
    """A view from the origin along +z whose first pixels are of one instance."""
    instances = np.zeros(PX * PX, dtype=np.int32)
    instances[:num_px] = instance
    return Frame(
        pose=pose or Pose(0.0, 0.8, 0.0, 0.0, 0.0),
        intrinsics=INTRINSICS,
        depth_m=np.full((PX, PX), depth_m, dtype=np.float32),
        instances=instances.reshape(PX, PX),
    )


MUGS = [body("floor", "Floor", 0.0, 0.0, kind="floor"), body("a", "Mug", 0.0, 2.0), body("b", "Mug", 0.3, 2.0)]


def witness(objects=MUGS, so_far=None, relocations=(), target="a"):
    return StalenessTracker(objects, target, relocations, TrackedState() if so_far is None else so_far, 25)


def test_an_entry_stands_for_the_nearest_object_of_its_label_within_the_margin():
    bodies = {"Mug": MUGS[1:]}
    held = matched_objects([belief("Mug", 0.05, 2.0), belief("Mug", 0.2, 2.0), belief("Mug", 0.0, 2.5)], bodies)
    assert [one and one.id for one in held] == ["a", "b", None]
    # 0.1 m of its box and 0.3 m of margin.
    assert matched_objects([belief("Mug", 0.0, 2.39)], {"Mug": MUGS[1:2]}) == [MUGS[1]]
    assert matched_objects([belief("Mug", 0.0, 2.41), belief("Cup", 0.0, 2.0)], bodies) == [None, None]


def test_objects_are_seen_from_enough_pixels_near_enough():
    seen_by = witness()
    seen_by.begin_round(0)
    seen_by.look(frame(instance=2, num_px=24))
    assert not seen_by.is_target_seen
    seen_by.look(frame(instance=2, num_px=25, pose=Pose(0.0, 0.8, 2.0 - EVIDENCE_RANGE_M - 0.01, 0.0, 0.0)))
    # From afar the target is in view, as success and oracle baselines have it, but nothing that a memory would take.
    assert (seen_by.is_target_visible, seen_by.is_target_seen) == (True, False)
    seen_by.begin_round(1)
    assert not seen_by.is_target_visible
    seen_by.look(frame(instance=2, num_px=25))
    assert seen_by.is_target_seen


def test_memory_is_held_against_what_was_seen():
    so_far = TrackedState(seen_ids={"b", "gone"})
    seen_by = witness(so_far=so_far)
    start = seen_by.begin([belief("Mug", 0.3, 2.0), belief("Mug", 3.0, 3.0)])
    assert (start.num_entries, start.num_right, start.num_held, start.num_seen, start.num_seen_held) == (2, 1, 1, 1, 1)
    seen_by.begin_round(0)
    seen_by.look(frame(instance=2))
    seen_by.look(frame(instance=1))  # a floor is no object
    end, num_forgotten = seen_by.end([belief("Mug", 0.0, 2.0), belief("Mug", 0.0, 2.1), belief("Mug", 9.0, 9.0)])
    assert (end.num_entries, end.num_right, end.num_held, end.num_seen, end.num_seen_held) == (3, 2, 1, 2, 1)
    assert end.position_error_m == pytest.approx(0.05)
    # Nothing was carried over from an earlier stage, so nothing was forgotten.
    assert num_forgotten == 0
    assert so_far.seen_ids == {"a", "b", "gone"}


def test_forgotten_is_what_was_known_after_the_stage_before_and_stands_where_it_stood():
    known = [belief("Mug", 0.0, 2.0), belief("Mug", 0.3, 2.0), belief("Mug", 5.0, 5.0)]
    seen_by = witness(so_far=TrackedState(beliefs=known))
    seen_by.begin([])  # it forgot everything when it was told the goal
    _, num_forgotten = seen_by.end([belief("Mug", 0.32, 2.0)])
    assert num_forgotten == 1


def test_a_stale_entry_is_evident_in_view_and_cleared_when_it_is_gone_or_corrected():
    stale = belief("Cup", 0.0, 3.0)
    seen_by = witness([*MUGS, body("c", "Cup", 2.0, 1.0)])
    seen_by.begin([stale])
    seen_by.begin_round(0)
    seen_by.look(frame(pose=Pose(0.0, 0.8, 0.0, math.pi, 0.0)))  # turned away
    assert not seen_by.wants_entries
    seen_by.begin_round(1)
    seen_by.look(frame(depth_m=2.0))  # something stands in front
    assert not seen_by.wants_entries
    seen_by.begin_round(2)
    seen_by.look(frame())
    assert seen_by.wants_entries
    seen_by.take_entries([belief("Cup", 0.1, 3.0, entry_id=77)])  # renumbered, the same belief
    assert seen_by.wants_entries
    seen_by.begin_round(3)
    seen_by.take_entries([belief("Cup", 2.0, 1.0)])
    assert not seen_by.wants_entries
    (told,) = seen_by.stale_entries()
    assert (told.label, told.evident_round, told.cleared_round) == ("Cup", 2, 3)


def test_a_moved_object_is_found_when_an_entry_stands_for_it():
    far, near = (0.0, 0.8, 5.0), (0.3, 0.8, 2.39)
    moved = Relocation(object_id="a", category="Mug", from_m=far, to_m=(0.0, 0.8, 2.0))
    barely = Relocation(object_id="b", category="Mug", from_m=near, to_m=(0.3, 0.8, 2.0))
    seen_by = witness(relocations=[moved, barely])
    seen_by.begin([])
    seen_by.begin_round(4)
    seen_by.look(frame(instance=2))
    assert seen_by.wants_entries
    seen_by.take_entries([belief("Mug", 0.3, 2.0)])  # the other one
    seen_by.begin_round(5)
    seen_by.take_entries([belief("Mug", 0.0, 2.0)])
    # `b` moved so little that an entry of it would still be right.
    (told,) = seen_by.moved_objects()
    assert (told.object_id, told.seen_round, told.found_round) == ("a", 4, 5)


def test_places_are_shown_in_the_image_near_and_free():
    assert shows_place(frame(), belief("Cup", 0.0, 3.0))
    assert not shows_place(frame(), belief("Cup", 0.0, 3.6))
    assert not shows_place(frame(), belief("Cup", 3.0, 1.0))  # beside the image
    assert not shows_place(frame(), belief("Cup", 0.0, -1.0))
    assert not shows_place(frame(), belief("Cup", 0.0, 1.0, y_m=2.5))  # above it
    assert shows_place(frame(depth_m=2.86), belief("Cup", 0.0, 3.0))  # its own surface
    assert not shows_place(frame(depth_m=2.84), belief("Cup", 0.0, 3.0))
    # Along +x, and down: AI2-THOR's yaw and horizon.
    below, east = belief("Cup", 2.0, 0.0, y_m=0.0), math.pi / 2
    assert shows_place(frame(pose=Pose(0.0, 1.8, 0.0, east, math.radians(45.0))), below)
    assert not shows_place(frame(pose=Pose(0.0, 1.8, 0.0, east, math.radians(-45.0))), below)


@pytest.mark.parametrize(("yaw_deg", "horizon_deg"), [(0, 0), (30, 20), (-70, 0), (200, 30)])
def test_what_a_simulator_draws_of_a_thing_is_where_its_place_is_shown(yaw_deg, horizon_deg):
    """The projection, held against rays: the pixel whose ray meets a point is the one that is looked at."""
    pose = Pose(1.0, 1.5, -2.0, math.radians(yaw_deg), math.radians(horizon_deg))
    yaw, down = pose.yaw_rad, pose.horizon_rad
    ahead = np.array([math.sin(yaw) * math.cos(down), -math.sin(down), math.cos(yaw) * math.cos(down)])
    right = np.array([math.cos(yaw), 0.0, -math.sin(yaw)])
    below = np.cross(ahead, right) * -1.0
    below = below if below[1] < 0 else -below
    for row, col in [(3, 5), (20, 20), (38, 1)]:
        offset = ((col + 0.5) - PX / 2, (row + 0.5) - PX / 2)
        ray = ahead + right * offset[0] / INTRINSICS.focal_px + below * offset[1] / INTRINSICS.focal_px
        point = np.array([1.0, 1.5, -2.0]) + 2.0 * ray
        seen = frame(depth_m=0.1, pose=pose)
        seen.depth_m[row, col] = 2.0
        assert shows_place(seen, EntryBelief(1, "Cup", tuple(point.tolist()), (0.01, 0.01, 0.01), 1))


def test_entries_of_doors_and_windows_count_nowhere():
    bodies = [*MUGS, body("d", "Doorway", 0.0, 4.0, kind="door"), body("w", "Window", 1.0, 4.0, kind="window")]
    structures = [belief("Doorway", 0.0, 4.0), belief("Window", 1.0, 4.0), belief("Doorframe", 8.0, 8.0, entry_id=7)]
    so_far = TrackedState()
    seen_by = witness(bodies, so_far)
    mugs = [belief("Mug", 0.3, 2.0), belief("Mug", 3.0, 3.0, entry_id=5)]
    start = seen_by.begin([*structures, *mugs])
    assert (start.num_entries, start.num_right, start.num_held) == (2, 1, 1)
    assert seen_by.stale_ids([*structures, *mugs]) == [5]
    assert [entry.label for entry in seen_by.stale_entries()] == ["Mug"]
    seen_by.begin_round(0)
    seen_by.look(frame(instance=4))
    end, _ = seen_by.end([*structures, *mugs])
    assert (end.num_entries, end.num_right, end.num_held, end.num_seen) == (2, 1, 1, 0)
    assert end.position_error_m == pytest.approx(0.0)
    assert so_far.beliefs == mugs
    # The next house: the agent has forgotten the door, which is no loss.
    after = witness(bodies, so_far)
    after.begin(mugs)
    assert after.end(mugs)[1] == 0
