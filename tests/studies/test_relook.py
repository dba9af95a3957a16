"""Fail-then-Update's second look: where from, how often, and what it changes."""

import math
from dataclasses import replace

import numpy as np
import pytest
from cup_views import a_view
from evonav_studies.relook import FailThenUpdateRelook, RelookConfig, place_from_another_side, places_around
from hypothesis import given
from hypothesis import strategies as st
from scripted_model import going
from toy_episode import run
from toy_house import moved_table_stages, stage_case

from evonav.agents.frontier_update.fail_then_update import FailThenUpdate
from evonav.agents.navigator import NavigationTarget, Navigator, NavigatorConfig
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState
from evonav.memory import ObjectMap
from evonav.sensors.observation import MapFrame
from evonav.world.pose import Pose

FRAME = MapFrame(rows=40, cols=40, cell_m=0.1, corner_m=(-1.0, 3.0))
MIDDLE_M = (1.0, 5.0)


def places_naive(is_free, object_m, first_m, distance_m, min_turn_rad, num_directions):
    """Each direction and each cell by itself."""
    allowed = []
    for row, col in np.argwhere(is_free).tolist():
        x_m, z_m = FRAME.corner_m[0] + (col + 0.5) * 0.1, FRAME.corner_m[1] + (row + 0.5) * 0.1
        to_cell, to_first = (
            math.atan2(x - object_m[0], z - object_m[1]) for x, z in ((x_m, z_m), (first_m[0], first_m[1]))
        )
        turn_rad = abs(math.remainder(to_cell - to_first, math.tau))
        if turn_rad >= min_turn_rad and math.dist((x_m, z_m), object_m) <= distance_m + 0.2:
            allowed.append((x_m, z_m))
    found = set()
    first_rad = math.atan2(first_m[0] - object_m[0], first_m[1] - object_m[1])
    for k in range(num_directions if allowed else 0):
        angle_rad = math.tau * k / num_directions
        if abs(math.remainder(angle_rad - first_rad, math.tau)) < min_turn_rad - 1e-9:
            continue
        wanted = (object_m[0] + distance_m * math.sin(angle_rad), object_m[1] + distance_m * math.cos(angle_rad))
        gaps = [round(math.dist(place, wanted), 9) for place in allowed]
        found.add(allowed[gaps.index(min(gaps))])
    return found


@given(
    seed=st.integers(0, 2**32 - 1),
    share=st.sampled_from([0.02, 0.3, 0.9]),
    # Off the lattice of the cells, so that no two of them are equally near.
    object_m=st.tuples(st.floats(-0.5, 2.5), st.floats(3.5, 6.5)).map(lambda p: (p[0] + 0.0123, p[1] + 0.0271)),
    bearing_rad=st.floats(-4.0, 4.0),
    min_turn_deg=st.sampled_from([0.0, 60.0, 170.0]),
)
def test_places_are_those_of_the_plain_twin(seed, share, object_m, bearing_rad, min_turn_deg):
    is_free = np.random.default_rng(seed).random((40, 40)) < share
    first_m = (object_m[0] + 1.5 * math.sin(bearing_rad), object_m[1] + 1.5 * math.cos(bearing_rad))
    places_m, turns_rad = places_around(
        is_free, FRAME, object_m, first_m, distance_m=1.5, min_turn_rad=math.radians(min_turn_deg), num_directions=12
    )
    twin = places_naive(is_free, object_m, first_m, 1.5, math.radians(min_turn_deg), 12)
    gaps = [min(math.dist(place, other) for other in twin) for place in places_m.tolist()]
    assert len(places_m) == len(twin) == len(turns_rad)
    assert max(gaps, default=0.0) < 1e-6
    assert (turns_rad > math.radians(min_turn_deg) - 1e-6).all()


def test_on_open_floor_places_lie_on_a_circle_on_the_other_sides():
    places_m, turns_rad = places_around(
        np.ones((40, 40), np.bool_), FRAME, MIDDLE_M, (1.0, 3.5), distance_m=1.5, min_turn_rad=math.radians(60.0)
    )
    assert len(places_m) == 17  # of 24
    assert np.allclose(np.hypot(*(places_m - MIDDLE_M).T), 1.5, atol=0.1)
    assert math.degrees(turns_rad.max()) > 175.0
    assert (places_m[:, 1] > 4.2).all()  # none within 60 degrees of straight below


def test_without_free_floor_on_another_side_there_is_no_place():
    is_free = np.zeros((40, 40), np.bool_)
    is_free[:8] = True
    places_m, turns_rad = places_around(
        is_free, FRAME, MIDDLE_M, (1.0, 3.5), distance_m=1.5, min_turn_rad=math.radians(60.0)
    )
    assert (places_m.shape, turns_rad.shape) == ((0, 2), (0,))


def knowing_a_mug():
    """A navigator with one entry, about 2.2 m ahead of (0, 0), and open floor around it."""
    navigator = Navigator(MapFrame(rows=60, cols=60, cell_m=0.1, corner_m=(-3.0, -1.0)), NavigatorConfig())
    depth_m, masks = np.full((60, 60), np.inf, np.float32), np.full((60, 60), -1, np.int32)
    depth_m[20:40, 20:40], masks[20:40, 20:40] = 2.0 + np.linspace(0, 0.3, 20, dtype=np.float32), 0
    free = np.ascontiguousarray(np.argwhere(np.ones((60, 60))), np.int32)
    view = a_view(depth_m, masks, ("Mug",), free=free)
    navigator.objects.update(view)
    navigator.explorer.map.integrate(view.occupancy, (0.0, 0.0))
    (entry,) = navigator.objects.entries
    return navigator, entry


def test_the_second_place_is_the_nearest_of_those_that_show_most(monkeypatch):
    navigator, entry = knowing_a_mug()
    x_m, _, z_m = entry.centre_m
    first, config = Pose(x_m, 1.575, z_m - 1.5, 0.0, 0.0), RelookConfig()

    def place(share_of):
        monkeypatch.setattr(ObjectMap, "visible_shares", lambda self, points_m, eyes_m: share_of(eyes_m))
        return place_from_another_side(navigator, entry, first, 5.0, config)

    right = place(lambda eyes_m: np.where(eyes_m[:, 0] > x_m, 0.9, 0.4))
    assert right.position_m[0] > x_m + 1.0
    assert 60.0 <= right.turn_deg < 80.0  # of those on the right, the nearest
    assert right.way_m == pytest.approx(math.dist(right.position_m, (first.x_m, first.z_m)), rel=0.1)
    far = place(lambda eyes_m: np.where(eyes_m[:, 2] > z_m + 1.4, 0.5, 0.4))
    assert far.turn_deg > 150.0
    assert place(lambda eyes_m: np.zeros(len(eyes_m))) is None
    assert place_from_another_side(navigator, entry, first, 0.5, config) is None


def test_the_second_place_is_kept_when_the_middle_of_the_entry_shifts():
    navigator, entry = knowing_a_mug()
    x_m, _, z_m = entry.centre_m
    target = NavigationTarget(entry.id, (1.0, 1.0), (x_m + 0.5, z_m), keeps_place=True)
    navigator.target = target
    navigator.aim()
    assert navigator.target == target
    navigator.target = replace(target, keeps_place=False)
    navigator.aim()
    assert navigator.target.centre_m == (x_m, z_m)
    assert navigator.target.goal_m != target.goal_m


def hide_arrivals(agent, stage, num):
    """Let something stand before the camera at the first `num` arrivals at an object from a stage on.

    Returns:
        The agent's poses at all of these arrivals, which are added as it goes.
    """
    act, begin_stage, stages, poses = agent.act, agent.begin_stage, [], []

    def hidden(view):
        nothing = replace(view.detections, masks=np.full_like(view.detections.masks, -1))
        return replace(view, depth_m=np.full_like(view.depth_m, 0.3), detections=nothing)

    def act_hidden(observation):
        if stages[-1] >= stage and observation.has_arrived and agent.explain().choice.startswith("object"):
            if len(poses) < num:
                observation = replace(observation, views=tuple(map(hidden, observation.views)))
            poses.append(observation.pose)
        return act(observation)

    agent.begin_stage = lambda goal: stages.append(goal.stage) or begin_stage(goal)
    agent.act = act_hidden
    return poses


def relooks_of(record):
    counters = record.trace[-1].counters
    names = ("relooks", "relooks_yes", "relooks_no", "relooks_unknown", "relooks_without_place")
    return tuple(counters[name] for name in names)


def second_looks(record):
    return [entry for entry in record.trace if entry.details.get("reason", "").startswith("a second look")]


def test_a_second_look_deletes_a_table_whose_absence_the_first_could_not_tell():
    agent = FailThenUpdate()
    hide_arrivals(agent, 3, 1)
    assert run(agent, *moved_table_stages())[2].trace[-1].counters["rejected_entries"] == 0
    agent = FailThenUpdateRelook()
    poses = hide_arrivals(agent, 3, 1)
    last = run(agent, *moved_table_stages())[2]
    (looked,) = second_looks(last)
    assert looked.chosen_entry.is_stale
    assert "256 hidden" in looked.details["reason"]
    assert looked.details["relooks"] == [looked.chosen_entry.entry_id]
    assert last.trace[-1].details["rejected"][0] == looked.chosen_entry.entry_id
    assert relooks_of(last) == (1, 0, 1, 0, 0)
    assert last.state is EndState.SUCCESS
    x_m, _, z_m = looked.chosen_entry.centre_m
    first, second = (math.atan2(pose.x_m - x_m, pose.z_m - z_m) for pose in poses[:2])
    assert abs(math.remainder(second - first, math.tau)) >= math.radians(58.0)  # the planner ends within a step


def test_a_second_look_finds_what_the_first_could_not_see(monkeypatch):
    kept, aim = [], Navigator.aim
    monkeypatch.setattr(Navigator, "aim", lambda self: kept.append(self.target.keeps_place) or aim(self))
    agent = FailThenUpdateRelook()
    poses = hide_arrivals(agent, 3, 1)
    static = (stage_case(1, "GarbageCan|1"), stage_case(2, "Fridge|1"), stage_case(3, "DiningTable|1"))
    last = run(agent, *static)[2]
    assert len(poses) == 2
    assert relooks_of(last) == (1, 1, 0, 0, 0)
    assert kept == sorted(kept)  # on the way to the second place it is kept, and never before
    assert kept[-1]
    assert (last.stop_reason, last.trace[-1].counters["rejected_entries"]) == ("verified", 0)
    assert last.state is EndState.SUCCESS


def test_what_neither_look_shows_is_left_alone_and_not_looked_at_a_third_time():
    agent = FailThenUpdateRelook()
    poses = hide_arrivals(agent, 3, 9)
    last = run(agent, *moved_table_stages())[2]
    assert len(poses) == 2
    assert relooks_of(last) == (1, 0, 0, 1, 0)
    assert (last.stop_reason, last.trace[-1].counters["rejected_entries"]) == ("verified", 0)
    assert second_looks(last)[0].chosen_entry.entry_id in {entry.entry_id for entry in last.entries}


def test_an_entry_may_be_looked_at_again_in_the_next_stage():
    agent = FailThenUpdateRelook()
    hide_arrivals(agent, 3, 9)
    stages = [stage_case(1, "GarbageCan|1"), stage_case(2, "Fridge|1")]
    stages += [stage_case(stage, "DiningTable|1") for stage in (3, 4)]
    *_, third, fourth = run(agent, *stages)
    assert relooks_of(third) == (1, 0, 0, 1, 0)
    assert relooks_of(fourth) == (2, 0, 0, 2, 0)


@pytest.mark.parametrize("config", [RelookConfig(max_way_m=0.3), RelookConfig(min_turn_deg=180.0)])
def test_without_a_place_from_which_to_look_the_first_look_counts(config):
    agent = FailThenUpdateRelook(config)
    poses = hide_arrivals(agent, 3, 9)
    last = run(agent, *moved_table_stages())[2]
    assert len(poses) == 1
    assert relooks_of(last) == (0, 0, 0, 0, 1)
    assert last.stop_reason == "verified"


def test_no_second_look_is_begun_that_the_rounds_left_do_not_allow():
    agent = FailThenUpdateRelook()
    hide_arrivals(agent, 3, 1)
    looked_at = second_looks(run(agent, *moved_table_stages())[2])[0].round
    agent = FailThenUpdateRelook()
    hide_arrivals(agent, 3, 1)
    last = run(agent, *moved_table_stages(), protocol=ProtocolConfig(max_rounds=looked_at + 2))[2]
    assert second_looks(last) == []
    assert (last.stop_reason, last.num_rounds) == ("verified", looked_at + 1)


def test_the_question_is_asked_once_and_shows_both_looks():
    model = going(verify="yes", needs_images=True)
    agent = FailThenUpdateRelook(decision=model)
    hide_arrivals(agent, 1, 1)
    (record,) = run(agent, stage_case(1, "Mug|1"))
    (verified,) = (question for question in model.questions if question.kind == "verify")
    assert len(verified.views) == 2
    assert (relooks_of(record), record.trace[-1].counters["verifications"]) == ((1, 1, 0, 0, 0), 1)
    assert verified.evidence.num_not_hidden > 0


def test_without_the_option_nothing_of_it_is_recorded():
    (record,) = run(FailThenUpdate(), stage_case(1, "Mug|1"))
    assert not [name for name in record.trace[-1].counters if "relook" in name]
