import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from evonav.statistics import (
    ClusterBootstrap,
    holm,
    mcnemar,
    paired_effect,
    paired_effects,
    power,
    sign_flip,
    student_quantile,
    with_holm,
)

GAPS = st.one_of(
    st.lists(st.integers(-5, 5).map(float), min_size=1, max_size=9),
    st.lists(st.floats(-3, 3).map(lambda x: round(x, 3)), min_size=1, max_size=9),
)


def sums_of_every_sign_pattern(gaps: list[float]) -> list[float]:
    patterns = itertools.product((-1, 1), repeat=len(gaps))
    return [abs(sum(sign * gap for sign, gap in zip(signs, gaps, strict=True))) for signs in patterns]


@given(GAPS)
def test_every_sign_pattern_is_counted(gaps: list[float]) -> None:
    """Whole numbers exactly; others but for patterns that lie within a lattice's step of what was seen."""
    found = sign_flip(np.array(gaps))
    assert 0 < found <= 1
    sums, observed = sums_of_every_sign_pattern(gaps), abs(sum(gaps))
    step = 1e-9 if all(gap == round(gap) for gap in gaps) else sum(map(abs, gaps)) / 1000
    assert np.mean([total >= observed + step for total in sums]) - 1e-12 <= found
    assert found <= np.mean([total >= observed - step for total in sums]) + 1e-12
    if step == 1e-9:
        assert found == pytest.approx(np.mean([total >= observed - step for total in sums]))


@given(st.integers(0, 40), st.integers(0, 40))
def test_with_a_stage_a_house_it_is_mcnemars_test(num_only_a: int, num_only_b: int) -> None:
    gaps = np.array([-1.0] * num_only_a + [1.0] * num_only_b + [0.0] * 7)
    n = num_only_a + num_only_b
    told = stats.binomtest(num_only_a, n).pvalue if n else 1.0
    assert mcnemar(num_only_a, num_only_b) == pytest.approx(told, abs=1e-12)
    assert sign_flip(gaps) == pytest.approx(told, abs=1e-9)


def test_a_house_that_decides_alone_is_one_house() -> None:
    """Five stages won in one house are one piece of evidence, not five."""
    assert mcnemar(0, 5) == pytest.approx(0.0625)
    assert sign_flip(np.array([5.0, 0.0, 0.0])) == 1.0


def holm_naive(ps: list[float]) -> list[float]:
    """By closed testing: a null is rejected when Bonferroni rejects every set that holds it."""
    adjusted = []
    for i in range(len(ps)):
        sets = [s for size in range(1, len(ps) + 1) for s in itertools.combinations(range(len(ps)), size) if i in s]
        adjusted.append(max(min(1.0, len(s) * min(ps[j] for j in s)) for s in sets))
    return adjusted


@given(st.lists(st.floats(0, 1), min_size=1, max_size=6))
def test_holm_is_the_closed_test(ps: list[float]) -> None:
    assert holm(ps) == pytest.approx(holm_naive(ps))


def run(generator: np.random.Generator, num_houses: int, luck: float, gain: float = 0.0):
    """Two agents, houses that differ, and luck in a house that its stages share."""
    sizes = generator.integers(3, 6, num_houses)
    houses = np.repeat(np.arange(num_houses), sizes)
    logits = generator.normal(0, 1, num_houses) + generator.normal(0, luck, (2, num_houses)) + [[0.0], [gain]]
    success = (generator.random((2, len(houses))) < 1 / (1 + np.exp(-logits[:, houses]))).astype(float)
    return success, [f"house {house:03}" for house in houses]


def test_the_standard_error_is_that_of_cluster_sums() -> None:
    (a, b), names = run(np.random.default_rng(5), 80, 1.0)
    found = paired_effect(a, b, names)
    _, rows = np.unique(names, return_inverse=True)
    gaps, sizes = np.bincount(rows, weights=b - a), np.bincount(rows)
    mean = gaps.sum() / sizes.sum()
    closed = math.sqrt(((gaps - mean * sizes) ** 2).sum()) / sizes.sum()
    assert found.difference == pytest.approx(mean)
    assert found.standard_error == pytest.approx(closed, rel=0.04)
    assert found.ci95 is not None
    half = student_quantile(79) * closed
    assert found.ci95 == pytest.approx((mean - half, mean + half), abs=0.1 * half)
    assert found.detectable == pytest.approx(2.8016 * closed, rel=0.04)
    assert (found.mean_a, found.mean_b) == (pytest.approx(a.mean()), pytest.approx(b.mean()))
    assert found.relative == pytest.approx(mean / a.mean())
    assert found == paired_effect(a, b, names)  # nothing is left to chance
    assert found.p == pytest.approx(sign_flip(gaps))


def test_intervals_of_few_houses_are_widened() -> None:
    (a, b), names = run(np.random.default_rng(8), 10, 0.5)
    found = paired_effect(a, b, names)
    assert found.ci95 is not None
    assert found.standard_error is not None
    widths = (found.ci95[1] - found.ci95[0]) / (2 * 1.96 * found.standard_error)
    assert widths == pytest.approx(math.sqrt(10 / 9) * 2.262 / 1.96, rel=0.08)  # 1.22, not 1


def test_several_measures_at_once_are_each_by_itself() -> None:
    (a, b), names = run(np.random.default_rng(6), 12, 0.5)
    both = paired_effects(np.column_stack([a, 0.7 * a]), np.column_stack([b, 0.4 * b]), names)
    assert both[0] == paired_effect(a, b, names)
    assert both[1] == paired_effect(0.7 * a, 0.4 * b, names)
    (rate,) = ClusterBootstrap(names).column_means(b[:, None])
    assert rate.value == both[0].mean_b


def test_strata_keep_their_number_of_houses() -> None:
    """Houses of one kind always gain 1, the other kind nothing: within strata there is nothing left to vary."""
    names = [f"house {i:02}" for i in range(20)]
    kinds = ["small" if i < 10 else "large" for i in range(20)]
    a, b = np.zeros(20), np.array([1.0] * 10 + [0.0] * 10)
    loose = paired_effect(a, b, names)
    assert loose.ci95 is not None
    assert loose.ci95[1] - loose.ci95[0] > 0.3
    tight = paired_effect(a, b, names, strata=kinds)
    assert (tight.difference, tight.ci95) == (0.5, None)
    with pytest.raises(ValueError, match="two strata"):
        paired_effect(a, b, ["house"] * 20, strata=kinds)


def test_verdicts_say_no_more_than_houses_allow() -> None:
    names = [f"house {i}" for i in range(12)]
    zeros, ones = np.zeros(12), np.ones(12)
    mixed = np.array([1.0, 0.0] * 6)
    assert paired_effect(mixed, mixed, names).verdict == "equal"
    assert paired_effect(zeros, mixed, names).verdict == "b"
    assert paired_effect(mixed, zeros, names).verdict == "a"
    assert paired_effect(mixed, 1 - mixed, names).verdict == "tie"
    assert paired_effect(zeros, mixed, ["one house"] * 12).verdict == "few"
    assert paired_effect(zeros, ones, names).verdict == "few"  # all alike: resampling cannot tell
    with pytest.raises(ValueError, match="no pair"):
        paired_effect(np.zeros(0), np.zeros(0), [])


def test_flips_that_cancel_within_houses_are_not_called_equal() -> None:
    names = [f"house {i // 2}" for i in range(12)]
    a, b = np.array([1.0, 0.0] * 6), np.array([0.0, 1.0] * 6)
    found = paired_effect(a, b, names)
    assert (found.difference, found.ci95, found.num_unequal) == (0.0, None, 12)
    assert found.verdict == "few"


def test_a_verdict_allows_for_the_number_of_pairs() -> None:
    names = [f"house {i}" for i in range(24)]
    zeros, some = np.zeros(24), np.array([1.0] * 6 + [0.0] * 18)
    alone = paired_effect(zeros, some, names)
    assert (alone.p, alone.adjusted_p, alone.verdict) == (0.03125, 0.03125, "b")
    family = with_holm([alone, alone, paired_effect(zeros, 1 - some, names)])
    assert [round(one.adjusted_p, 6) for one in family] == [0.0625, 0.0625, round(3 * family[2].p, 6)]
    assert [one.verdict for one in family] == ["tie", "tie", "b"]
    assert with_holm([]) == []


def test_power_is_that_of_a_normal_test() -> None:
    assert power(0.0, 1.0) == pytest.approx(0.05)
    assert power(2.8016, 1.0) == pytest.approx(0.8, abs=1e-3)
    assert power(-2.8016, 1.0) == pytest.approx(0.8, abs=1e-3)
    assert (power(0.0, 0.0), power(0.1, 0.0)) == (0.0, 1.0)


def test_intervals_cover_and_tests_err_as_often_as_they_say() -> None:
    """The short form of scripts/studies/calibrate_statistics.py: 250 runs of 20 houses without a difference."""
    covered, flipped, naive = [], [], []
    for i in range(250):
        (a, b), names = run(np.random.default_rng([0, i]), 20, 2.0)
        found = paired_effect(a, b, names, num_resamples=800, seed=i)
        covered.append(found.ci95 is not None and found.ci95[0] <= 0 <= found.ci95[1])
        flipped.append(found.p <= 0.05)
        naive.append(mcnemar(int((a > b).sum()), int((b > a).sum())) <= 0.05)
    assert 0.92 <= np.mean(covered) <= 0.98
    assert 0.01 <= np.mean(flipped) <= 0.075
    assert np.mean(naive) > 0.1  # what taking stages for independent would do
