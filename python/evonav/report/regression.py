"""Compare figures of two runs of the same measurement: which became worse by more than chance explains."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from evonav.statistics import ClusterBootstrap, Interval

COST_FACTOR = 1.25
"""Growth of a time or a size from which it counts as worse."""
RATE_STEP = 0.05
"""Loss of a rate of 0 to 1 from which it counts as worse."""
NUM_RESAMPLES = 2000

Kind = Literal["cost", "rate"]


@dataclass(frozen=True, slots=True)
class Figure:
    """One number of a run."""

    value: float
    by_house: Mapping[str, float] = field(default_factory=dict)
    """The same number of each house alone, where it is known."""
    kind: Kind = "cost"
    """Less of a cost is better, and its factor counts; more of a rate of 0 to 1 is better, by its difference."""


@dataclass(frozen=True, slots=True)
class Change:
    """One number before and now."""

    name: str
    before: Figure
    now: Figure
    is_worse: bool

    def __str__(self) -> str:
        """Return the change in words: `path, ms: 0.07 -> 0.15 (2.14 times as much)`."""
        before, now = self.before.value, self.now.value
        if self.now.kind == "rate":
            return f"{self.name}: {before:.3f} -> {now:.3f} ({now - before:+.3f})"
        factor = f"{now / before:.2f} times as much" if before > 0 else "from nothing"
        return f"{self.name}: {before:.3g} -> {now:.3g} ({factor})"


def changes(before: Mapping[str, Figure], now: Mapping[str, Figure]) -> list[Change]:
    """Compare the figures that both runs have.

    A cost is worse if it has grown by more than a quarter, a rate if it has fallen by more than 0.05. Where both runs
    know at least two of the same houses, the change within houses must be worse by the whole of its 95% interval, too.

    Returns:
        In the order of `now`; figures that only one run has are left out.
    """
    return [
        Change(name, before[name], figure, _is_worse(before[name], figure))
        for name, figure in now.items()
        if name in before
    ]


def _is_worse(before: Figure, now: Figure) -> bool:
    interval = _change_ci95(before, now)
    if now.kind == "rate":
        return now.value < before.value - RATE_STEP and (interval is None or interval[1] < 0)
    return now.value > COST_FACTOR * before.value and (interval is None or interval[0] > 0)


def _change_ci95(before: Figure, now: Figure) -> Interval | None:
    """Return the interval of the mean change within houses: of a cost's logarithm, of a rate itself."""
    houses = [house for house in now.by_house if house in before.by_house]
    old = np.array([before.by_house[house] for house in houses], np.float64)
    new = np.array([now.by_house[house] for house in houses], np.float64)
    if now.kind == "cost":
        is_positive = (old > 0) & (new > 0)
        houses = [house for house, is_known in zip(houses, is_positive, strict=True) if is_known]
        old, new = np.log(old[is_positive]), np.log(new[is_positive])
    if len(houses) < 2:
        return None
    return ClusterBootstrap(houses, num_resamples=NUM_RESAMPLES).column_means((new - old)[:, None])[0].ci95
