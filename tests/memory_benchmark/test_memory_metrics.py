"""The functions of the metrics on cases with known answers, and against plain twins."""

import math

import numpy as np
import pytest
from hand_made import SIZE_M, body
from hypothesis import given
from hypothesis import strategies as st

from evonav.evaluation.episode.staleness import matched_object
from evonav.memory_benchmark.metrics.costs import (
    Sample,
    byte_note,
    growth_per_minute,
    slope_per_100_entries,
    slope_per_1000_frames,
    thinned,
)
from evonav.memory_benchmark.metrics.counts import (
    BeliefScore,
    BeliefSnapshot,
    ChangeCounts,
    QueryCounts,
    calibration_error,
    change_counts,
)
from evonav.memory_benchmark.metrics.matching import NONE, BodyBoxes
from evonav.memory_benchmark.metrics.spells import half_life, kaplan_meier
from evonav.memory_benchmark.protocol import FoundPlace
from evonav.world.simulator import SceneObject

COORDINATE = st.integers(0, 12).map(lambda step: step * 0.1 + 0.013)
POINT = st.tuples(COORDINATE, COORDINATE, COORDINATE)
LABEL = st.sampled_from(["Mug", "Plate", "Doorway"])
BODY = st.builds(lambda label, centre_m: (label, centre_m), LABEL, POINT)


@given(st.lists(BODY, max_size=8), st.lists(BODY, max_size=8))
def test_match_is_that_of_the_evaluation(bodies: list, entries: list) -> None:
    objects = [SceneObject(str(i), label, "object", centre_m, SIZE_M) for i, (label, centre_m) in enumerate(bodies)]
    boxes = BodyBoxes(objects)
    by_label = {label: [one for one in objects if one.category == label] for label in ("Mug", "Plate")}
    found, is_covered = boxes.match([label for label, _ in entries], np.array([c for _, c in entries]).reshape(-1, 3))
    for body_index, one in enumerate(boxes.bodies):
        near = [matched_object(label, centre_m, {one.category: [one]}) for label, centre_m in entries]
        assert is_covered[body_index] == any(match is one for match in near)
    for (label, centre_m), match in zip(entries, found.tolist(), strict=True):
        expected = matched_object(label, centre_m, by_label)
        actual = None if match == NONE else boxes.bodies[match]
        if actual is not expected:  # two at the same distance, of which rounding chooses
            assert actual is not None
            assert expected is not None
            assert math.dist(actual.centre_m, centre_m) == pytest.approx(math.dist(expected.centre_m, centre_m))


def test_kaplan_meier_with_censoring() -> None:
    # The example of every textbook: 6 patients, ends at 1, 3, 3, 6 and two that were lost at 2 and 6.
    durations = np.array([1.0, 2.0, 3.0, 3.0, 6.0, 6.0])
    ends, shares = kaplan_meier(durations, np.array([True, False, True, True, True, False]))
    assert ends.tolist() == [1.0, 3.0, 6.0]
    assert shares.tolist() == pytest.approx([5 / 6, 5 / 6 * 2 / 4, 5 / 6 * 2 / 4 * 1 / 2])
    assert float(half_life(ends, shares)) == 3.0


@pytest.mark.parametrize(("durations", "is_over"), [([1.0, 5.0, 5.0], [True, False, False]), ([5.0], [False])])
def test_half_life_is_infinite_where_half_of_it_stays(durations: list[float], is_over: list[bool]) -> None:
    assert math.isinf(float(half_life(*kaplan_meier(np.array(durations), np.array(is_over)))))


@given(st.lists(st.tuples(st.integers(0, 9), st.booleans()), min_size=1, max_size=20))
def test_kaplan_meier_against_a_loop(spells: list[tuple[int, bool]]) -> None:
    durations = np.array([float(duration) for duration, _ in spells])
    _, shares = kaplan_meier(durations, np.array([over for _, over in spells]))
    share, expected = 1.0, []
    for time in sorted({duration for duration, over in spells if over}):
        at_risk = sum(duration >= time for duration, _ in spells)
        share *= 1.0 - sum(duration == time and over for duration, over in spells) / at_risk
        expected.append(share)
    assert shares.tolist() == pytest.approx(expected)


def test_slopes_survive_outliers() -> None:
    # 1 ms and 0.5 ms more for every 100 entries; a tenth of the frames take ten times as long.
    samples = [Sample(i, 2.0 * i, (10.0 if i % 10 == 0 else 1.0) * (1.0 + 0.01 * i)) for i in range(200)]
    assert slope_per_100_entries(samples) == pytest.approx(0.5, rel=0.1)
    assert slope_per_100_entries([Sample(i, 10.0, 1.0) for i in range(200)]) is None


def test_slope_over_frames_is_taken_at_constant_size() -> None:
    leak = [Sample(i, 50.0, 1.0 + 0.002 * i) for i in range(200)]
    assert slope_per_1000_frames(leak) == pytest.approx(2.0)
    growth = [Sample(i, float(i), 1.0 + 0.01 * i) for i in range(200)]  # it costs more since it holds more
    assert slope_per_1000_frames(growth) is None


def test_thinned_takes_medians() -> None:
    frames = np.arange(1000)
    samples = thinned(np.column_stack([frames, np.full(1000, 7), np.where(frames % 5 == 0, 100.0, 1.0)]), 100)
    assert len(samples) == 100
    assert samples[0] == Sample(4.5, 7.0, 1.0)


def test_leak_of_a_megabyte_a_minute() -> None:
    minutes = np.arange(1200) / 120.0
    noise = np.random.default_rng(0).normal(0.0, 0.05, 1200)
    assert growth_per_minute(minutes, 100.0 + minutes + noise) == pytest.approx(1.0, abs=0.02)
    assert growth_per_minute(minutes[:1], minutes[:1]) is None


def test_note_of_bytes_needs_a_large_growth() -> None:
    assert byte_note(1_000_000, 50.0) is None
    assert byte_note(50_000_000, 200.0) is None
    assert byte_note(1_000_000, 200.0) == "num_bytes() says 1.0 MB, and its process grew by 200.0 MB"
    assert byte_note(None, 200.0) is None


def test_belief_scores() -> None:
    sums = BeliefScore()
    sums.take(np.array([0.8, 0.8, 0.3]), np.array([True, False, False]))
    assert sums.n == 3
    assert sums.squared_error == pytest.approx(0.04 + 0.64 + 0.09)
    assert sums.log_loss == pytest.approx(-math.log(0.8) - math.log(0.2) - math.log(0.7))
    # Two of 0.8 with one right: off by 0.6; one of 0.3 with none right: off by 0.3.
    assert float(calibration_error(np.array(sums.bins))) == pytest.approx((0.6 + 0.3) / 3)
    sums.take(np.array([0.0, 1.0]), np.array([True, False]))
    assert math.isfinite(sums.log_loss)
    assert math.isnan(float(calibration_error(np.zeros((10, 3)))))


def test_rank_of_the_true_place() -> None:
    mug = body("mug", 1.0)
    far, near = FoundPlace((5.0, 1.0, 0.0), 0.9), FoundPlace((2.0, 1.0, 0.0), 0.1)  # 0.9 m from the box
    counts = QueryCounts()
    for places in ([far, near], [near], [far]):
        counts.take([mug], places)
    assert counts == QueryCounts(n=3, hits_at_1=1, hits_at_5=2, reciprocal_ranks=1.5)


def test_change_counts_over_three_visits() -> None:
    old, new = ("mug", 0), ("mug", 1)
    first = BeliefSnapshot(frozenset({old}), frozenset({old}), frozenset({old}), frozenset())
    stale = BeliefSnapshot(frozenset({old}), frozenset({new}), frozenset({old, new}), frozenset({old}))
    right = BeliefSnapshot(frozenset({new}), frozenset({new}), frozenset({old, new}), frozenset({old}))
    assert change_counts([first, right]) == (ChangeCounts(hits=1), ChangeCounts(hits=1))
    assert change_counts([first, stale]) == (ChangeCounts(misses=1), ChangeCounts(misses=1))
    # The third visit tells the change from the first on, and from the second on a false appearance.
    gone, come = change_counts([first, stale, right])
    assert gone == ChangeCounts(hits=1, misses=1)
    assert come == ChangeCounts(hits=1, false_alarms=1, misses=1)
    unseen = BeliefSnapshot(frozenset({old}), frozenset({new}), frozenset({old}), frozenset())
    assert change_counts([first, unseen]) == (ChangeCounts(), ChangeCounts())
    taken = BeliefSnapshot(frozenset(), frozenset({new}), frozenset({old}), frozenset(), taken=frozenset({old}))
    assert change_counts([first, taken]) == (ChangeCounts(), ChangeCounts())
