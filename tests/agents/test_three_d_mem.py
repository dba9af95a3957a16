"""3D-Mem on the toy house, in the words of its specification."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import toy_episode
from scripted_model import Scripted
from toy_episode import START, noted
from toy_house import CHAIR_AWAY, OBJECTS, stage_case

from evonav.agents.agent import NavigateTo
from evonav.agents.explorer import AS_THREE_D_MEM_PLUS
from evonav.agents.navigator import NavigatorConfig
from evonav.agents.three_d_mem.agent import NO_ANSWER, NOTHING_LEFT, ThreeDMem, ThreeDMemConfig
from evonav.agents.three_d_mem.questions import PrefilterQuestion, SnapshotQuestion
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState
from evonav.memory import ObjectMap
from evonav.memory.occupancy import BLOCKED, FREE, UNKNOWN


def run(agent, *stages, start=START, max_rounds=50):
    protocol = ProtocolConfig(max_rounds=max_rounds)
    return toy_episode.run(agent, *stages, start=start, protocol=protocol, size_px=120)


def scripted(choose, prefilter=lambda question: "\n".join(question.class_names)):
    return Scripted(lambda q: prefilter(q) if isinstance(q, PrefilterQuestion) else choose(q))


def object_if_any(question):
    """The farthest one."""
    objects = [choice for choice in question.choices() if choice.snapshot is not None]
    if not objects:
        return "Frontier 0"
    here = question.position_m
    return question.answer_text(
        max(objects, key=lambda c: math.dist(question.snapshots[c.snapshot].objects[c.index].ground_m, here))
    )


def ground(centre_m):
    return np.array([centre_m[0], centre_m[2]])


@pytest.fixture(scope="module")
def moved():
    """The chair is found, then the bed; then the chair has gone to the bedroom, and the agent goes there afterwards."""
    agent = ThreeDMem()
    rounds = noted(agent)
    records = run(
        agent,
        stage_case(1, "Chair|1"),
        stage_case(2, "Bed|1"),
        stage_case(3, "Chair|1", moves=CHAIR_AWAY, mode="SALIENT_OBJECT"),
        stage_case(4, "GarbageCan|1", moves=CHAIR_AWAY, before=CHAIR_AWAY),
    )
    return rounds, records


def test_static_goals_are_found(moved):
    _, records = moved
    assert [record.state for record in records[:2]] == [EndState.SUCCESS] * 2
    assert all(record.stop_reason == "arrived" for record in records)


def test_it_walks_to_a_stale_entry_and_stops_there(moved):
    third = moved[1][2]
    assert third.state is EndState.FAILURE
    last = third.trace[-1].chosen_entry
    assert (last.label, last.is_stale) == ("Chair", True)
    assert all(entry.choice == third.trace[0].choice for entry in third.trace)


def test_the_entry_stays_after_it_was_not_there(moved):
    chosen = moved[1][2].trace[-1].chosen_entry
    stale = [entry for entry in moved[1][3].entries if entry.is_stale]
    assert [(entry.label, entry.entry_id) for entry in stale] == [("Chair", chosen.entry_id)]


def test_a_moved_object_becomes_another_entry(moved):
    """Detections and entries are matched by label and place: simulator ids would have moved the old entry."""
    chairs = [entry for entry in moved[0][-1].belief.entries if entry.label == "Chair"]
    places = [ground(OBJECTS["Chair|1"][1]), ground(CHAIR_AWAY["Chair|1"])]
    assert len(chairs) == 2
    for chair, place in zip(sorted(chairs, key=lambda entry: entry.entry_id), places, strict=True):
        assert np.linalg.norm(ground(chair.centre_m) - place) < 0.4


def test_seven_views_open_a_stage_and_three_follow(moved):
    rounds, records = moved
    # A stage's last call may be a stop, which still has its views.
    counts = iter(len(one.observation.views) for one in rounds)
    for record in records:
        assert [next(counts) for _ in record.trace] == [7] + [3] * (len(record.trace) - 1)


@pytest.fixture(scope="module")
def table_moved():
    """The table moves, with the mug on it, while the agent is in the other room."""
    away = {"DiningTable|1": (2.9, 0.4, 3.6), "Mug|1": (2.9, 0.87, 3.6)}
    agent = ThreeDMem()
    rounds = noted(agent)
    records = run(
        agent,
        stage_case(1, "GarbageCan|1"),
        stage_case(2, "Fridge|1", moves=away, mode="SALIENT_OBJECT"),
        stage_case(3, "GarbageCan|1", moves=away, before=away),
    )
    return [one.belief for one in rounds], records


def test_the_last_observation_wins_and_the_map_is_never_cleared(table_moved):
    """Where the table stood becomes free, where it stands blocked, and no cell is forgotten."""
    beliefs, records = table_moved
    before, after = beliefs[len(records[0].trace) - 1].cells, beliefs[-1].cells
    # Its edges grown by the agent's radius, up to the chair; [row, col].
    old, new = np.s_[6:16, 12:29], np.s_[30:43, 21:38]
    was_blocked = before[old] == BLOCKED
    assert was_blocked.sum() > 10
    assert (after[old][was_blocked] == FREE).all()
    assert (before[new] == FREE).all()
    assert (after[new] == BLOCKED).sum() > 10
    for one, other in pairwise(beliefs):
        assert not np.any((one.cells != UNKNOWN) & (other.cells == UNKNOWN))
        assert not np.any(one.explored & ~other.explored)
    assert all(record.trace[-1].counters["conflicts"] == 0 for record in records)
    assert all(record.trace[-1].counters["cells_cleared"] == 0 for record in records)


def test_an_object_is_kept_until_arrival_without_another_question():
    model = scripted(object_if_any)
    agent = ThreeDMem(decision=model)
    agent.sensors = replace(agent.sensors, max_travel_m=0.4)
    (record,) = run(agent, stage_case(1, "Mug|1"))
    choices = [entry.choice for entry in record.trace]
    assert len(choices) > 2
    assert len(set(choices)) == 1
    assert choices[0].startswith("object")
    assert record.stop_reason == "arrived"
    assert [type(question) for question in model.questions] == [PrefilterQuestion, SnapshotQuestion]


def test_a_frontier_is_chosen_anew_in_every_round():
    model = scripted(lambda question: f"Frontier {len(question.frontiers) - 1}")
    (record,) = run(ThreeDMem(decision=model), stage_case(1, "Mug|1"), max_rounds=6)
    assert all(entry.choice.startswith("frontier") for entry in record.trace)
    assert len([q for q in model.questions if isinstance(q, SnapshotQuestion)]) == len(record.trace) == 6


def test_the_agent_stands_an_observation_distance_off_and_faces_the_object():
    agent = ThreeDMem(decision=scripted(object_if_any))
    rounds = noted(agent)
    (record,) = run(agent, stage_case(1, "Mug|1"))
    last = [one for one in rounds if isinstance(one.action, NavigateTo)][-1]
    entry_id = int(record.trace[-1].choice.removeprefix("object "))
    (centre,) = [ground(entry.centre_m) for entry in last.belief.entries if entry.entry_id == entry_id]
    assert last.action.face_m == pytest.approx(tuple(centre), abs=0.25)
    assert math.dist(last.action.position_m, centre) == pytest.approx(1.5, abs=0.3)


def test_only_what_the_prefilter_kept_is_shown():
    kept = ("Chair", "DiningTable")
    model = scripted(
        lambda question: f"frontier {len(question.frontiers) - 1}\nbecause",
        lambda question: "\n".join(("Unicorn", *(name.upper() for name in kept), *question.class_names)),
    )
    config = ThreeDMemConfig(max_classes=2)
    agent = ThreeDMem(config, model)
    (record,) = run(agent, stage_case(1, "Mug|1"), start=replace(START, x_m=1.0, z_m=2.0), max_rounds=8)
    shown = [question for question in model.questions if isinstance(question, SnapshotQuestion)]
    labels = {candidate.label for question in shown for one in question.snapshots for candidate in one.objects}
    assert labels == set(kept)
    assert {name for entry in record.trace for name in entry.details["prefilter"]} >= set(kept)
    assert all(len(entry.details["prefilter"]) <= 2 for entry in record.trace)
    # The memory holds more than is shown.
    assert {entry.label for entry in agent.explain().entries()} - set(kept)


def test_without_an_answer_to_the_prefilter_only_frontiers_are_left():
    model = scripted(lambda question: "Frontier 0", lambda question: "Unicorn")
    (record,) = run(ThreeDMem(decision=model), stage_case(1, "Mug|1"), max_rounds=3)
    shown = [question for question in model.questions if isinstance(question, SnapshotQuestion)]
    assert len(shown) == 3
    assert all(not question.snapshots for question in shown)
    assert record.trace[-1].counters["failed_decisions"] >= 1


def test_three_invalid_answers_abort_the_stage_in_place():
    model = scripted(lambda question: "Snapshot 99, Object 0")
    near = replace(START, x_m=0.6, z_m=3.5)
    first, second = run(ThreeDMem(decision=model), stage_case(1, "Fridge|1"), stage_case(2, "Bed|1"), start=near)
    assert (first.stop_reason, first.num_rounds) == (NO_ANSWER, 1)
    assert first.trace[0].counters["invalid_answers"] == 3
    assert first.trace[0].counters["aborts_no_answer"] == 1
    assert second.trace[0].counters["aborts_no_answer"] == 2
    # Scored by distance, as any end.
    assert (first.state, second.state) == (EndState.SUCCESS, EndState.FAILURE)


def test_with_nothing_left_to_choose_the_stage_is_aborted_and_counted_apart():
    model = scripted(lambda question: "Frontier 0", lambda question: "none")
    (record,) = run(ThreeDMem(decision=model), stage_case(1, "Mug|1"), max_rounds=80)
    assert record.stop_reason == NOTHING_LEFT
    counters = record.trace[-1].counters
    assert counters["aborts_nothing_left"] == 1
    assert counters.get("aborts_no_answer", 0) == 0
    assert record.trace[-1].num_frontiers == 0


def test_memory_lasts_over_stages(table_moved):
    _, records = table_moved
    assert records[2].state is EndState.SUCCESS
    assert records[2].trace[0].choice == records[0].trace[-1].choice
    assert records[2].trace[0].details["num_snapshots_before"] == records[1].trace[-1].details["num_snapshots"]


@pytest.fixture(scope="module")
def all_shown():
    """Frontiers alone are chosen, all classes are kept, and images are asked for; the chair moves after a stage."""
    model = scripted(lambda question: f"Frontier {len(question.frontiers) - 1}")
    model.needs = frozenset({"images"})
    navigator = NavigatorConfig(explorer=AS_THREE_D_MEM_PLUS)  # does not run out of frontiers
    agent = ThreeDMem(ThreeDMemConfig(navigator=navigator, max_classes=100), model)
    stages = (stage_case(1, "Chair|1"), stage_case(2, "Chair|1", moves=CHAIR_AWAY, mode="SALIENT_OBJECT"))
    rounds = noted(agent)
    run(agent, *stages, max_rounds=15)
    asked = [(one.belief.entries, query.question) for one in rounds for query in one.said.questions]
    return [({e.entry_id for e in entries}, q) for entries, q in asked if isinstance(q, SnapshotQuestion)]


def test_each_entry_is_in_one_snapshot_that_shows_it(all_shown):
    assert len(all_shown) == 30
    for entry_ids, question in all_shown:
        shown = [candidate for snapshot in question.snapshots for candidate in snapshot.objects]
        assert sorted(candidate.entry_id for candidate in shown) == sorted(entry_ids)
        assert len({snapshot.view_id for snapshot in question.snapshots}) == len(question.snapshots)
        assert all(candidate.crop is not None for candidate in shown)  # cut out of the snapshot's own view


def test_a_co_visible_pair_shares_a_snapshot(all_shown):
    entry_ids, question = all_shown[-1]
    shared = [{candidate.label for candidate in snapshot.objects} for snapshot in question.snapshots]
    assert any({"DiningTable", "Mug"} <= labels for labels in shared)
    assert len(question.snapshots) < len(entry_ids)


def test_an_object_in_unmapped_surroundings_is_gone_to_by_the_planner(monkeypatch):
    agent = ThreeDMem(decision=scripted(object_if_any))
    monkeypatch.setattr("evonav.agents.navigator.Navigator.observation_point", lambda self, centre_m: None)
    (record,) = run(agent, stage_case(1, "Mug|1"))
    chosen = record.trace[-1].chosen_entry
    assert record.trace[-1].counters["unmapped_choices"] == 1
    assert record.stop_reason == "arrived"
    end = record.trace[-1].path_m[-1]
    assert math.dist(end, (chosen.centre_m[0], chosen.centre_m[2])) < 1.0


def test_a_clean_up_that_drops_the_chosen_entry_does_not_end_the_commitment(monkeypatch):
    agent = ThreeDMem(decision=scripted(object_if_any))
    agent.sensors = replace(agent.sensors, max_travel_m=0.4)
    update = ObjectMap.update

    def dropping(self, view):
        found = update(self, view)
        kind, _, entry_id = agent.explain().choice.partition(" ")
        if kind != "object" or not self.remove(int(entry_id)):
            return found
        return replace(found, removed=(*found.removed, int(entry_id)))

    monkeypatch.setattr(ObjectMap, "update", dropping)
    (record,) = run(agent, stage_case(1, "Mug|1"))
    choices = [entry.choice for entry in record.trace]
    assert len(choices) > 2
    assert len(set(choices)) == 1
    assert record.trace[-1].chosen_entry is None
    assert record.stop_reason == "arrived"
