"""Resample houses: the one bootstrap behind every interval over stages, tasks or views.

Stages of a house share its floor plan, those of a task also a memory, and views of a house its objects. They are not
independent, so every resample takes a house whole.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evonav import _core
from evonav.statistics.interval import Interval, percentile_interval

NUM_RESAMPLES = 10_000
MAX_RESAMPLE_CELLS = 4_000_000
"""Resampled counts drawn at a time, to bound memory."""
SUMMED_ROWS = 192
"""Number of resamples that are added up at a time.

Their counts as floats stay in the processor's cache. OpenBLAS adds up a row in the same order for any number of rows
that its kernels divide, as this one."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A number with its interval."""

    value: float | None
    """`None` where there is nothing to take it of."""
    ci95: Interval | None
    """Percentile bootstrap by cluster; `None` of fewer than two clusters, or where all of them agree."""
    n: int
    """Number of things that it is a mean over."""
    num_clusters: int
    """Clusters that were resampled."""
    resampled: NDArray[np.float64] | None = field(default=None, repr=False, compare=False)
    """`(R,)` its value in every resample, where it was resampled."""

    def minus(self, other: "Estimate") -> "Estimate":
        """Return the difference to another estimate that was resampled with the same bootstrap.

        Its interval is of the differences within resamples, and its `n` is the smaller one.

        Args:
            other: The same number of something else, over the same clusters.
        """
        n = min(self.n, other.n)
        if self.value is None or other.value is None:
            return Estimate(None, None, n, self.num_clusters)
        value = self.value - other.value
        if self.resampled is None or other.resampled is None:
            return Estimate(value, None, n, self.num_clusters)
        resampled = self.resampled - other.resampled
        return Estimate(value, percentile_interval(resampled, self.num_clusters), n, self.num_clusters, resampled)


class ClusterBootstrap:
    """Resamples of clusters (houses), the same for everything that is estimated with them.

    Attributes:
        num_clusters: C, the different clusters. Their order is that of their sorted names.
        cluster_of: `(N,)` index of each row's cluster.
    """

    def __init__(
        self,
        clusters: Sequence[str],
        *,
        strata: Sequence[str] | NDArray[np.int64] | None = None,
        num_resamples: int = NUM_RESAMPLES,
        seed: int = 0,
    ) -> None:
        """Prepare the resamples of some rows' clusters.

        Args:
            clusters: `N` names of houses, one a row; rows of one house are drawn together.
            strata: `N` names or numbers, the same for all rows of a house; houses are resampled within them. For rows
                pooled from sets whose sizes were chosen, such as a thousand small houses and seventy large ones.
            num_resamples: R, more make steadier ends.

        Raises:
            ValueError: A house lies in two strata.
        """
        self.cluster_of, self.num_clusters = _places(clusters)
        self._strata = np.zeros(self.num_clusters, np.int64)
        if strata is not None:
            stratum_of, _ = _places(strata)
            self._strata[self.cluster_of] = stratum_of
            if not np.array_equal(self._strata[self.cluster_of], stratum_of):
                raise ValueError("a house lies in two strata")
        self._num_resamples = num_resamples
        self._seed = seed

    @property
    def draws(self) -> NDArray[np.float64]:
        """`(R, C)` how often each cluster is drawn in each resample."""
        return np.concatenate(self._blocks()).astype(np.float64)

    def sums(self, values: ArrayLike, cluster_of: NDArray[np.int64] | None = None) -> NDArray[np.float64]:
        """Add up rows by cluster.

        Args:
            values: `(N,)` or `(N, M)`.
            cluster_of: `(N,)` index of each row's cluster; default: those of the rows that the bootstrap is of.

        Returns:
            `(C,)` or `(C, M)`.
        """
        rows = np.asarray(values, np.float64)
        summed = np.zeros((self.num_clusters, *rows.shape[1:]))
        np.add.at(summed, self.cluster_of if cluster_of is None else cluster_of, rows)
        return summed

    def resampled_sums(self, sums: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the totals of every resample, `(R, ...)`, from sums by cluster, `(C, ...)`."""
        parts = (
            counts[first : first + SUMMED_ROWS]
            for counts in self._blocks()
            for first in range(0, len(counts), SUMMED_ROWS)
        )
        return np.concatenate([part.astype(np.float64) @ sums for part in parts])

    def column_means(self, values: NDArray[np.float64]) -> list[Estimate]:
        """Estimate the mean of each of M columns over all rows.

        Args:
            values: `(N, M)`, a row as the bootstrap's.
        """
        sums = self.sums(np.column_stack([values, np.ones(len(values))]))
        totals = self.resampled_sums(sums)
        resampled = totals[:, :-1] / totals[:, -1:]
        return [
            Estimate(float(mean), percentile_interval(column, self.num_clusters), len(values), self.num_clusters)
            for mean, column in zip(values.mean(axis=0), resampled.T, strict=True)
        ]

    def ratio(
        self,
        numerators: NDArray[np.float64],
        denominators: NDArray[np.float64],
        n: int,
        transform: Callable[[NDArray[np.float64]], NDArray[np.float64]] = lambda ratios: ratios,
    ) -> Estimate:
        """Estimate a ratio of sums over clusters.

        Args:
            numerators: `(C,)`.
            denominators: `(C,)`.
            n: Number of things that the estimate is a mean over.
            transform: Applied to the ratio, such as a root.
        """
        total = float(denominators.sum())
        if total <= 0:
            return Estimate(None, None, n, self.num_clusters)
        value = float(transform(np.array([numerators.sum() / total]))[0])
        above, below = self.resampled_sums(np.column_stack([numerators, denominators])).T
        ratios = np.divide(above, below, out=np.full_like(below, np.nan), where=below > 0)
        return self.estimate(value, transform(ratios), n)

    def rate(self, above: ArrayLike, below: ArrayLike, cluster_of: NDArray[np.int64] | None = None) -> Estimate:
        """Estimate a ratio of sums over rows, `(N,)` each, of which the second are counts; see `sums` and `ratio`."""
        counts = self.sums(below, cluster_of)
        return self.ratio(self.sums(above, cluster_of), counts, round(float(counts.sum())))

    def estimate(self, value: float, resampled: NDArray[np.float64], n: int) -> Estimate:
        """Return an estimate of which the value in each resample, `(R,)`, is known; NaN where there is none."""
        return Estimate(value, percentile_interval(resampled, self.num_clusters), n, self.num_clusters, resampled)

    def median(self, values: ArrayLike) -> Estimate:
        """Estimate the median over all rows: the mean of the two values in the middle, as in every resample.

        Args:
            values: `(N,)`, a row as the bootstrap's; infinite ones are allowed.
        """
        rows = np.asarray(values, np.float64)
        if not rows.size:
            return Estimate(None, None, 0, self.num_clusters)
        order = np.argsort(rows, kind="stable")
        num_up_to = np.cumsum(self.draws[:, self.cluster_of[order]], axis=1)  # (R, N)
        total = num_up_to[:, -1:]
        places = [(num_up_to <= middle).sum(axis=1) for middle in ((total - 1) // 2, total // 2)]
        return self.estimate(float(np.median(rows)), rows[order][np.stack(places)].mean(axis=0), rows.size)

    def weighted_median(
        self, values: NDArray[np.float64], weights: NDArray[np.float64], cluster_of: NDArray[np.int64]
    ) -> Estimate:
        """Estimate a weighted median.

        Args:
            values: `(V,)`.
            weights: `(V,)`.
            cluster_of: `(V,)` index of each value's cluster.
        """
        order = np.argsort(values, kind="stable")
        ordered, its_weights, its_clusters = values[order], weights[order], cluster_of[order]
        medians = []
        for counts in self._blocks():
            for row in counts:
                cumulated = np.cumsum(row[its_clusters] * its_weights)
                is_drawn = cumulated[-1] > 0
                medians.append(ordered[np.searchsorted(cumulated, cumulated[-1] / 2)] if is_drawn else np.nan)
        return self.estimate(float(weighted_quantiles(values, weights, [0.5])[0]), np.array(medians), len(values))

    def _blocks(self) -> tuple[NDArray[np.uint8], ...]:
        return _counts(self._strata.tobytes(), self._num_resamples, self._seed)


def _places(values: Sequence[Any] | NDArray[Any]) -> tuple[NDArray[np.int64], int]:
    """Return the place of each value among the different ones in order, and their number.

    `np.unique` would do so, too, and first import 15 ms of NumPy's masked arrays.
    """
    place_of = {value: place for place, value in enumerate(sorted(set(values)))}
    return np.array([place_of[value] for value in values], np.int64), len(place_of)


# The same houses are resampled for every agent and every measure, and for each of up to a dozen kinds of its stages:
# drawing takes as long as summing several times.
@lru_cache(maxsize=12)
def _counts(strata: bytes, num_resamples: int, seed: int) -> tuple[NDArray[np.uint8], ...]:
    """Draw how often each cluster is in each resample, with replacement and each stratum by itself.

    Returns:
        `(r, C)` blocks, R rows in all. That a cluster is drawn more than 255 times is less likely than 1e-500.
    """
    stratum_of = np.frombuffer(strata, dtype=np.int64)
    stream = np.random.PCG64(seed).state["state"]
    state, increment = stream["state"], stream["inc"]
    members = [np.flatnonzero(stratum_of == stratum) for stratum in np.flatnonzero(np.bincount(stratum_of))]
    block = max(1, MAX_RESAMPLE_CELLS // max(1, len(stratum_of)))
    blocks = []
    for start in range(0, num_resamples, block):
        counts = np.zeros((min(block, num_resamples - start), len(stratum_of)), np.uint8)
        for indices in members:
            drawn, state = _core.draw_counts(state, increment, num_clusters=len(indices), num_resamples=len(counts))
            counts[:, indices] = drawn
        blocks.append(counts)
    return tuple(blocks)


def weighted_quantiles(
    values: NDArray[np.float64], weights: NDArray[np.float64], shares: Sequence[float]
) -> NDArray[np.float64]:
    """Return the least value that at least each share of the weight does not exceed; the mean of two where it is exact.

    With equal weights and share 0.5 this is the plain median.
    """
    order = np.argsort(values, kind="stable")
    ordered, cumulated = values[order], np.cumsum(weights[order])
    wanted = np.asarray(shares) * cumulated[-1]
    slack = 1e-9 * cumulated[-1]
    low = np.searchsorted(cumulated, wanted - slack)
    high = np.searchsorted(cumulated, wanted + slack)
    last = len(ordered) - 1
    return np.asarray((ordered[np.minimum(low, last)] + ordered[np.minimum(high, last)]) / 2)


def effective_size(weights: NDArray[np.float64]) -> float:
    """Return Kish's number of equally weighted units that tell as much: `(sum w)^2 / sum w^2`."""
    squares = float(np.square(weights).sum())
    return float(weights.sum()) ** 2 / squares if squares > 0 else 0.0
