"""EvolvingNav's filter in the words of its rule: soft evidence, mass for the unknown, and nothing excluded for good."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scripted_model import scripted
from toy_episode import rounds_of, run
from toy_house import CHAIR_AWAY, stage_case

from evonav.agents.grid import CoarseFrame
from evonav.agents.rivals.evolving import (
    MIN_WEIGHT,
    Coverage,
    Evolving,
    EvolvingConfig,
    best_of,
    hidden_behind,
    p_present,
)
from evonav.evaluation.protocol import ProtocolConfig
from evonav.memory import OccupancyMap
from evonav.sensors.observation import MapFrame, VisibleOccupancy

CONFIG = EvolvingConfig()
SEEN = {1: (9.0, 1)}
PLACES = {2: 3.0, 3: 1.0}


def belief(coverage=None, seen=SEEN, places=PLACES, unknown_share=0.5):
    return (coverage or Coverage(CONFIG)).belief(seen, places, unknown_share)


def test_the_place_where_it_was_last_seen_keeps_most_and_loses_some_with_each_stage():
    new, old, older = (belief(seen={1: (9.0, stages)}).sites[1] for stages in (0, 1, 3))
    assert new == pytest.approx(0.9)
    assert old == pytest.approx(0.9 * 0.8)
    assert older == pytest.approx(0.9 * 0.8**3)


def test_of_two_namesakes_the_one_that_fits_the_description_has_the_belief():
    found = belief(seen={1: (5.0, 0), 4: (0.05, 0)})
    assert found.sites[1] / found.sites[4] == pytest.approx(100.0)
    assert found.sites[1] == pytest.approx(5.0 / 6.05)  # 1 is the share of one that was never seen
    alike = belief(seen={1: (5.0, 0), 4: (5.0, 0)})
    assert alike.sites[1] == alike.sites[4] == pytest.approx(5.0 / 11.0)


def test_an_object_is_believed_present_by_its_stages_and_its_looks():
    assert [p_present(stages, 1.0, 0.8) for stages in (0, 1, 2)] == pytest.approx([1.0, 0.8, 0.64])
    assert p_present(1, 0.1, 0.8) == pytest.approx(0.08 / 0.28)


def test_what_moved_may_be_at_any_site_or_at_an_unknown_place():
    found = belief()
    rest = 1.0 - found.sites[1]
    assert found.unknown == pytest.approx(0.5 * rest)
    assert found.sites[2] == pytest.approx(3 * found.sites[3])
    assert belief(places={}).unknown == pytest.approx(rest)
    assert belief(unknown_share=0.0).unknown == 0.0


def test_a_place_that_was_looked_at_and_found_empty_keeps_some_mass():
    coverage = Coverage(CONFIG)
    coverage.look(1, 1.0)
    assert coverage.weight(1) == pytest.approx(0.1)
    found = belief(coverage)
    assert 0.1 < found.sites[1] < belief().sites[1]
    assert found.unknown > belief().unknown
    assert found.sites[2] / found.sites[3] == pytest.approx(3.0)


def test_nothing_is_excluded_for_good():
    coverage = Coverage(CONFIG)
    for _ in range(30):
        coverage.fail(1)
    assert coverage.weight(1) == MIN_WEIGHT
    assert belief(coverage).sites[1] > 0.0
    coverage.find(1)
    assert belief(coverage).sites[1] == pytest.approx(belief().sites[1])
    only = belief(coverage, seen=SEEN, places={}, unknown_share=0.0)
    coverage.look(1, 1.0)
    assert coverage.chance(1, only.sites[1]) > 0.0  # inspected, and open while its belief is large


def test_only_surface_that_is_new_counts_and_only_above_a_twentieth():
    once, twice, little = Coverage(CONFIG), Coverage(CONFIG), Coverage(CONFIG)
    once.look(1, 0.5)
    twice.look(1, 0.5)
    twice.look(1, 0.5)
    assert twice.weight(1) == once.weight(1) == pytest.approx(1 - 0.9 * 0.5)
    twice.look(1, 0.54)
    assert twice.weight(1) == once.weight(1)
    twice.look(1, 0.6)
    assert twice.weight(1) == pytest.approx(once.weight(1) * (1 - 0.9 * 0.1))
    little.look(1, 0.05)
    assert little.weight(1) == 1.0


def test_an_inspected_site_is_closed_until_its_belief_is_large():
    coverage = Coverage(CONFIG)
    coverage.look(3, 0.8)
    found = belief(coverage)
    assert found.sites[3] < CONFIG.reopen
    assert coverage.chance(3, found.sites[3]) == 0.0
    assert coverage.chance(2, found.sites[2]) == pytest.approx(0.9 * found.sites[2])
    coverage.fail(1)
    coverage.fail(2)
    reopened = belief(coverage, unknown_share=0.0, places={2: 3.0, 3: 9.0})
    assert reopened.sites[3] > CONFIG.reopen
    assert coverage.chance(3, reopened.sites[3]) == pytest.approx(0.9 * 0.2 * reopened.sites[3])


@given(
    ratios=st.lists(st.tuples(st.floats(0.01, 50.0), st.integers(0, 4)), max_size=4),
    places=st.lists(st.floats(0.0, 5.0), max_size=5),
    unknown_share=st.floats(0.0, 1.0),
    looks=st.lists(st.tuples(st.integers(0, 8), st.floats(0.0, 1.0)), max_size=12),
)
def test_the_belief_is_a_distribution(ratios, places, unknown_share, looks):
    coverage = Coverage(CONFIG)
    for site, share in looks:
        coverage.look(site, share)
    seen = dict(enumerate(ratios))
    found = coverage.belief(seen, dict(enumerate(places, len(ratios))), unknown_share)
    assert all(p >= 0.0 for p in found.sites.values())
    assert sum(found.sites.values()) + found.unknown == pytest.approx(1.0)
    naive = {site: ratio * 0.8**stages * coverage.weight(site) for site, (ratio, stages) in enumerate(ratios)}
    for one, other in zip(list(naive)[1:], naive, strict=False):
        if found.sites[other] > 1e-9:
            assert found.sites[one] / found.sites[other] == pytest.approx(naive[one] / naive[other], rel=1e-6)


def test_the_largest_chance_a_metre_wins():
    assert best_of([0.6, 0.2], [9.0, 1.0], 1.0) == 1
    assert best_of([0.6, 0.2], [2.0, 1.0], 1.0) == 0
    assert best_of([0.2, 0.2], [1.0, 1.0], 1.0) == 0
    assert best_of([0.0], [1.0], 1.0) is None
    assert best_of([], [], 1.0) is None


def test_the_unknown_belongs_to_the_frontier_from_which_it_is_reached_first():
    frame = MapFrame(rows=40, cols=80, cell_m=0.1, corner_m=(0.0, 0.0))
    occupancy = OccupancyMap(frame)
    free = np.argwhere(np.ones((40, 60), bool)).astype(np.int32)
    free = np.ascontiguousarray(free[(free[:, 1] > 9) & (free[:, 1] < 60)])
    occupancy.integrate(VisibleOccupancy(free, np.empty((0, 2), np.int32)), (3.0, 2.0))
    frontiers = occupancy.update_frontiers((3.0, 2.0))
    coarse = CoarseFrame.over(frame)
    shares, unknown_share = hidden_behind(frontiers, occupancy.cells, coarse)
    assert len(shares) == len(frontiers) >= 1
    assert sum(shares) == pytest.approx(1.0)
    assert 0.1 < unknown_share < 0.7
    assert hidden_behind([], occupancy.cells, coarse) == ([], 0.0)


def test_an_entry_that_is_not_there_is_not_deleted_and_the_search_goes_on():
    model = scripted(verify=lambda question: "no")
    agent = Evolving(decision=model)
    _, rounds = rounds_of(agent, stage_case(1, "Chair|1"))
    asked = [question.entry.entry_id for question in model.questions if question.kind == "verify"]
    assert asked
    assert agent._navigator.objects.entry(agent._navigator.views.resolve(asked[0])) is not None
    assert agent._coverage.weight(agent._navigator.views.resolve(asked[0])) < 1.0
    assert rounds[-1][2].counters["rejected_entries"] == len(asked)


def test_it_stops_only_where_the_target_is_verified():
    agent = Evolving()
    records, rounds = rounds_of(
        agent,
        stage_case(1, "Chair|1"),
        stage_case(2, "GarbageCan|1"),
        stage_case(3, "Chair|1", moves=CHAIR_AWAY, mode="SALIENT_OBJECT"),
    )
    assert [record.state for record in records] == ["success"] * 3
    for stage in (1, 2, 3):
        last = [diagnostics for number, _, diagnostics, _ in rounds if number == stage][-1]
        assert last.details["reason"] == "verified"
        assert sum(last.details["p_sites"].values()) <= 1.001


def test_its_belief_is_told_and_sites_of_furniture_are_inspected():
    model = scripted(verify=lambda question: "no")
    agent = Evolving(decision=model)
    _, rounds = rounds_of(agent, stage_case(1, "Mug|1"))
    details = [diagnostics.details for _, _, diagnostics, _ in rounds]
    assert all(0.0 <= one["p_unknown"] <= 1.0 for one in details)
    assert all(0.0 < one.p_present <= 1.0 for one in agent.explain().entries())
    assert rounds[-1][2].counters["sites_inspected"] > 0


def test_an_object_that_contradicts_the_goal_is_believed_in_less_and_taken_when_time_is_short():
    model = scripted(verify=lambda question: "yes", identity=lambda question: "no")
    agent = Evolving(EvolvingConfig(reserve_rounds=5), decision=model)
    (record,) = run(agent, stage_case(1, "Chair|1"), protocol=ProtocolConfig(max_rounds=30))
    denied = [question.entry.entry_id for question in model.questions if question.kind == "identity"]
    assert denied
    assert all(agent._coverage.weight(agent._navigator.views.resolve(one)) < 1.0 for one in denied)
    assert record.num_rounds > 5
