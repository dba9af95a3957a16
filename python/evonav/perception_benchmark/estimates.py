"""Ratios over houses with their intervals: what all figures of a perception are made of."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.perception_benchmark.records import TaskRecord
from evonav.significance import Interval, percentile_interval, resampled_counts

NUM_RESAMPLES = 2000


@dataclass(frozen=True, slots=True)
class Estimate:
    """A figure."""

    value: float | None
    interval: Interval | None
    """95%, bootstrap by house; `None` of one house."""
    n: int
    """What it is a mean over."""
    drawn: NDArray[np.float64] | None = field(default=None, repr=False, compare=False)
    """In every resample of the houses, the same for all perceptions; `None` without an interval."""

    def less(self, other: "Estimate", num_houses: int) -> "Estimate":
        """By how much it is ahead of another perception's, over the same views.

        Args:
            other: The same figure.
            num_houses: That both are of.

        Returns:
            The difference; its interval is of the differences within resamples, and its n the smaller one.
        """
        n = min(self.n, other.n)
        if self.value is None or other.value is None:
            return Estimate(None, None, n)
        value = self.value - other.value
        if self.drawn is None or other.drawn is None:
            return Estimate(value, None, n)
        return estimate(value, self.drawn - other.drawn, n, num_houses)


def estimate(value: float, drawn: NDArray[np.float64], n: int, num_houses: int) -> Estimate:
    """A figure with its interval.

    Args:
        value: Of all houses.
        drawn: `(R,)` in resamples; NaN where there is none.
        n: What it is a mean over.
        num_houses: That were resampled.
    """
    if num_houses < 2 or np.isnan(drawn).all():
        return Estimate(value, None, n)
    low, high = percentile_interval(drawn[:, None], num_houses)[0]
    return Estimate(value, (float(low), float(high)), n, drawn)


@dataclass(frozen=True, slots=True)
class Group:
    """Objects and detections of one kind."""

    name: str
    measures: Mapping[str, Estimate]


class Houses:
    """The houses of some records, resampled once: measures of one perception move together."""

    def __init__(self, records: Sequence[TaskRecord], seed: int) -> None:
        """Draws.

        Args:
            records: A task each; tasks of one house are drawn together.
            seed: Of the bootstrap.
        """
        names = sorted({record.house for record in records})
        index = {house: i for i, house in enumerate(names)}
        self.num = len(names)
        self.of_task = np.array([index[record.house] for record in records], np.int64)
        """`(tasks,)`."""
        strata = np.zeros(len(names), np.int64)
        self.draws = np.concatenate(list(resampled_counts(strata, num_resamples=NUM_RESAMPLES, seed=seed)))
        """`(NUM_RESAMPLES, H)` how often each house is drawn."""

    def sums(self, houses: NDArray[np.int64], weights: NDArray[Any] | None = None) -> NDArray[np.float64]:
        """`(H,)` sums of weights (default: 1) by house.

        Args:
            houses: `(N,)`.
            weights: `(N,)`.
        """
        values = np.ones(len(houses)) if weights is None else weights.astype(np.float64)
        return np.bincount(houses, values, minlength=self.num).astype(np.float64)

    def task_sums(self, values: Sequence[float]) -> NDArray[np.float64]:
        """`(H,)` sums of a value a task."""
        return self.sums(self.of_task, np.array(values, np.float64))

    def ratio(
        self,
        tops: NDArray[np.float64],
        bottoms: NDArray[np.float64],
        n: int,
        shape: Callable[[NDArray[np.float64]], NDArray[np.float64]] = lambda values: values,
    ) -> Estimate:
        """A ratio of sums over houses.

        Args:
            tops: `(H,)`.
            bottoms: `(H,)`.
            n: To be told with it.
            shape: Of the ratio, such as its root.
        """
        total = float(bottoms.sum())
        if total <= 0:
            return Estimate(None, None, n)
        value = float(shape(np.array([tops.sum() / total]))[0])
        if self.num < 2:
            return Estimate(value, None, n)
        sums = self.draws @ bottoms
        drawn = np.divide(self.draws @ tops, sums, out=np.full_like(sums, np.nan), where=sums > 0)
        return estimate(value, shape(drawn), n, self.num)
