"""Two agents on the same stages: difference, interval, p and what could have been detected. All by house.

Stages of a house share its floor plan, and those of a task a memory: they are not independent, so every resample and
every permutation takes a house whole. Nothing here knows records; see `evonav.report.compare.compare` for those.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from evonav.significance import Interval, percentile_interval, resampled_counts

NUM_RESAMPLES = 10_000
LATTICE = 8192
"""Steps that a sum of gaps which are no whole numbers is divided into, at least: far finer than its own spread."""
LEAST_CLUSTERS = 5
"""Houses from which on an interval is taken at its word."""
LEVEL = 0.05
DETECTABLE_Z = 1.959963984540054 + 0.8416212335729143
"""Standard errors that a difference must be to be found at 5%, two-sided, in four of five such experiments."""


@dataclass(frozen=True, slots=True)
class PairedEffect:
    """Of `b` less `a`, over pairs of values of the same stages."""

    n: int
    """Pairs."""
    num_clusters: int
    """Houses that they are from."""
    mean_a: float
    mean_b: float
    difference: float
    ci95: Interval | None
    """Percentile bootstrap by house (`percentile_interval`); `None` of a single one, or where all of them agree."""
    relative: float | None
    """The difference by the mean of `a`; `None` where that is zero."""
    relative_ci95: Interval | None
    p: float
    """Two-sided, agents' names exchanged in whole houses: `sign_flip`."""
    standard_error: float | None
    """Of the difference: the resamples' standard deviation."""

    @property
    def detectable(self) -> float | None:
        """The least true difference that so many such houses find, at 5%, four times in five."""
        return None if self.standard_error is None else DETECTABLE_Z * self.standard_error

    @property
    def verdict(self) -> str:
        """`equal`, `few`, `b`, `a` or `tie`: who is ahead, as far as interval and p allow."""
        if self.p == 1.0 and self.difference == 0.0 and not self.standard_error:
            return "equal"
        if self.num_clusters < LEAST_CLUSTERS or self.ci95 is None:
            return "few"
        if self.p > LEVEL or self.ci95[0] <= 0.0 <= self.ci95[1]:
            return "tie"
        return "b" if self.difference > 0 else "a"


def paired_effect(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    clusters: Sequence[str],
    *,
    strata: Sequence[str] | None = None,
    num_resamples: int = NUM_RESAMPLES,
    seed: int = 0,
) -> PairedEffect:
    """`paired_effects` of one measure: `a` and `b` are `(N,)`."""
    (found,) = paired_effects(a[:, None], b[:, None], clusters, strata=strata, num_resamples=num_resamples, seed=seed)
    return found


def paired_effects(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    clusters: Sequence[str],
    *,
    strata: Sequence[str] | None = None,
    num_resamples: int = NUM_RESAMPLES,
    seed: int = 0,
) -> list[PairedEffect]:
    """How `b` differs from `a`, in each of M measures.

    Args:
        a: `(N, M)` values of one agent, a row a stage.
        b: `(N, M)`, of the other, on the same stages.
        clusters: `N` names of houses; rows of one are drawn together.
        strata: `N` names, the same for all rows of a house; houses are resampled within them. For stages pooled from
            sets whose sizes were chosen, such as a thousand small houses and seventy large ones.
        num_resamples: Of the bootstrap.
        seed: Of all that is drawn.

    Raises:
        ValueError: There is no pair, or a house lies in two strata.
    """
    n, num_measures = a.shape
    if n == 0:
        raise ValueError("no pair to compare")
    names, rows = np.unique(np.asarray(clusters), return_inverse=True)
    sums_a, gaps = np.zeros((len(names), num_measures)), np.zeros((len(names), num_measures))
    np.add.at(sums_a, rows, a)
    np.add.at(gaps, rows, b - a)
    sizes = np.bincount(rows, minlength=len(names)).astype(np.float64)
    drawn = _resampled_sums(
        np.column_stack([sums_a, gaps, sizes]), _strata_of(rows, len(names), strata), num_resamples, seed
    )
    drawn_a, drawn_gaps = drawn[:, :num_measures], drawn[:, num_measures:-1]
    differences = drawn_gaps / drawn[:, -1:]
    relatives = np.divide(drawn_gaps, drawn_a, out=np.full_like(drawn_gaps, np.nan), where=drawn_a != 0)
    ends = percentile_interval(np.column_stack([differences, relatives]), len(names))
    found = []
    for i in range(num_measures):
        total_a, gap = float(sums_a[:, i].sum()), float(gaps[:, i].sum())
        has_spread = len(names) > 1 and bool(np.ptp(differences[:, i]) > 1e-12)
        found.append(
            PairedEffect(
                n=n,
                num_clusters=len(names),
                mean_a=total_a / n,
                mean_b=(total_a + gap) / n,
                difference=gap / n,
                ci95=_ends(ends[i]) if has_spread else None,
                relative=gap / total_a if total_a != 0 else None,
                relative_ci95=_ends(ends[num_measures + i]) if has_spread and total_a != 0 else None,
                p=sign_flip(gaps[:, i]),
                standard_error=float(differences[:, i].std(ddof=1)) if has_spread else None,
            )
        )
    return found


def cluster_means(
    values: NDArray[np.float64], clusters: Sequence[str], *, num_resamples: int = NUM_RESAMPLES, seed: int = 0
) -> list[tuple[float, Interval | None]]:
    """Mean and 95% interval of each of M measures, resampling houses.

    Args:
        values: `(N, M)`, a row a stage.
        clusters: `N` names of houses.
        num_resamples: Of the bootstrap.
        seed: Of the resampling.
    """
    names, rows = np.unique(np.asarray(clusters), return_inverse=True)
    sums = np.zeros((len(names), values.shape[1] + 1))
    np.add.at(sums, rows, np.column_stack([values, np.ones(len(values))]))
    drawn = _resampled_sums(sums, np.zeros(len(names), dtype=np.int64), num_resamples, seed)
    means = drawn[:, :-1] / drawn[:, -1:]
    ends = percentile_interval(means, len(names))
    has_spread = np.ptp(means, axis=0) > 1e-12
    return [
        (float(mean), _ends(ends[i]) if len(names) > 1 and has_spread[i] else None)
        for i, mean in enumerate(values.mean(axis=0))
    ]


def sign_flip(gaps: NDArray[np.float64]) -> float:
    """Two-sided p of a sum of gaps, if each had had either sign as well.

    With the agents' difference in a house as a gap, this exchanges the two agents' names in whole houses: it asks
    nothing of the stages within, and of the houses only that they are independent. All 2^N sign patterns are counted,
    by the distribution of their sum; nothing is drawn. Where each house has one stage and gaps are successes, this is
    McNemar's exact test. Gaps that are not whole numbers are rounded to `LATTICE` steps of their sum or finer.

    Args:
        gaps: `(N,)`, one a house.

    Complexity:
        O(N S) time, S the sum of sizes or of the lattice's steps.
    """
    gaps = gaps[np.abs(gaps) > 1e-12]
    if len(gaps) == 0:
        return 1.0
    steps = np.round(gaps)
    if not np.array_equal(steps, gaps):
        num_steps = max(LATTICE, 64 * len(gaps))
        steps = np.round(gaps * (num_steps / np.abs(gaps).sum()))
    sizes = np.sort(np.abs(steps)).astype(np.int64)
    sizes, observed = sizes[sizes > 0], abs(int(steps.sum()))
    chances = np.ones(1)
    for size in sizes:  # of sums from -reach to reach; each gap moves half of the weight either way
        moved = np.zeros(len(chances) + 2 * int(size))
        moved[: len(chances)] = 0.5 * chances
        moved[2 * int(size) :] += 0.5 * chances
        chances = moved
    reach = len(chances) // 2
    if observed == 0:
        return 1.0
    return min(1.0, float(chances[: reach - observed + 1].sum() + chances[reach + observed :].sum()))


def mcnemar(num_only_a: int, num_only_b: int) -> float:
    """McNemar's exact two-sided p of discordant pairs, as if every stage were independent of all others.

    For comparison with tables that ignore houses: where outcomes hang together within houses, it is below 5% more often
    than one time in twenty under no difference (docs/statistics.md has how often). `sign_flip` is not.
    """
    n, less = num_only_a + num_only_b, min(num_only_a, num_only_b)
    tail = math.fsum(math.comb(n, k) for k in range(less + 1)) / 2**n if n <= 1000 else _normal_tail(n, less)
    return min(1.0, 2 * tail)


def _normal_tail(n: int, less: int) -> float:
    """Chance of at most `less` heads in `n` throws, with the correction for whole numbers."""
    return 0.5 * math.erfc((n / 2 - less - 0.5) / math.sqrt(n / 2))


def holm(ps: Sequence[float]) -> list[float]:
    """Holm's adjusted p of several tests: below 5% for any true null in at most one of twenty such families."""
    order = sorted(range(len(ps)), key=lambda i: ps[i])
    adjusted, least = [0.0] * len(ps), 0.0
    for rank, i in enumerate(order):
        least = max(least, min(1.0, (len(ps) - rank) * ps[i]))
        adjusted[i] = least
    return adjusted


def power(difference: float, standard_error: float) -> float:
    """Chance that a test at 5%, two-sided, finds a true difference that is estimated with this standard error."""
    if standard_error == 0.0:
        return 0.0 if difference == 0.0 else 1.0
    shift, z = abs(difference) / standard_error, 1.959963984540054
    return 0.5 * (math.erfc((z - shift) / math.sqrt(2)) + math.erfc((z + shift) / math.sqrt(2)))


def _strata_of(rows: NDArray[np.intp], num_clusters: int, strata: Sequence[str] | None) -> NDArray[np.int64]:
    codes = np.zeros(num_clusters, dtype=np.int64)
    if strata is not None:
        _, of_row = np.unique(np.asarray(strata), return_inverse=True)
        codes[rows] = of_row
        if not np.array_equal(codes[rows], of_row):
            raise ValueError("a house lies in two strata")
    return codes


def _resampled_sums(
    sums: NDArray[np.float64], strata: NDArray[np.int64], num_resamples: int, seed: int
) -> NDArray[np.float64]:
    """`(R, K)` sums over the units of each resample, of `(N, K)` sums a unit."""
    blocks = _counts(strata.tobytes(), num_resamples, seed)
    return np.concatenate([counts.astype(np.float64) @ sums for counts in blocks])


# The same houses are resampled for every pair of agents and every measure: drawing takes ten times as long as summing.
@lru_cache(maxsize=16)
def _counts(strata: bytes, num_resamples: int, seed: int) -> tuple[NDArray[np.uint16], ...]:
    codes = np.frombuffer(strata, dtype=np.int64)
    return tuple(counts.astype(np.uint16) for counts in resampled_counts(codes, num_resamples=num_resamples, seed=seed))


def _ends(row: NDArray[np.float64]) -> Interval:
    return (float(row[0]), float(row[1]))
