"""The closed forms are SciPy's functions, and the exact ones are exact."""

from fractions import Fraction
from math import comb, sqrt

import numpy as np
import pytest
from scipy import special

from evonav.statistics.counts import chi_square_tail, fair_binomial_cdf
from evonav.statistics.interval import normal_cdf, student_quantile

CLOSE = {"rel": 1e-12, "abs": 1e-300}


def test_the_normal_distribution_is_scipys() -> None:
    for x in np.linspace(-37.0, 37.0, 2001).tolist():
        assert normal_cdf(x) == pytest.approx(special.ndtr(x), **CLOSE)


@pytest.mark.parametrize("degrees", [range(1, 200), (999, 1000, 9999, 10000)])
def test_quantiles_of_student_are_scipys(degrees: range | tuple[int, ...]) -> None:
    for num_degrees in degrees:
        assert student_quantile(num_degrees) == pytest.approx(special.stdtrit(num_degrees, 0.975), **CLOSE)


def test_quantiles_of_student_with_few_degrees_are_exact() -> None:
    assert student_quantile(1) == pytest.approx(np.tan(0.475 * np.pi), rel=1e-14)
    assert student_quantile(2) == pytest.approx(0.95 / sqrt(2 * 0.975 * 0.025), rel=1e-14)


def test_the_tail_of_chi_square_is_scipys() -> None:
    statistics = [0.0, *np.geomspace(1e-6, 1400.0, 60).tolist()]
    for num_degrees in (*range(1, 40), 200, 501):
        for statistic in statistics:
            assert chi_square_tail(num_degrees, statistic) == pytest.approx(
                special.chdtrc(num_degrees, statistic), **CLOSE
            )


def test_the_fair_binomial_distribution_is_correctly_rounded() -> None:
    for num_tosses in (*range(1, 40), 3000):
        for num_heads in {0, 1, num_tosses // 3, num_tosses // 2, num_tosses}:
            exact = Fraction(sum(comb(num_tosses, k) for k in range(num_heads + 1)), 2**num_tosses)
            assert fair_binomial_cdf(num_heads, num_tosses) == float(exact)
            assert fair_binomial_cdf(num_heads, num_tosses) == pytest.approx(
                special.bdtr(num_heads, num_tosses, 0.5), rel=1e-11, abs=1e-300
            )
