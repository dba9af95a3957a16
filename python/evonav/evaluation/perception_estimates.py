"""Ratios over houses with their intervals: what all figures of a perception are made of."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.evaluation.perception_records import TaskRecord
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
        return Estimate(value, self.interval(shape(drawn)), n)

    def interval(self, drawn: NDArray[np.float64]) -> Interval | None:
        """Ends of resampled values."""
        if self.num < 2 or np.isnan(drawn).all():
            return None
        low, high = percentile_interval(drawn[:, None], self.num)[0]
        return (float(low), float(high))
