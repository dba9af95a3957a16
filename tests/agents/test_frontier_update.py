"""Frontier-Update, Stage-Reset and Fail-then-Update on the toy house."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scripted_model import Scripted
from toy_house import CHAIR_AWAY, ToySimulator, stage_case

from evonav.agents.explorer import Explorer, ExplorerConfig
from evonav.agents.frontier_update.agent import FrontierUpdate, FrontierUpdateConfig
from evonav.agents.frontier_update.fail_then_update import SAME_PLACE_M, FailThenUpdate, FailThenUpdateConfig
from evonav.agents.frontier_update.stage_reset import StageReset, StageResetConfig
from evonav.agents.navigator import Navigator, NavigatorConfig, Target
from evonav.agents.viewpoint import widest_direction_rad
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState
from evonav.memory import ObjectMap
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.sensors.observation import Detections, MapFrame, Observation, View, VisibleOccupancy
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics

START = Pose(1.0, 0.9, 3.0, 0.0)


def run(agent, case, protocol=None):
    episode = Episode(case, "a", agent, ToySimulator(), GroundTruthPerception(), protocol or ProtocolConfig(), 7)
    records = [outcome.record for outcome in episode.run()]
    assert all(record.is_scored for record in records), [record.error for record in records]
    return records


def case_of(*stages, start=START):
    return EpisodeSpec("toy", "toy", start, stages)


def moved_case():
    """The chair is found, the agent goes to the bedroom, and the chair is gone when it is asked for again."""
    gone = {"Chair|1": (0.5, 0.45, 0.6)}
    return case_of(
        stage_case(1, "Chair|1"),
        stage_case(2, "Bed|1"),
        stage_case(3, "Chair|1", moves=CHAIR_AWAY, mode="SALIENT_OBJECT"),
        stage_case(4, "Chair|1", moves=gone, before=CHAIR_AWAY, mode="SALIENT_OBJECT"),
    )


@pytest.fixture(scope="module")
def runs():
    agents = {"fu": FrontierUpdate, "stage-reset": StageReset, "ftu": FailThenUpdate}
    return {name: run(agent(), moved_case()) for name, agent in agents.items()}


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
        for record in run(agent, case_of(*stages)):
            assert record.trace[-1].counters["conflicts"] == 0


def test_a_contradicted_map_is_rebuilt_and_the_entries_stay(runs):
    counters = [record.trace[-1].counters for record in runs["fu"]]
    assert counters[1]["conflicts"] == 0
    assert counters[2]["conflicts"] >= 1
    assert counters[2]["cells_cleared"] > 0
    assert len(runs["fu"][2].entries) >= len(runs["fu"][1].entries)


def test_stage_reset_is_the_same_without_a_past(runs):
    """No image, id or cell of an earlier stage is reachable: alone, from the same pose, a stage is the same."""
    for record in runs["stage-reset"][1:]:
        start = record.effective_start
        pose = Pose(start.x_m, start.y_m, start.z_m, start.yaw_rad, start.horizon_rad)
        (alone,) = run(StageReset(), case_of(moved_case().stages[record.stage - 1], start=pose))[:1] or ()
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
    fu, reset = run(FrontierUpdate(), case_of(*stages)), run(StageReset(), case_of(*stages))
    assert fu[2].state is EndState.SUCCESS
    assert fu[2].spl >= reset[2].spl
    assert fu[2].trace[0].choice.startswith("object")


def test_five_candidates_at_most_are_shown():
    model = Scripted(lambda question: "Frontier 0")
    run(FrontierUpdate(decision=model), case_of(stage_case(1, "Mug|1")), ProtocolConfig(max_rounds=10))
    assert max(len(question.objects) for question in model.questions) == 5


def test_invalid_answers_are_asked_again_then_the_nearest_frontier_is_taken():
    model = Scripted(lambda question: "Object 99")
    (record,) = run(FrontierUpdate(decision=model), case_of(stage_case(1, "Mug|1")), ProtocolConfig(max_rounds=3))
    assert record.trace[-1].counters["invalid_answers"] == record.trace[-1].counters["decisions"] == 9
    assert all(entry.choice.startswith("frontier") for entry in record.trace)


def test_an_object_is_kept_until_arrival_and_a_frontier_for_one_round():
    model = Scripted(lambda question: "Object 0" if len(question.objects) > 1 else "Frontier 0")
    (record,) = run(FrontierUpdate(decision=model), case_of(stage_case(1, "Mug|1")))
    objects = [entry.choice for entry in record.trace if entry.choice.startswith("object")]
    assert len(set(objects)) == 1
    assert len(model.questions) == len(record.trace) - len(objects) + 1
    assert record.has_stopped


def test_fail_then_update_asks_once_an_arrival_and_goes_on_until_the_budget_ends():
    model = Scripted(
        lambda question: "no" if question.kind == "verify" else "Object 0" if question.objects else "Frontier 0"
    )
    (record,) = run(FailThenUpdate(decision=model), case_of(stage_case(1, "Mug|1")), ProtocolConfig(max_rounds=12))
    counters = record.trace[-1].counters
    assert not record.has_stopped
    assert record.num_rounds == 12
    assert counters["rejected_entries"] == counters["verifications"] >= 1


def test_an_unsupported_choice_leads_to_the_frontier_nearest_to_it():
    """After a conflict the map is blank around old entries: the agent explores towards them."""
    agent = FrontierUpdate()
    far = {"DiningTable|1": (2.9, 0.4, 3.6)}
    stages = (
        stage_case(1, "GarbageCan|1"),
        stage_case(2, "Fridge|1"),
        stage_case(3, "GarbageCan|1", moves=far, mode="SALIENT_OBJECT"),
    )
    records = run(agent, case_of(*stages))
    assert records[2].trace[0].counters["conflicts"] == 1
    assert records[2].trace[0].counters["unsupported_choices"] >= 1
    assert records[2].trace[0].choice.startswith("frontier")
    assert records[2].state is EndState.SUCCESS


def test_budget_end_within_the_radius_counts():
    """The paper's formula asks for no stop."""
    (record,) = run(
        FrontierUpdate(decision=Scripted(lambda question: "Frontier 0")),
        case_of(stage_case(1, "Fridge|1"), start=replace(START, x_m=0.6, z_m=3.5)),
        ProtocolConfig(max_rounds=1),
    )
    assert not record.has_stopped
    assert record.state is (EndState.SUCCESS if record.terminal_distance_m < 2.0 else EndState.FAILURE)


def agent_run(agent, case, protocol=None):
    """A run, and the agent after it."""
    return run(agent, case, protocol), agent


TABLE_AWAY = {"DiningTable|1": (2.9, 0.4, 3.6), "Mug|1": (2.6, 0.87, 3.6)}


def table_case():
    """The house is seen, and the table moves while the agent is in the bedroom."""
    return case_of(
        stage_case(1, "GarbageCan|1"),
        stage_case(2, "Fridge|1"),
        stage_case(3, "DiningTable|1", moves=TABLE_AWAY, mode="SALIENT_OBJECT"),
    )


def rounds_of(agent, case, protocol=None):
    """Belief and diagnostics after every round, by stage."""
    told, stages = [], []
    act, begin_stage = agent.act, agent.begin_stage

    def spied(observation):
        action = act(observation)
        told.append((stages[-1], agent.belief(), agent.diagnostics(), action))
        return action

    agent.act = spied
    agent.begin_stage = lambda stage: stages.append(stage.stage) or begin_stage(stage)
    return run(agent, case, protocol), told


def test_a_moved_table_leaves_its_entry_clears_the_map_and_reopens_frontiers():
    records, told = rounds_of(FrontierUpdate(), table_case())
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


def test_fail_then_update_deletes_the_moved_table_on_arrival_and_nothing_else(monkeypatch):
    removed = []
    remove = ObjectMap.remove
    monkeypatch.setattr(ObjectMap, "remove", lambda self, entry_id: removed.append(entry_id) or remove(self, entry_id))
    records, told = rounds_of(FailThenUpdate(), table_case())
    rejected = [d.counters["rejected_entries"] for _, _, d, _ in told]
    rejections = [i for i in range(1, len(told)) if rejected[i] > rejected[i - 1]]
    assert len(rejections) == len(removed) >= 1
    for i, gone in zip(rejections, removed, strict=True):
        before, after = ({e.entry_id: e.label for e in told[j][1].entries} for j in (i - 1, i))
        assert before[gone] == "DiningTable"
        assert gone not in after
        assert set(before.values()) - {"DiningTable"} <= set(after.values())
        assert told[i - 1][2].choice == f"object {gone}"  # it was committed to it, and arrived
        assert told[i][2].details["rejected"][-1] == gone
    assert records[2].state is EndState.SUCCESS
    assert not set(removed) & {e.entry_id for e in records[2].entries}


def view_of(free=(), blocked=()):
    """A view that saw these cells."""
    cells = [np.array(sorted(part), np.int32).reshape(-1, 2) for part in (free, blocked)]
    nothing = Detections(np.full((2, 2), -1, np.int32), (), np.zeros(0, np.float32))
    pose = Pose(0.05, 1.5, 0.05, 0.0)
    depth_m = np.full((2, 2), np.inf, np.float32)
    return View(pose, Intrinsics(2, 2, 1.0), depth_m, nothing, VisibleOccupancy(*cells))


def saw(*views):
    return Observation(views, Pose(0.05, 0.9, 0.05, 0.0), is_action_success=True, num_rounds_left=9)


BLOCK = [(row, col) for row in range(20, 25) for col in range(20, 25)]


@pytest.mark.parametrize(
    ("config", "contradicting", "is_rebuilt"),
    [
        ({}, BLOCK[:1], True),
        ({"min_conflict_cells": 2}, BLOCK[:1], False),  # two views of one cell are one cell
        ({"min_conflict_cells": 2}, BLOCK[:2], True),
        ({"min_conflict_cells": None}, BLOCK, False),
        ({"conflict_margin_cells": 1}, BLOCK[:10], False),  # two rows have no inner cell
        ({"conflict_margin_cells": 1}, BLOCK, True),
        ({"conflict_margin_cells": 1, "min_conflict_cells": 10}, BLOCK, False),  # nine of twenty-five are inner ones
        ({"conflict_margin_cells": 3}, BLOCK, False),
    ],
)
@pytest.mark.parametrize("is_freed", [True, False])
def test_conflicts_are_cells_that_contradict_the_map(config, contradicting, is_rebuilt, is_freed):
    explorer = Explorer(MapFrame(40, 40, 0.1, (0.0, 0.0)), ExplorerConfig(**config))
    elsewhere = [(30, 30)]
    first = view_of(elsewhere, BLOCK) if is_freed else view_of([*elsewhere, *BLOCK])
    second = view_of(contradicting) if is_freed else view_of(blocked=contradicting)
    assert not explorer.observe(saw(first))
    assert explorer.observe(saw(second, second)) == is_rebuilt
    assert explorer.num_conflicts == is_rebuilt
    assert (explorer.map.cells[30, 30] == 0) == is_rebuilt  # the whole map goes, not the contradicting cells alone
    row, col = contradicting[0]
    assert explorer.map.cells[row, col] == (1 if is_freed else 2)  # the last observation wins either way


@pytest.mark.parametrize("is_contradicted", [True, False])
def test_a_commitment_ends_with_the_map_that_it_was_made_on(is_contradicted):
    navigator = Navigator(MapFrame(40, 40, 0.1, (0.0, 0.0)), NavigatorConfig())
    navigator.observe(saw(view_of(BLOCK)))
    navigator.target = Target(1, (2.0, 2.0), (2.5, 2.5))
    navigator.observe(saw(view_of(blocked=BLOCK[:1]) if is_contradicted else view_of(BLOCK[:1])))
    assert (navigator.target is None) == is_contradicted


def test_without_a_valid_answer_the_stage_ends_if_so_configured():
    model = Scripted(lambda question: "nonsense")
    config = FrontierUpdateConfig(on_failed_decision="abort")
    (record,) = run(FrontierUpdate(config, model), case_of(stage_case(1, "Mug|1")))
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
    _, told = rounds_of(FrontierUpdate(FrontierUpdateConfig(explore_towards=towards)), case_of(*stages))
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
    _, told = rounds_of(FrontierUpdate(), case_of(stage_case(1, "Fridge|1", instruction="Find the chair.")))
    _, belief, diagnostics, action = told[0]
    assert diagnostics.counters["unsupported_choices"] == 1
    (chosen,) = [e for e in belief.entries if f"object {e.entry_id}" == diagnostics.choice]
    assert action.position_m == (chosen.centre_m[0], chosen.centre_m[2])


def test_frontier_update_ends_without_candidates_and_asks_nothing(monkeypatch):
    monkeypatch.setattr(Explorer, "frontiers", property(lambda self: []))
    monkeypatch.setattr(FrontierUpdate, "_is_offered", lambda self, entry: False)
    model = Scripted(lambda question: "Frontier 0")
    (record,) = run(FrontierUpdate(decision=model), case_of(stage_case(1, "Mug|1")))
    assert (record.num_rounds, record.stop_reason) == (1, "nothing to go to")
    assert not model.questions


@pytest.mark.parametrize("what", ["widest_direction", "end"])
def test_stage_reset_sees_nothing_and_takes_the_widest_direction_or_ends(monkeypatch, what):
    monkeypatch.setattr(Explorer, "frontiers", property(lambda self: []))
    monkeypatch.setattr(FrontierUpdate, "_is_offered", lambda self, entry: False)
    (record,) = run(StageReset(StageResetConfig(on_nothing_found=what)), case_of(stage_case(1, "Mug|1")))
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


@pytest.mark.parametrize("meaning", ["yes", "no"])
def test_verification_without_an_answer_is_taken_for_yes_or_no(meaning):
    model = Scripted(
        lambda question: "perhaps" if question.kind == "verify" else "Object 0" if question.objects else "Frontier 0"
    )
    agent = FailThenUpdate(FailThenUpdateConfig(unanswered_means=meaning), model)
    (record,) = run(agent, case_of(stage_case(1, "Mug|1")), ProtocolConfig(max_rounds=12))
    counters = record.trace[-1].counters
    assert counters["failed_decisions"] == counters["verifications"] >= 1
    if meaning == "yes":
        assert (record.stop_reason, counters["rejected_entries"]) == ("verified", 0)
    else:
        assert not record.has_stopped
        assert counters["rejected_entries"] == counters["verifications"]


@pytest.mark.parametrize(("views", "num_views"), [("facing", 1), ("all", 3)])
def test_verification_is_asked_at_arrival_alone_on_the_facing_view_or_on_all(views, num_views):
    model = Scripted(
        lambda question: "yes" if question.kind == "verify" else "Object 0" if question.objects else "Frontier 0",
        needs_images=True,
    )
    agent = FailThenUpdate(FailThenUpdateConfig(verify_views=views), model)
    (record,) = run(agent, case_of(stage_case(1, "Mug|1")))
    verified = [question for question in model.questions if question.kind == "verify"]
    assert len(verified) == record.trace[-1].counters["verifications"] == 1
    assert model.questions[-1] is verified[0]
    assert len(verified[0].views) == num_views
    # Motion ended in the round before, at the place to stand.
    assert record.trace[-2].choice == f"object {verified[0].entry.entry_id}"
    assert record.num_rounds == len(record.trace)


def test_what_was_rejected_and_came_up_again_can_be_hidden_for_the_rest_of_the_stage():
    def answer(question):
        return "no" if question.kind == "verify" else "Object 0" if question.objects else "Frontier 0"

    def rejections(limit):
        """How many entries were rejected by stage, and how many of them were offered again in theirs."""
        model = Scripted(answer)
        agent = FailThenUpdate(FailThenUpdateConfig(hide_after_rejections=limit), model)
        run(agent, case_of(stage_case(1, "Mug|1"), stage_case(2, "Mug|1")), ProtocolConfig(max_rounds=40))
        rejected, num_again = {1: [], 2: []}, 0
        for question in model.questions:
            gone = rejected[question.goal.stage]
            if question.kind == "verify":
                gone.append(question.entry)
                continue
            for candidate in question.objects:
                num_again += any(
                    candidate.label == one.label and math.dist(candidate.centre_m, one.centre_m) <= SAME_PLACE_M
                    for one in gone
                )
        return {stage: len(gone) for stage, gone in rejected.items()}, num_again

    open_rejected, num_open_again = rejections(None)
    hidden_rejected, num_hidden_again = rejections(1)
    assert (num_open_again > 0, num_hidden_again) == (True, 0)
    assert hidden_rejected[2] < open_rejected[2]
    assert hidden_rejected[2] >= 1  # another stage offers it again


def test_a_stage_reset_within_a_still_house_never_contradicts_its_map(runs):
    assert all(record.trace[-1].counters["conflicts"] == 0 for record in runs["stage-reset"])
    assert runs["fu"][2].trace[-1].counters["conflicts"] > 0  # the same house did change
