"""Frontier-Update, Stage-Reset and Fail-then-Update on the toy house."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scripted_model import Scripted
from toy_episode import START, rounds_of, run
from toy_house import CHAIR_AWAY, moved_table_stages, stage_case

from evonav.agents.explorer import Explorer
from evonav.agents.frontier_update.agent import FrontierUpdate, FrontierUpdateConfig, StageReset, StageResetConfig
from evonav.agents.frontier_update.fail_then_update import FailThenUpdate
from evonav.agents.navigator import Navigator
from evonav.agents.viewpoint import widest_direction_rad
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState
from evonav.sensors.observation import MapFrame
from evonav.world.pose import Pose


def moved_stages():
    """The chair is found, the agent goes to the bin in the bedroom, and the chair is gone when asked for again."""
    gone = {"Chair|1": (0.5, 0.45, 0.6)}
    return (
        stage_case(1, "Chair|1"),
        stage_case(2, "GarbageCan|1"),
        stage_case(3, "Chair|1", moves=CHAIR_AWAY, mode="SALIENT_OBJECT"),
        stage_case(4, "Chair|1", moves=gone, before=CHAIR_AWAY, mode="SALIENT_OBJECT"),
    )


@pytest.fixture(scope="module")
def runs():
    agents = {"fu": FrontierUpdate, "stage-reset": StageReset, "ftu": FailThenUpdate}
    return {name: run(agent(), *moved_stages()) for name, agent in agents.items()}


@pytest.mark.parametrize("name", ["fu", "stage-reset", "ftu"])
def test_static_goals_are_found(runs, name):
    assert [record.state for record in runs[name][:2]] == [EndState.SUCCESS] * 2
    assert all(record.has_stopped for record in runs[name][:2])


def test_frontier_update_believes_a_stale_entry(runs):
    third = runs["fu"][2]
    assert third.state is EndState.FAILURE
    assert third.stop_reason == "arrived"
    last = third.trace[-1].chosen_entry
    assert (last.label, last.is_stale) == ("Chair", True)
    assert any(entry.is_stale and entry.label == "Chair" for entry in third.entries)


def test_fail_then_update_drops_it_and_goes_on(runs):
    third = runs["ftu"][2]
    assert third.state is EndState.SUCCESS
    assert third.stop_reason == "verified"
    assert third.trace[-1].counters["rejected_entries"] >= 1
    assert not any(entry.is_stale and entry.label == "Chair" for entry in third.entries)
    before = {entry.label for entry in runs["ftu"][1].entries}
    assert before <= {entry.label for entry in third.entries}  # clean-ups merge entries, but no object is forgotten


def test_stage_reset_never_knows_of_the_old_place(runs):
    third = runs["stage-reset"][2]
    assert third.state is EndState.SUCCESS
    assert not any(entry.is_stale for entry in third.entries)


def test_a_house_that_does_not_change_makes_no_conflict():
    stages = (stage_case(1, "Bed|1"), stage_case(2, "Fridge|1"), stage_case(3, "GarbageCan|1"), stage_case(4, "Mug|1"))
    for agent in (FrontierUpdate(), FailThenUpdate(), StageReset()):
        for record in run(agent, *stages):
            assert record.trace[-1].counters["conflicts"] == 0


def test_stage_reset_is_the_same_without_a_past(runs):
    """No image, id or cell of an earlier stage is reachable: alone, from the same pose, a stage is the same."""
    for record in runs["stage-reset"][1:]:
        start = record.effective_start
        pose = Pose(start.x_m, start.y_m, start.z_m, start.yaw_rad, start.horizon_rad)
        (alone,) = run(StageReset(), moved_stages()[record.stage - 1], start=pose)
        mine = [strip(entry) for entry in record.trace]
        assert [strip(entry) for entry in alone.trace] == mine
        assert alone.entries == record.entries


def strip(entry):
    """A round without its counters, which go on over stages."""
    return entry.model_copy(update={"counters": {}})


def test_first_stages_of_all_three_walk_alike(runs):
    """They differ in what they do with a past, and in what they do on arrival."""
    paths = [[entry.path_m for entry in runs[name][0].trace] for name in ("fu", "stage-reset", "ftu")]
    assert paths[0] == paths[1] == paths[2]


def test_memory_shortens_the_second_visit():
    stages = (stage_case(1, "GarbageCan|1"), stage_case(2, "Fridge|1"), stage_case(3, "GarbageCan|1"))
    fu, reset = run(FrontierUpdate(), *stages), run(StageReset(), *stages)
    assert fu[2].state is EndState.SUCCESS
    assert fu[2].spl >= reset[2].spl
    assert fu[2].trace[0].choice.startswith("object")


def test_five_candidates_at_most_are_shown():
    model = Scripted(lambda question: "Frontier 0")
    run(FrontierUpdate(decision=model), stage_case(1, "Mug|1"), protocol=ProtocolConfig(max_rounds=10))
    assert max(len(question.objects) for question in model.questions) == 5


def test_invalid_answers_are_asked_again_then_the_nearest_frontier_is_taken():
    model = Scripted(lambda question: "Object 99")
    (record,) = run(FrontierUpdate(decision=model), stage_case(1, "Mug|1"), protocol=ProtocolConfig(max_rounds=3))
    assert record.trace[-1].counters["invalid_answers"] == record.trace[-1].counters["decisions"] == 9
    assert all(entry.choice.startswith("frontier") for entry in record.trace)


def test_an_object_is_kept_until_arrival_and_a_frontier_for_one_round():
    model = Scripted(lambda question: "Object 0" if len(question.objects) > 1 else "Frontier 0")
    (record,) = run(FrontierUpdate(decision=model), stage_case(1, "Mug|1"))
    objects = [entry.choice for entry in record.trace if entry.choice.startswith("object")]
    assert len(set(objects)) == 1
    assert len(model.questions) == len(record.trace) - len(objects) + 1
    assert record.has_stopped


def test_budget_end_within_the_radius_counts():
    """The paper's formula asks for no stop."""
    (record,) = run(
        FrontierUpdate(decision=Scripted(lambda question: "Frontier 0")),
        stage_case(1, "Fridge|1"),
        start=replace(START, x_m=0.6, z_m=3.5),
        protocol=ProtocolConfig(max_rounds=1),
    )
    assert not record.has_stopped
    assert record.state is (EndState.SUCCESS if record.terminal_distance_m < 2.0 else EndState.FAILURE)


def test_a_moved_table_leaves_its_entry_clears_the_map_and_reopens_frontiers():
    records, told = rounds_of(FrontierUpdate(), *moved_table_stages())
    before = [belief for stage, belief, _, _ in told if stage == 2][-1]
    fired = next(i for i, (_, _, d, _) in enumerate(told) if d.counters["conflicts"] == 1)
    stage, after, diagnostics, _ = told[fired]
    assert stage == 3
    assert {e.entry_id for e in before.entries if e.label == "DiningTable"} <= {e.entry_id for e in after.entries}
    assert any(e.is_stale and e.label == "DiningTable" for e in records[2].entries)
    assert (after.cells != 0).sum() < (before.cells != 0).sum()
    assert diagnostics.counters["cells_cleared"] >= (before.cells != 0).sum()
    assert diagnostics.counters["frontiers_reset"] == len(before.frontiers)
    assert not any(f.position_m[0] < 4.0 for f in before.frontiers)  # the kitchen was explored
    assert any(f.position_m[0] < 4.0 for f in after.frontiers)
    assert min(f.frontier_id for f in after.frontiers) == 0  # ids start over with the map


def test_without_a_valid_answer_the_stage_ends_if_so_configured():
    model = Scripted(lambda question: "nonsense")
    config = FrontierUpdateConfig(on_failed_decision="abort")
    (record,) = run(FrontierUpdate(config, model), stage_case(1, "Mug|1"))
    assert (record.num_rounds, record.stop_reason) == (1, "no valid answer")
    assert record.trace[-1].counters["failed_decisions"] == 1


@pytest.mark.parametrize("towards", ["object", "agent"])
def test_an_unreached_object_leads_to_the_frontier_nearest_to_it_or_to_the_agent(towards):
    table = {"DiningTable|1": (2.9, 0.4, 3.6)}
    stages = (
        stage_case(1, "GarbageCan|1"),
        stage_case(2, "Fridge|1"),
        stage_case(3, "GarbageCan|1", moves=table, mode="SALIENT_OBJECT"),
    )
    records, told = rounds_of(FrontierUpdate(FrontierUpdateConfig(explore_towards=towards)), *stages)
    assert records[2].trace[0].counters["unsupported_choices"] >= 1
    assert records[2].state is EndState.SUCCESS
    unsupported = [
        (belief, action)
        for _, belief, d, action in told
        if "which the map does not reach" in d.details.get("reason", "")
    ]
    assert unsupported
    for belief, action in unsupported:
        (asked,) = belief.queries
        (chosen,) = [c for i, c in enumerate(asked.question.objects) if asked.text.startswith(f"Object {i}\n")]
        near_m = chosen.ground_m if towards == "object" else asked.question.position_m
        distances = sorted(math.dist(f.position_m, near_m) for f in belief.frontiers)
        assert math.dist(action.position_m, near_m) == pytest.approx(distances[0])


def test_an_unreached_object_without_frontiers_is_left_to_the_planner(monkeypatch):
    monkeypatch.setattr(Explorer, "frontiers", property(lambda self: []))
    monkeypatch.setattr(Navigator, "observation_point", lambda self, centre_m: None)
    _, told = rounds_of(FrontierUpdate(), stage_case(1, "Fridge|1", instruction="Find the chair."))
    _, belief, diagnostics, action = told[0]
    assert diagnostics.counters["unsupported_choices"] == 1
    (chosen,) = [e for e in belief.entries if f"object {e.entry_id}" == diagnostics.choice]
    assert action.position_m == (chosen.centre_m[0], chosen.centre_m[2])


def test_frontier_update_ends_without_candidates_and_asks_nothing(monkeypatch):
    monkeypatch.setattr(Explorer, "frontiers", property(lambda self: []))
    monkeypatch.setattr(FrontierUpdate, "_is_offered", lambda self, entry: False)
    model = Scripted(lambda question: "Frontier 0")
    (record,) = run(FrontierUpdate(decision=model), stage_case(1, "Mug|1"))
    assert (record.num_rounds, record.stop_reason) == (1, "nothing to go to")
    assert not model.questions


@pytest.mark.parametrize("what", ["widest_direction", "end"])
def test_stage_reset_sees_nothing_and_takes_the_widest_direction_or_ends(monkeypatch, what):
    monkeypatch.setattr(Explorer, "frontiers", property(lambda self: []))
    monkeypatch.setattr(FrontierUpdate, "_is_offered", lambda self, entry: False)
    (record,) = run(StageReset(StageResetConfig(on_nothing_found=what)), stage_case(1, "Mug|1"))
    assert record.stop_reason == "nothing to go to"
    if what == "end":
        assert (record.num_rounds, record.path_length_m) == (1, 0.0)
    else:  # the first look alone
        assert record.trace[0].choice == "widest direction"
        assert record.num_rounds == 2
        assert record.path_length_m == pytest.approx(1.0, abs=0.15)


def test_the_widest_direction_is_the_middle_of_the_widest_opening():
    frame = MapFrame(40, 40, 0.1, (0.0, 0.0))
    is_free = np.zeros((40, 40), np.bool_)
    is_free[20, 20] = True
    assert widest_direction_rad(is_free, frame, (2.05, 2.05), 1.0) is None
    is_free[19:22, 5:21] = True  # a corridor to the west
    is_free[10:21, 20:31] = True  # half a room to the south-east
    bearing = widest_direction_rad(is_free, frame, (2.05, 2.05), 0.8)
    assert math.degrees(bearing) == pytest.approx(135.0, abs=10.0)
    is_free[:] = True
    assert widest_direction_rad(is_free, frame, (2.05, 2.05), 1.0) == 0.0
    assert widest_direction_rad(is_free, frame, (0.05, 0.05), 1.0) == pytest.approx(math.radians(45.0), abs=0.05)


def questions(*, needs_colours):
    """Return an agent's questions while it goes to the frontier that is named last."""
    model = Scripted(lambda question: f"Frontier {len(question.frontiers) - 1}")
    model.needs = frozenset({"colours"}) if needs_colours else frozenset()
    run(FrontierUpdate(decision=model), stage_case(1, "Mug|1"), protocol=ProtocolConfig(max_rounds=12), size_px=120)
    return model.questions


def straight_m(question, frontier):
    return math.dist(question.position_m, frontier.position_m)


def test_rules_that_look_are_told_the_way_along_the_map():
    asked = questions(needs_colours=True)
    detours = [one.travel_m / straight_m(question, one) for question in asked for one in question.frontiers]
    assert min(detours) > 0.8  # ways are from cell to cell
    assert max(detours) > 1.2


def test_others_are_told_the_straight_distance():
    for question in questions(needs_colours=False):
        for frontier in question.frontiers:
            assert frontier.travel_m == pytest.approx(straight_m(question, frontier))


def test_the_frontier_on_the_way_is_marked():
    marked = [
        [one.frontier_id for one in question.frontiers if one.is_current] for question in questions(needs_colours=True)
    ]
    assert marked[0] == []
    assert any(marked)
    assert all(len(ids) <= 1 for ids in marked)
