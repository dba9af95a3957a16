import math

import numpy as np
import pytest
from scipy import stats

from evonav.statistics import newcombe, percentile_interval, student_quantile, widened_tail, wilson


def test_wilson_is_the_published_interval() -> None:
    # Newcombe, Statistics in Medicine 17 (1998), table I: 81/263 and 0/20.
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert wilson(0, 20) == pytest.approx((0.0, 0.1611), abs=5e-5)
    assert wilson(0, 0) is None


def test_newcombe_is_the_published_interval_of_a_difference() -> None:
    assert newcombe(48, 80, 56, 70) == pytest.approx((0.0524, 0.3339), abs=5e-5)
    assert newcombe(3, 10, 9, 10) == pytest.approx((0.1705, 0.8090), abs=5e-5)
    assert newcombe(0, 10, 10, 10) == pytest.approx((0.6075, 1.0), abs=5e-5)
    assert newcombe(0, 0, 3, 10) is None
    assert newcombe(3, 10, 0, 0) is None


@pytest.mark.parametrize(("num_degrees", "printed"), [(1, 12.706), (2, 4.303), (9, 2.262), (30, 2.042)])
def test_students_quantile_is_the_printed_one(num_degrees: int, printed: float) -> None:
    assert student_quantile(num_degrees) == pytest.approx(printed, abs=5e-4)
    assert student_quantile(num_degrees) == pytest.approx(stats.t.ppf(0.975, num_degrees), rel=1e-12)


def test_few_clusters_widen_an_interval_as_students_distribution_does() -> None:
    values = np.random.default_rng(3).normal(size=400_000) * math.sqrt(9 / 10)  # as means of 10 are resampled
    assert percentile_interval(values, 10) == (pytest.approx(-2.262, rel=0.02), pytest.approx(2.262, rel=0.02))
    assert widened_tail(100_000) == pytest.approx(0.025, abs=1e-5)
    assert percentile_interval(values, 100_000) == pytest.approx(tuple(np.quantile(values, [0.025, 0.975])), abs=1e-3)


def test_there_is_no_interval_where_resampling_cannot_tell() -> None:
    values = np.arange(100.0)
    assert percentile_interval(values, 1) is None
    assert percentile_interval(np.full(100, 0.3), 10) is None
    assert percentile_interval(np.full(100, np.nan), 10) is None
    assert percentile_interval(np.append(values, np.nan), 10) == percentile_interval(values, 10)


def test_an_interval_may_end_at_infinity() -> None:
    assert percentile_interval(np.array([0.5] * 50 + [math.inf] * 50), 10) == (0.5, math.inf)
    assert percentile_interval(np.array([-math.inf] * 50 + [math.inf] * 50), 10) == (-math.inf, math.inf)
    assert percentile_interval(np.full(100, math.inf), 10) is None
