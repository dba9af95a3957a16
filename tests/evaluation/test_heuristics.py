"""Frontier-Update, Stage-Reset and Fail-then-Update on the toy house (design: agents.md 7.4-7.6)."""

from dataclasses import replace

import pytest
from toy_house import CHAIR_AWAY, ToySimulator, stage_case

from evonav.agents.fail_then_update import FailThenUpdate
from evonav.agents.frontier_update import FrontierUpdate
from evonav.agents.stage_reset import StageReset
from evonav.decision.scripted import Scripted
from evonav.evaluation.protocol import EpisodeCase, ProtocolConfig
from evonav.evaluation.records import EndState
from evonav.evaluation.rollout import Episode
from evonav.sensors.ground_truth import GroundTruthPerception
from evonav.world.pose import Pose

START = Pose(1.0, 0.9, 3.0, 0.0)


def run(agent, case, protocol=None):
    episode = Episode(case, "a", agent, ToySimulator(), GroundTruthPerception(), protocol or ProtocolConfig(), 7)
    records = [outcome.record for outcome in episode.run()]
    assert all(record.is_scored for record in records), [record.error for record in records]
    return records


def case_of(*stages, start=START):
    return EpisodeCase("toy", "toy", start, stages)


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
