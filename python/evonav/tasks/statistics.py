"""Define `statistics.json`, the statistics of a set of tasks, and the weights that give tasks a mix of room plans."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, NonNegativeInt

from evonav.errors import InvalidArgumentError
from evonav.records import Record, Version
from evonav.statistics import effective_size

Range = tuple[float, float]
Unit = Literal["share", "m", "stages", "median share", "goals"]


class Estimate(Record):
    """An estimate over tasks."""

    value: float
    ci95: Range | None
    """The 95% confidence interval; `None` where all values are equal."""


class Metric(Record):
    """A share, a mean or a median."""

    key: str
    label: str
    group: str
    unit: Unit
    n: NonNegativeInt
    """Number of tasks, transitions or goals in the estimate."""
    raw: Estimate | None
    """The estimate without weights; `None` without any values."""
    interval: Literal["wilson", "bootstrap"]
    """Method for `raw`: Wilson's for shares of tasks, else a percentile bootstrap over houses.

    Reweighted estimates always use the bootstrap.
    """
    reweighted: Estimate | None = None
    paper: float | None = None
    """The published value."""
    expected: float | None = None
    """The value that the published process gives, if it can be computed.

    For other metrics, the value of our reading in a trial without images and rejections.
    """
    accepted: Range | None = None
    """The accepted range."""


class Test(Record):
    """A chi-square test of counts against expected shares."""

    key: str
    label: str
    cells: tuple[str, ...]
    observed: tuple[NonNegativeInt, ...]
    expected_shares: tuple[NonNegativeFloat, ...]
    paper_shares: tuple[NonNegativeFloat, ...] | None
    statistic: float
    num_degrees: int
    p: Annotated[float, Field(ge=0.0, le=1.0)]
    reweighted_p: float | None = None
    """P-value of the reweighted shares, counted with the effective number of tasks."""


class Distribution(Record):
    """Frequencies of categories; shares refer to their sum."""

    key: str
    label: str
    names: tuple[str, ...]
    counts: tuple[NonNegativeInt, ...]
    reweighted_shares: tuple[NonNegativeFloat, ...] | None = None


class Quantity(Record):
    """The distribution of a quantity."""

    key: str
    label: str
    unit: str
    n: NonNegativeInt
    mean: float
    quantiles: tuple[float, float, float, float, float, float, float]
    """Quantiles at 0, 5, 25, 50, 75, 95 and 100%."""
    reweighted_mean: float | None = None
    reweighted_median: float | None = None


class Stratum(Record):
    """Houses of one kind, with their target share."""

    name: str
    target_share: float
    task_share: float


class Weighting(Record):
    """The weights of the reweighted estimates."""

    mix: str
    by: str
    covered_share: float
    """Share of the target mix for which tasks exist."""
    num_left_out: NonNegativeInt
    """Number of tasks in houses of a kind that the mix does not have."""
    effective_num_tasks: float
    strata: tuple[Stratum, ...]


class TaskStatistics(Record):
    """The content of `statistics.json`."""

    schema_version: Version = 1
    sources: tuple[str, ...]
    """Folders of the tasks, as given on the command line."""
    generators: tuple[str, ...]
    seeds: tuple[int, ...]
    num_tasks: NonNegativeInt
    num_houses: NonNegativeInt
    num_stages: NonNegativeInt
    parameters: tuple[str, ...]
    """Generation parameters as JSON, each distinct set once."""
    weighting: Weighting | None
    metrics: tuple[Metric, ...]
    tests: tuple[Test, ...]
    distributions: tuple[Distribution, ...]
    quantities: tuple[Quantity, ...]

    def metric(self, key: str) -> Metric:
        """Return a metric by its key."""
        return next(one for one in self.metrics if one.key == key)

    def test(self, key: str) -> Test | None:
        """Return a test by its key; `None` if there was too little to test."""
        return next((one for one in self.tests if one.key == key), None)

    def distribution(self, key: str) -> Distribution | None:
        """Return a distribution by its key; `None` if nothing was counted."""
        return next((one for one in self.distributions if one.key == key), None)

    def quantity(self, key: str) -> Quantity | None:
        """Return a quantity by its key; `None` if it was not measured."""
        return next((one for one in self.quantities if one.key == key), None)


PROCTHOR_10K_PLANS = {
    "bedroom-bathroom": (2, 2),
    "kitchen-living-room": (2, 2),
    "kitchen-living-bedroom-room": (3, 1),
    "kitchen-living-bedroom-room2": (3, 1),
    "4-room": (4, 5),
    "2-bed-1-bath": (5, 1),
    "5-room": (5, 1),
    "2-bed-2-bath": (6, 1),
    "7-room-3-bed": (7, 1),
    "8-room-3-bed": (8, 1),
    "12-room": (10, 1),
    "12-room-3-bed": (10, 1),
}
"""Number of rooms and weight of the room plans with at least two rooms, by `metadata.roomSpecId`.

Source: `room_specs.py` of the published generator (procthor 0.0.1.dev2, Apache-2.0); the four plans of one room have
weight 1 each.
"""

ROOM_MIXES = {"procthor-10k": PROCTHOR_10K_PLANS}


@dataclass(frozen=True)
class Reweighting:
    """Weights of tasks by stratum."""

    record: Weighting
    """Description of the weights, for `statistics.json`."""
    weights: NDArray[np.float64]
    """Weight of each task, `(N,)`, mean 1; 0 for houses that the mix does not contain."""
    task_strata: NDArray[np.int64]
    """Index of each task's stratum, `(N,)`; -1 for none."""


def check_mix(mix: str | None) -> None:
    """Check the name of a mix.

    Raises:
        InvalidArgumentError: The name is neither `None` nor one of `ROOM_MIXES`.
    """
    if mix is not None and mix not in ROOM_MIXES:
        raise InvalidArgumentError(f"argument `reweight` is {mix!r}, expected one of {', '.join(ROOM_MIXES)}")


def reweight(mix: str, num_rooms: Sequence[int], plans: Sequence[str | None]) -> Reweighting:
    """Return the weights that give tasks the room plans of a data set.

    Args:
        mix: A key of `ROOM_MIXES`.
        num_rooms: Number of rooms of each task's house.
        plans: `metadata.roomSpecId` of each task's house, if it has one.

    Raises:
        InvalidArgumentError: The mix is unknown, or contains none of the houses.
    """
    check_mix(mix)
    table = ROOM_MIXES[mix]
    rooms_of_tasks = [str(rooms) for rooms in num_rooms]
    by_rooms = _strata({plan: str(rooms) for plan, (rooms, _) in table.items()}, table, rooms_of_tasks)
    by_plan = _strata({plan: plan for plan in table}, table, [str(plan) for plan in plans])
    # Houses with one room are in no mix, so their plans may be unknown.
    num_known = int(sum(plan in table and table[plan][0] == n for plan, n in zip(plans, num_rooms, strict=True)))
    is_by_plan = num_known == int((by_rooms[2] >= 0).sum()) and _covered(by_plan) == _covered(by_rooms)
    names, target, strata = by_plan if is_by_plan else by_rooms
    counts = np.bincount(strata[strata >= 0], minlength=len(names)).astype(np.float64)
    covered = float(target[counts > 0].sum())
    if covered == 0.0:
        raise InvalidArgumentError(f"argument `reweight` is {mix!r}, but no house has as many rooms as its plans")
    factors = np.divide(target, counts, out=np.zeros_like(target), where=counts > 0) / covered * counts.sum()
    weights = np.where(strata >= 0, factors[strata], 0.0)
    task_shares = counts / max(1.0, counts.sum())
    record = Weighting(
        mix=mix,
        by="room plan" if is_by_plan else "number of rooms",
        covered_share=covered,
        num_left_out=int((strata < 0).sum()),
        effective_num_tasks=effective_size(weights),
        strata=tuple(
            Stratum(name=name, target_share=mix_share, task_share=task_share)
            for name, mix_share, task_share in zip(names, target.tolist(), task_shares.tolist(), strict=True)
        ),
    )
    return Reweighting(record, weights, strata)


_Strata = tuple[list[str], NDArray[np.float64], NDArray[np.int64]]
"""Names of the strata, their shares of the mix, and each task's index or -1."""


def _strata(name_of: Mapping[str, str], table: Mapping[str, tuple[int, int]], keys: Sequence[str]) -> _Strata:
    masses: dict[str, float] = {}
    for plan, (_, weight) in table.items():
        masses[name_of[plan]] = masses.get(name_of[plan], 0.0) + weight
    names = list(masses)
    target = np.array(list(masses.values())) / sum(masses.values())
    return names, target, np.array([names.index(key) if key in masses else -1 for key in keys], dtype=np.int64)


def _covered(strata: _Strata) -> float:
    return round(float(strata[1][np.unique(strata[2][strata[2] >= 0])].sum()), 9)
