"""The probabilities that agents state: what the border refuses, what records hold, and how they are scored."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from toy_episode import run
from toy_house import moved_table_stages, stage_case

from evonav.agents.agent import EntryBelief, PlaceBelief
from evonav.agents.explanation import RoundDiagnostics
from evonav.agents.frontier_update.agent import FrontierUpdate
from evonav.agents.hosting import wire
from evonav.agents.proactive.agent import Proactive
from evonav.errors import InvalidArgumentError
from evonav.evaluation.metrics.belief import MIN_P, belief_summary, calibration, place_score
from evonav.evaluation.records.schema import StageRecord

PLACES = PlaceBelief(0.5, ((0.25, 0.25), (0.75, 0.25), (5.25, 0.25)), (0.5, 0.2, 0.2))


def refused(**values):
    """Return why a belief is refused."""
    with pytest.raises(InvalidArgumentError) as found:
        wire.DIAGNOSTICS.read(wire.DIAGNOSTICS.write(RoundDiagnostics(places=replace(PLACES, **values))))
    return str(found.value)


def test_a_belief_is_read_as_written():
    said = RoundDiagnostics(places=PLACES)
    assert wire.DIAGNOSTICS.read(wire.DIAGNOSTICS.write(said)) == said
    entry = EntryBelief(1, "Mug", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 1, 0.25)
    assert wire.ENTRIES.read(wire.ENTRIES.write([entry])) == [entry]


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({"probabilities": (0.5, 1.2, 0.2)}, "places.probabilities.1 = 1.2: must be 0 to 1"),
        ({"probabilities": (0.5, -0.1, 0.2)}, "places.probabilities.1 = -0.1: must be 0 to 1"),
        ({"probabilities": (0.5, 0.5, 0.5)}, "places.probabilities: their sum is 1.5, must be at most 1"),
        ({"probabilities": (0.5, math.nan, 0.2)}, "places.probabilities.1 = nan: Input should be a finite number"),
        ({"probabilities": (0.5,)}, "places.probabilities: 1 values, expected one for each of the 3 centres_m"),
        ({"cell_m": 0.0}, "places.cell_m = 0.0: must be above 0"),
        ({"centres_m": ((0.0, 2e6), (0.0, 0.0), (0.0, 0.0))}, "places.centres_m.0.1 = 2000000.0: Input should be less"),
        ({"centres_m": ((0.0, 0.0),) * 20_001, "probabilities": (0.0,) * 20_001}, "20001 squares, must be at most"),
    ],
)
def test_an_impossible_belief_is_refused_by_field_and_value(values, why):
    assert why in refused(**values)


@pytest.mark.parametrize("p", [-0.1, 1.1, math.nan])
def test_an_impossible_presence_is_refused(p):
    entry = EntryBelief(1, "Mug", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 1, p)
    with pytest.raises(InvalidArgumentError, match=r"p_present|must be 0 to 1"):
        wire.ENTRIES.read(wire.ENTRIES.write([entry]))


def test_the_place_of_the_target_is_scored():
    score = place_score(PLACES, (0.8, 0.3), 2.0)
    assert score.p_near == pytest.approx(0.7)
    assert score.rank == 2  # one square is likelier; the other one is just as likely
    assert score.brier == pytest.approx(0.25 + 0.04 + 0.04 + 0.01 - 2 * 0.2 + 1.0)
    assert (score.top, score.is_top_right) == (pytest.approx(0.7), True)
    elsewhere = place_score(PLACES, (9.0, 9.0), 2.0)
    assert (elsewhere.p_near, elsewhere.rank, elsewhere.is_top_right) == (0.0, 4, False)
    assert elsewhere.brier == pytest.approx(0.25 + 0.04 + 0.04 + 0.01 - 2 * 0.1 + 1.0)
    sure = place_score(PlaceBelief(cell_m=0.5, centres_m=((0.25, 0.25),), probabilities=(1.0,)), (0.3, 0.3), 2.0)
    assert (sure.p_near, sure.brier, sure.rank) == (1.0, 0.0, 1)


@given(
    st.dictionaries(
        st.tuples(st.integers(-9, 9), st.integers(-9, 9)), st.sampled_from([0.0, 0.01, 0.02, 1 / 30]), min_size=1
    ),
    st.sampled_from([0.5, 1.0, 2.0]),
    st.floats(-20.0, 20.0),
)
def test_the_largest_mass_is_that_of_a_plain_search(cells, radius_m, corner_m):
    """Squares at exactly the radius, and ties, count as they do with exact sums one by one."""
    centres_m = tuple((corner_m + 0.5 * x, 0.5 * z - corner_m) for x, z in cells)
    probabilities = tuple(cells.values())
    plain = [
        (
            math.fsum(
                p
                for other_m, p in zip(centres_m, probabilities, strict=True)
                if math.dist(other_m, centre_m) < radius_m
            ),
            centre_m,
        )
        for centre_m, own in zip(centres_m, probabilities, strict=True)
        if own > 0.0
    ]
    top, middle_m = max(plain, default=(0.0, (1e9, 1e9)))
    target_m = (corner_m + 0.3, 0.7 - corner_m)
    score = place_score(PlaceBelief(cell_m=0.5, centres_m=centres_m, probabilities=probabilities), target_m, radius_m)
    assert score.top == min(top, 1.0)
    assert score.is_top_right == (math.dist(middle_m, target_m) < radius_m)


def test_calibration_compares_with_what_came_true():
    found = calibration([(0.8, True), (0.8, True), (0.8, False), (0.1, False)])
    assert found.n == 4
    assert found.nll == pytest.approx(-(2 * math.log(0.8) + math.log(0.2) + math.log(0.9)) / 4)
    assert found.brier == pytest.approx((2 * 0.04 + 0.64 + 0.01) / 4)
    assert found.ece == pytest.approx((abs(2.4 - 2) + 0.1) / 4)
    assert calibration([]) is None
    assert calibration([(0.0, True)]).nll == pytest.approx(-math.log(MIN_P))


@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.booleans()), min_size=1, max_size=30))
def test_calibration_is_within_its_range(pairs):
    found = calibration(pairs)
    assert 0.0 <= found.nll <= -math.log(MIN_P) + 1e-9
    assert 0.0 <= found.brier <= 1.0
    assert 0.0 <= found.ece <= 1.0 + 1e-9


def test_a_run_records_what_the_agent_believed_and_others_records_stay():
    records = run(Proactive(), *moved_table_stages())
    first, *later = [record.belief_at_start for record in records]
    assert first.presence == ()
    assert all(0.0 <= p <= 1.0 for belief in later for p, _ in belief.presence)
    assert {is_right for _, is_right in later[-1].presence} == {True, False}  # the table has moved
    for belief in (first, *later):
        assert 0.95 < math.fsum(belief.places.probabilities) <= 1.0 + 1e-6
    summary = belief_summary([(record.target.position_m, record.belief_at_start) for record in records], 2.0)
    assert (summary.num_placed, summary.presence.n) == (3, sum(len(belief.presence) for belief in later))
    again = StageRecord.model_validate_json(records[-1].model_dump_json())
    assert again == records[-1]
    (silent,) = run(FrontierUpdate(), stage_case(1, "Bed|1"))
    assert silent.belief_at_start is None
    assert StageRecord.model_validate_json(silent.model_dump_json()) == silent
    assert belief_summary([], 2.0).num_placed == 0
