import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from evonav.statistics import chi_square, effective_size, mcnemar, weighted_quantiles


@given(st.lists(st.tuples(st.integers(0, 400), st.floats(0.5, 3)), min_size=2, max_size=8))
def test_chi_square_is_scipys_where_no_cell_expects_little(cells: list[tuple[int, float]]) -> None:
    observed, expected = [count for count, _ in cells], np.array([share for _, share in cells])
    found = chi_square(observed, expected.tolist())
    scaled = expected / expected.sum() * sum(observed)
    if sum(observed) == 0:
        assert found is None
    elif scaled.min() >= 5:
        told = stats.chisquare(observed, scaled)
        assert found is not None
        assert found.num_degrees == len(cells) - 1
        assert (found.statistic, found.p) == (
            pytest.approx(told.statistic, abs=1e-9),
            pytest.approx(told.pvalue, abs=1e-9),
        )


def test_cells_that_expect_little_are_merged_with_their_neighbour() -> None:
    """48 tasks expect 7, 18, 16, 6 and 1 of 0 to 4 evolutions: the last two become one cell."""
    found = chi_square([6, 20, 15, 5, 2], [0.1458, 0.375, 0.3333, 0.125, 0.0208])
    merged = np.array([0.1458, 0.375, 0.3333, 0.1458])
    told = stats.chisquare([6, 20, 15, 7], merged / merged.sum() * 48)
    assert found is not None
    assert found.num_cells == 4
    assert found.p == pytest.approx(told.pvalue, abs=1e-4)
    assert chi_square([1, 2], [0.5, 0.5]) is None
    assert chi_square([0, 0], [0.5, 0.5]) is None


def test_the_modes_of_an_early_run_are_unlikely() -> None:
    found = chi_square([702, 599, 178], [0.5, 0.4, 0.1])
    assert found is not None
    assert found.p == pytest.approx(stats.chisquare([702, 599, 178], [739.5, 591.6, 147.9]).pvalue, abs=1e-9)
    assert found.p == pytest.approx(0.0177, abs=5e-4)


def test_p_values_of_true_draws_are_uniform() -> None:
    generator = np.random.Generator(np.random.PCG64(0))
    shares = [0.1458, 0.375, 0.3333, 0.125, 0.0209]
    found = [chi_square(generator.multinomial(1000, shares).tolist(), shares) for _ in range(2000)]
    ps = np.array([one.p for one in found if one is not None])
    assert len(ps) == 2000
    assert stats.kstest(ps, "uniform").pvalue > 0.001


@given(
    st.lists(st.tuples(st.floats(-5, 5), st.integers(1, 4)), min_size=1, max_size=30),
    st.sampled_from([0.25, 0.5, 0.75]),
)
def test_weighted_quantiles_are_those_of_repeated_values(values: list[tuple[float, int]], share: float) -> None:
    numbers, weights = (np.array(column, dtype=float) for column in zip(*values, strict=True))
    repeated = np.repeat(numbers, weights.astype(int))
    found = weighted_quantiles(numbers, weights, [share])[0]
    assert found == pytest.approx(np.quantile(repeated, share, method="averaged_inverted_cdf"), abs=1e-12)


def test_effective_size_of_equal_and_of_unequal_weights() -> None:
    assert effective_size(np.full(7, 0.3)) == pytest.approx(7)
    assert effective_size(np.array([1.0, 1.0, 0.0])) == pytest.approx(2)
    assert effective_size(np.array([3.0, 1.0])) == pytest.approx(1.6)
    assert effective_size(np.zeros(3)) == 0


def test_mcnemar_of_thousands_of_stages() -> None:
    assert mcnemar(980, 1100) == pytest.approx(stats.binomtest(980, 2080).pvalue, rel=1e-9)
