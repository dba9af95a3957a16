"""Belief-Weighted Search in the words of its rule: what it believes, and what it does with that."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from evonav_studies.variants import BLIND, ORACLE_THETA
from scripted_model import scripted
from toy_episode import rounds_of, run
from toy_house import moved_table_stages, stage_case

from evonav.agents.grid import NO_GROUP, CoarseFrame
from evonav.agents.proactive.agent import Proactive
from evonav.agents.proactive.config import FITTED, ProactiveConfig
from evonav.agents.proactive.maps import SearchedCells, rooms_of, shown_from, walls_of
from evonav.agents.proactive.posterior import visible_range_m
from evonav.agents.proactive.presence import PresenceBelief, _Entry
from evonav.agents.proactive.search import Option, best_option
from evonav.decision.candidates import ObjectCandidate
from evonav.evaluation.protocol import ProtocolConfig
from evonav.memory.occupancy import BLOCKED, FREE
from evonav.sensors.observation import MapFrame

FRAME = MapFrame(rows=60, cols=100, cell_m=0.1, corner_m=(0.0, 0.0))


def two_rooms(door_cells):
    """Two rooms side by side, 6 x 5 m each, with a doorway in the wall between them."""
    cells = np.full((60, 100), FREE, np.uint8)
    cells[:, 49:51] = BLOCKED
    cells[30 : 30 + door_cells, 49:51] = FREE
    return cells


def test_rooms_are_cut_at_doorways_and_not_at_wide_openings():
    cut = rooms_of(two_rooms(door_cells=10), FRAME, [])
    assert set(np.unique(cut[:, :40])) == {0}
    assert set(np.unique(cut[:, 60:])) == {1}
    assert (cut[:30, 49:51] == NO_GROUP).all()  # a wall is in no room
    open_ = rooms_of(two_rooms(door_cells=30), FRAME, [])
    assert open_[10, 10] == open_[10, 90] != NO_GROUP


def test_furniture_does_not_divide_a_room_but_a_shelf_on_the_wall_is_none():
    cells = np.full((60, 100), FREE, np.uint8)
    cells[8:, 48:52] = BLOCKED  # all but a gap of 0.8 m
    table = ObjectCandidate(1, "DiningTable", (5.0, 0.4, 3.4), (0.4, 0.8, 5.2), 3)
    divided, whole = rooms_of(cells, FRAME, []), rooms_of(cells, FRAME, [table])
    on_wall = rooms_of(cells, FRAME, [replace(table, centre_m=(5.0, 1.4, 3.4))])
    assert divided[30, 10] != divided[30, 90]
    assert whole[30, 10] == whole[30, 90]
    assert (on_wall == divided).all()


def belief(rooms, evidence, **config):
    """A belief in entries of rooms, after a transition, with evidence for and against some: id -> sign."""
    presence = PresenceBelief(ProactiveConfig(**config))
    presence._entries = {entry_id: _Entry(0.99, 1, present=0.99) for entry_id in rooms}
    presence.begin_stage(2, rooms, frozenset(), NO_GROUP)
    for entry_id, sign in evidence.items():
        presence._entries[entry_id].evidence = 3.0 * sign
    presence.update()
    return presence


ROOMS = {1: 0, 2: 0, 3: 0, 4: 0, 5: 1, 6: 1}


def test_everything_is_doubted_at_a_transition_before_any_evidence():
    presence = belief(ROOMS, {})
    assert all(0.5 < presence.p_present(one) < 0.95 for one in ROOMS)
    assert belief(ROOMS, {}, expects_change=False).p_present(1) == pytest.approx(0.99)


def test_a_room_with_gone_objects_is_doubted_as_a_whole_and_trust_in_the_others_returns():
    before, after = belief(ROOMS, {}), belief(ROOMS, {1: -1, 2: -1})
    assert after.changed[0] > 0.95
    assert after.p_present(3) < before.p_present(3) - 0.2
    assert after.p_present(5) > before.p_present(5) + 0.05
    assert belief(ROOMS, {1: -1, 2: -1}, uses_rooms=False).p_present(3) == pytest.approx(before.p_present(3))
    kept = belief(ROOMS, {1: -1, 2: -1}, explains_away=False)
    assert kept.p_present(5) == pytest.approx(before.p_present(5))


def test_objects_that_are_where_they_were_raise_the_doubt_about_other_rooms():
    before, after = belief(ROOMS, {}), belief(ROOMS, {1: 1, 2: 1, 3: 1})
    assert after.changed[0] < 0.5 * before.changed[0]
    assert after.p_present(4) > before.p_present(4)
    assert after.p_present(5) < before.p_present(5)


def test_the_room_of_the_agent_does_not_change():
    presence = PresenceBelief(ProactiveConfig())
    presence._entries = {one: _Entry(0.99, 1, present=0.99) for one in ROOMS}
    presence.begin_stage(2, ROOMS, frozenset({0}), here=1)
    assert presence.p_present(5) == pytest.approx(0.99)
    assert presence.p_present(1) < 0.9


def test_priors_are_probabilities():
    for prior in (FITTED, BLIND, ORACLE_THETA):
        assert sum(prior.modes) == pytest.approx(1.0)
        assert 0.0 < prior.mean_moved < 1.0
    assert not BLIND.knows_rooms


def test_the_rule_is_gain_a_metre_and_a_choice_is_kept_unless_another_is_clearly_better():
    near, far = (
        Option("place", 1, (1.0, 0.0), (1.0, 0.0), 0.2, 1.0),
        Option("place", 2, (9.0, 0.0), (9.0, 0.0), 0.9, 8.0),
    )
    config = ProactiveConfig()
    assert best_option([near, far], None, [], config) is near or far.gain / 9.0 > near.gain / 2.0
    better = replace(near, gain=0.21)
    assert best_option([better, far], None, [], config) is better
    assert best_option([replace(near, gain=0.19), better], near, [], config) is better  # the same place
    other = replace(better, key=3, position_m=(5.0, 0.0))
    assert best_option([near, other], near, [], config) is near
    assert best_option([near, other], near, [], ProactiveConfig(keeps_choice=False)) is other
    assert best_option([near, replace(other, gain=0.3)], near, [], config).key == 3


def test_a_place_that_was_left_before_the_agent_was_there_counts_half_each_time():
    config = ProactiveConfig()
    one, other = (Option("place", k, (5.0 * k, 0.0), (0.0, 0.0), gain, 3.0) for k, gain in ((1, 1.0), (2, 0.4)))
    assert best_option([one, other], None, [one], config) is one
    assert best_option([one, other], None, [one, one], config) is other
    assert best_option([one, other], None, [replace(one, kind="frontier")] * 2, config) is one


def test_a_place_shows_what_no_wall_hides():
    coarse = CoarseFrame.over(FRAME)
    cells = two_rooms(door_cells=10)
    rows, cols = shown_from((4.0, 1.0), coarse, walls_of(cells, FRAME, []), 2.5)
    shown_m = [coarse.frame.centre_m(row, col) for row, col in zip(rows, cols, strict=True)]
    assert all(math.dist(one, (4.0, 1.0)) <= 2.5 + 1e-9 for one in shown_m)
    assert max(x_m for x_m, _ in shown_m) < 5.3
    assert sum(math.dist(one, (3.0, 1.0)) < 0.9 for one in shown_m) > 50
    through = shown_from((4.0, 3.5), coarse, walls_of(cells, FRAME, []), 2.5)
    assert max(coarse.frame.centre_m(0, col)[0] for col in through[1]) > 6.0  # through the doorway
    shelf = ObjectCandidate(1, "ShelvingUnit", (5.0, 0.9, 1.0), (0.2, 1.8, 2.0), 3)
    over = shown_from((4.0, 1.0), coarse, walls_of(cells, FRAME, [shelf]), 2.5)
    assert max(coarse.frame.centre_m(0, col)[0] for col in over[1]) > 6.0  # furniture is no wall


def test_what_was_searched_in_vain_counts_less():
    searched = SearchedCells(FRAME, ProactiveConfig())
    rows, cols = shown_from((4.0, 1.0), searched.coarse, walls_of(two_rooms(10), FRAME, []), 2.5)
    searched.give_up(rows, cols, 0.3)
    assert searched.missed(0.5)[rows, cols] == pytest.approx(0.3)
    others = np.ones(searched.missed(9.0).shape, np.bool_)
    others[rows, cols] = False
    assert (searched.ever_missed(9.0)[others] == 1.0).all()


def test_small_things_are_missed_from_afar(monkeypatch):
    monkeypatch.setattr("evonav.agents.proactive.maps.seen_cells", lambda *_: (np.array([4]), np.array([7])))
    searched = SearchedCells(FRAME, ProactiveConfig())
    edge_m = searched.coarse.frame.cell_m
    searched.see(SimpleNamespace(pose=SimpleNamespace(x_m=7.5 * edge_m + 2.2, z_m=4.5 * edge_m)))
    assert searched.missed(visible_range_m("chair"))[4, 7] == pytest.approx(0.1)
    assert searched.missed(visible_range_m("cell phone"))[4, 7] == 1.0
    assert visible_range_m("pencil") < visible_range_m("mug") < visible_range_m("toaster") < visible_range_m("bed")
    assert visible_range_m("flying carpet") == math.inf


def test_looks_from_one_side_count_once_a_stage(monkeypatch):
    seen = (np.array([4]), np.array([7]))
    monkeypatch.setattr("evonav.agents.proactive.maps.seen_cells", lambda *_: seen)

    searched = SearchedCells(FRAME, ProactiveConfig())
    edge_m = searched.coarse.frame.cell_m
    north, south = (
        SimpleNamespace(pose=SimpleNamespace(x_m=7.5 * edge_m, z_m=4.5 * edge_m + one)) for one in (1.0, -1.0)
    )
    for view, missed in ((north, 0.1), (north, 0.1), (south, 0.01)):
        searched.see(view)
        assert searched.missed(9.0)[4, 7] == pytest.approx(missed)
    searched.begin_stage()
    assert searched.missed(9.0)[4, 7] == 1.0
    assert searched.ever_missed(9.0)[4, 7] == pytest.approx(0.01)
    assert searched.missed(9.0)[0, 0] == 1.0


def test_it_stops_near_a_detected_entry_and_asks_once_about_its_identity():
    records, told = rounds_of(Proactive(), *moved_table_stages())
    assert [record.state.value for record in records] == ["success"] * 3
    for record in records:
        assert record.stop_reason == "identified"
        chosen = record.trace[-1].chosen_entry
        end = record.trace[-1].pose
        assert math.dist((end.x_m, end.z_m), chosen.centre_m[::2]) < 2.0
    assert told[-1][2].counters["identity_checks"] == 3


def test_the_moved_table_is_taken_at_its_new_place_and_the_old_entry_stays():
    _, told = rounds_of(Proactive(), *moved_table_stages())
    last = [(belief, said) for stage, belief, said, _ in told if stage == 3]
    shares = [said.details["p_entries"] for _, said in last]
    old = next(iter(shares[0]))
    assert shares[-1][old] < shares[-1][str(last[-1][1].chosen_entry.entry_id)]
    assert int(old) in {entry.entry_id for entry in last[-1][0].entries}
    assert last[-1][1].chosen_entry.entry_id != int(old)


@pytest.mark.parametrize("is_empty", [True, False])
def test_at_a_place_without_a_detection_it_stops_unless_the_place_is_seen_empty(is_empty):
    """What stands at the place may be too small or too hidden to be detected: then the place itself must do."""
    agent, stages = Proactive(), []
    act, begin_stage = agent.act, agent.begin_stage

    def undetected(view):
        depth_m = np.full_like(view.depth_m, 9.0 if is_empty else 0.3)  # nothing at all, or a door before the camera
        return replace(view, depth_m=depth_m, detections=view.detections.taken([]))

    def act_without_detections(observation):
        if stages[-1] == 2:
            observation = replace(observation, views=tuple(map(undetected, observation.views)))
        return act(observation)

    agent.begin_stage = lambda goal: stages.append(goal.stage) or begin_stage(goal)
    agent.act = act_without_detections
    cases = (stage_case(1, "Bed|1"), stage_case(2, "Fridge|1"))
    first, second = run(agent, *cases, protocol=ProtocolConfig(max_rounds=20))
    assert first.stop_reason == "identified"
    assert (second.stop_reason == "at its place") != is_empty


def test_without_see_through_it_has_to_walk_to_the_empty_place():
    seeing = run(Proactive(), *moved_table_stages())[2]
    blind = run(Proactive(ProactiveConfig(sees_through=False)), *moved_table_stages())[2]
    assert seeing.path_length_m <= blind.path_length_m


def test_what_contradicts_the_goal_is_left_for_others_and_taken_when_nothing_else_is_left():
    agent = Proactive(decision=scripted(identity="no"))
    (record,) = run(agent, stage_case(1, "Fridge|1"), protocol=ProtocolConfig(max_rounds=30))
    counters = record.trace[-1].counters
    assert counters["identities_denied"] >= 1
    assert record.stop_reason == "identified"
    assert record.num_rounds > run(Proactive(), stage_case(1, "Fridge|1"))[0].num_rounds


def test_without_the_check_nothing_is_asked():
    agent = Proactive(ProactiveConfig(checks_identity=False), scripted(identity="no"))
    (record,) = run(agent, stage_case(1, "Fridge|1"))
    assert record.trace[-1].counters["identity_checks"] == 0
    assert record.state.value == "success"


def test_it_goes_back_to_the_best_entry_before_the_rounds_run_out():
    """Nobody accepts the fridge, and there is a whole home to search: but no round is left for it at the end."""
    agent = Proactive(decision=scripted(identity="no"))
    protocol = ProtocolConfig(max_rounds=14)
    (record,) = run(agent, stage_case(1, "Fridge|1"), protocol=protocol)
    assert record.has_stopped
    assert record.state.value == "success"
