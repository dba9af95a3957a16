"""Two agents on the same stages: difference, interval, p, verdict, and what could have been detected. All by house.

Every resample and every permutation takes a house whole (`evonav.statistics.bootstrap`). Nothing here knows records;
see `evonav.report.compare` for those.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evonav.statistics.bootstrap import NUM_RESAMPLES, ClusterBootstrap
from evonav.statistics.interval import Z_95, Interval, normal_cdf, percentile_interval

LATTICE = 8192
"""Steps that a sum of gaps which are no whole numbers is divided into, at least: far finer than its own spread."""
MIN_CLUSTERS = 5
"""Houses from which on an interval allows a verdict."""
LEVEL = 0.05
DETECTABLE_Z = Z_95 + 0.8416212335729143
"""Standard errors that a difference must be to be found at 5%, two-sided, in four of five such experiments."""

Verdict = Literal["equal", "few", "tie", "a", "b"]


@dataclass(frozen=True, slots=True)
class PairedEffect:
    """The difference of `b` less `a`, over pairs of values of the same stages."""

    n: int
    """Pairs."""
    num_unequal: int
    """Pairs whose two values differ."""
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
    adjusted_p: float
    """`p` after Holm's adjustment for the family that the pair was compared in (`with_holm`); `p` in none."""
    standard_error: float | None
    """Standard deviation of the difference over resamples; `None` where there is no interval."""

    @property
    def detectable(self) -> float | None:
        """The least true difference that so many such houses find, at 5%, four times in five."""
        return None if self.standard_error is None else DETECTABLE_Z * self.standard_error

    @property
    def verdict(self) -> Verdict:
        """Verdict on who is ahead, as far as interval and adjusted p allow: the one rule of every page, table and file.

        `equal`: the values agree on every stage. `few`: fewer than `MIN_CLUSTERS` houses, or all of them alike.
        `tie`: the adjusted p is above `LEVEL`, or the interval holds 0. Else `a` or `b`, the one with the higher mean.
        """
        if self.num_unequal == 0:
            return "equal"
        if self.num_clusters < MIN_CLUSTERS or self.ci95 is None:
            return "few"
        if self.adjusted_p > LEVEL or self.ci95[0] <= 0.0 <= self.ci95[1]:
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
    """Compare one measure: as `paired_effects`, with `a` and `b` of shape `(N,)`."""
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
    """Compare `b` with `a` in each of M measures.

    Args:
        a: `(N, M)` values of one agent, a row a stage.
        b: `(N, M)`, of the other, on the same stages.
        clusters: `N` names of houses; rows of one are drawn together.
        strata: `N` names, the same for all rows of a house; houses are resampled within them.

    Raises:
        ValueError: The arrays have no row, or a house lies in two strata.
    """
    n, num_measures = a.shape
    if n == 0:
        raise ValueError("no pair to compare")
    bootstrap = ClusterBootstrap(clusters, strata=strata, num_resamples=num_resamples, seed=seed)
    sums_a, gaps = bootstrap.sums(a), bootstrap.sums(b - a)
    drawn = bootstrap.resampled_sums(np.column_stack([sums_a, gaps, bootstrap.sums(np.ones(n))]))
    drawn_a, drawn_gaps = drawn[:, :num_measures], drawn[:, num_measures:-1]
    differences = drawn_gaps / drawn[:, -1:]
    relatives = np.divide(drawn_gaps, drawn_a, out=np.full_like(drawn_gaps, np.nan), where=drawn_a != 0)
    found = []
    for i in range(num_measures):
        total_a, gap = float(sums_a[:, i].sum()), float(gaps[:, i].sum())
        ci95 = percentile_interval(differences[:, i], bootstrap.num_clusters)
        has_relative = ci95 is not None and total_a != 0
        p = sign_flip(gaps[:, i])
        found.append(
            PairedEffect(
                n=n,
                num_unequal=int((a[:, i] != b[:, i]).sum()),
                num_clusters=bootstrap.num_clusters,
                mean_a=total_a / n,
                mean_b=(total_a + gap) / n,
                difference=gap / n,
                ci95=ci95,
                relative=gap / total_a if total_a != 0 else None,
                relative_ci95=percentile_interval(relatives[:, i], bootstrap.num_clusters) if has_relative else None,
                p=p,
                adjusted_p=p,
                standard_error=None if ci95 is None else float(differences[:, i].std(ddof=1)),
            )
        )
    return found


def sign_flip(gaps: NDArray[np.float64]) -> float:
    """Return the two-sided p of a sum of gaps, if each had had either sign as well.

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


def holm(ps: Sequence[float]) -> list[float]:
    """Return Holm's adjusted p of several tests: below 5% for any true null in at most one of twenty such families."""
    order = sorted(range(len(ps)), key=lambda i: ps[i])
    adjusted, least = [0.0] * len(ps), 0.0
    for rank, i in enumerate(order):
        least = max(least, min(1.0, (len(ps) - rank) * ps[i]))
        adjusted[i] = least
    return adjusted


def with_holm(effects: Sequence[PairedEffect]) -> list[PairedEffect]:
    """Return effects whose verdicts allow for how many of them there are, by Holm's adjusted p."""
    ps = holm([effect.p for effect in effects])
    return [replace(effect, adjusted_p=p) for effect, p in zip(effects, ps, strict=True)]


def power(difference: float, standard_error: float) -> float:
    """Return the chance that a test at 5%, two-sided, finds a true difference with this standard error."""
    if standard_error == 0.0:
        return 0.0 if difference == 0.0 else 1.0
    shift = abs(difference) / standard_error
    return normal_cdf(shift - Z_95) + normal_cdf(-shift - Z_95)


@dataclass(frozen=True, slots=True)
class BeforeAfter:
    """One number before and now."""

    name: str
    before: float
    now: float
    is_worse: bool
    """Whether it is worse by more than chance explains."""

    def __str__(self) -> str:
        """Return the change in words: `path, ms: 0.07 -> 0.15 (2.14 times as much)`."""
        factor = f"{self.now / self.before:.2f} times as much" if self.before > 0 else "from nothing"
        return f"{self.name}: {self.before:.3g} -> {self.now:.3g} ({factor})"
