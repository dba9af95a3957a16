"""Tests of counts: Pearson's chi-square and McNemar's."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

LEAST_EXPECTED = 5.0
"""Cells of a chi-square test that expect fewer are merged: below it the distribution is not a chi-square's."""


@dataclass(frozen=True, slots=True)
class ChiSquare:
    """A test of counts against expected ones."""

    statistic: float
    num_degrees: int
    p: float
    num_cells: int
    """Number of cells after merging."""


def chi_square(observed: Sequence[float], expected: Sequence[float]) -> ChiSquare | None:
    """Test counts by Pearson's test, the expected ones scaled to the observed sum.

    Neighbouring cells are merged, from the last to the first, until each expects `LEAST_EXPECTED`.

    Returns:
        `None` where fewer than two cells are left: nothing can be tested.
    """
    total, mass = math.fsum(observed), math.fsum(expected)
    if total <= 0 or mass <= 0:
        return None
    cells: list[list[float]] = []
    pending = [0.0, 0.0]
    for count, share in zip(reversed(observed), reversed(expected), strict=True):
        pending = [pending[0] + count, pending[1] + share * total / mass]
        if pending[1] >= LEAST_EXPECTED:
            cells.append(pending)
            pending = [0.0, 0.0]
    if cells:
        cells[-1] = [cells[-1][0] + pending[0], cells[-1][1] + pending[1]]
    if len(cells) < 2:
        return None
    statistic = math.fsum((count - mean) ** 2 / mean for count, mean in cells)
    num_degrees = len(cells) - 1
    return ChiSquare(statistic, num_degrees, chi_square_tail(num_degrees, statistic), len(cells))


def mcnemar(num_only_a: int, num_only_b: int) -> float:
    """Return McNemar's exact two-sided p of discordant pairs, as if every stage were independent of all others.

    For comparison with tables that ignore houses: where outcomes hang together within houses, it is below 5% more often
    than one time in twenty under no difference (docs/statistics.md has how often). `sign_flip` is not.
    """
    n, less = num_only_a + num_only_b, min(num_only_a, num_only_b)
    return min(1.0, 2 * fair_binomial_cdf(less, n)) if n else 1.0


def chi_square_tail(num_degrees: int, statistic: float) -> float:
    """Return the chance that a chi-square variable is above `statistic`.

    Source: the finite series of Abramowitz & Stegun, 26.4.4 and 26.4.5.

    Args:
        num_degrees: Degrees of freedom, at least 1.
        statistic: Test statistic, not negative.
    """
    half = statistic / 2.0
    if half == 0.0:
        return 1.0
    is_odd = num_degrees % 2
    powers = [k + 0.5 * is_odd for k in range((num_degrees - is_odd) // 2)]
    terms = [math.exp(power * math.log(half) - half - math.lgamma(power + 1.0)) for power in powers]
    return min(1.0, math.fsum(terms + [math.erfc(math.sqrt(half))] * is_odd))


def fair_binomial_cdf(num_heads: int, num_tosses: int) -> float:
    """Return the chance of at most `num_heads` heads in tosses of a fair coin, correctly rounded."""
    ways, total = 1, 0
    for k in range(num_heads + 1):
        total += ways
        ways = ways * (num_tosses - k) // (k + 1)
    return total / (1 << num_tosses)
