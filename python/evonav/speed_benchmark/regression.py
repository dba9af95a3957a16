"""Compare times of two runs of the same measurement: which became worse by more than chance explains."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from evonav.statistics import ClusterBootstrap, Interval

FACTOR = 1.25
"""Growth of a time from which on it counts as worse."""
NUM_RESAMPLES = 2000


@dataclass(frozen=True, slots=True)
class Figure:
    """One time of a run, or its ratio to a peer's."""

    value: float
    by_house: Mapping[str, float] = field(default_factory=dict)
    """The same number of each house alone, where it is known."""


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
        factor = f"{now / before:.2f} times as much" if before > 0 else "from nothing"
        return f"{self.name}: {before:.3g} -> {now:.3g} ({factor})"


def changes(before: Mapping[str, Figure], now: Mapping[str, Figure]) -> list[Change]:
    """Compare the figures that both runs have.

    A figure is worse if it has grown by more than a quarter. Where both runs know at least two of the same houses, it
    must have grown within houses by the whole of the 95% interval, too.

    Returns:
        In the order of `now`; figures that only one run has are left out.
    """
    return [
        Change(name, before[name], figure, _is_worse(before[name], figure))
        for name, figure in now.items()
        if name in before
    ]


def _is_worse(before: Figure, now: Figure) -> bool:
    interval = _growth_ci95(before, now)
    return now.value > FACTOR * before.value and (interval is None or interval[0] > 0)


def _growth_ci95(before: Figure, now: Figure) -> Interval | None:
    """Return the interval of the mean growth within houses, as a logarithm."""
    houses = [house for house, value in now.by_house.items() if value > 0 and before.by_house.get(house, 0.0) > 0]
    if len(houses) < 2:
        return None
    growth = np.log([now.by_house[house] / before.by_house[house] for house in houses])
    return ClusterBootstrap(houses, num_resamples=NUM_RESAMPLES).column_means(growth[:, None])[0].ci95
