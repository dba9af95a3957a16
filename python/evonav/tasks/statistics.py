"""`statistics.json`: what a set of tasks is like, as `evonav tasks stats` leaves it and its figures read it."""

from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, NonNegativeInt

from evonav.tasks.records import Record

Range = tuple[float, float]


class Estimate(Record):
    """A figure over tasks."""

    value: float
    ci95: Range | None
    """`None` where nothing varies."""


class Measure(Record):
    """A share, mean or median."""

    key: str
    label: str
    group: str
    unit: Literal["share", "m", "stages", "median share", "goals"]
    n: NonNegativeInt
    """What the figure is of: tasks, transitions, goals."""
    raw: Estimate | None
    """`None` where there is nothing to count."""
    interval: Literal["wilson", "bootstrap"]
    """Of `raw`: Wilson's for shares of tasks, else a percentile bootstrap over houses. Reweighted: always bootstrap."""
    reweighted: Estimate | None = None
    paper: float | None = None
    """Published."""
    expected: float | None = None
    """What the published process gives, worked out; for the rest, what our reading of it gave in a trial without
    pictures and refusals."""
    accepted: Range | None = None
    """Where it is to lie."""


class Test(Record):
    """A chi-square test of counts against shares."""

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
    """Of the reweighted shares, counted as often as the effective number of tasks allows."""


class Distribution(Record):
    """How often each of some things is; shares are of their sum."""

    key: str
    label: str
    names: tuple[str, ...]
    counts: tuple[NonNegativeInt, ...]
    reweighted_shares: tuple[NonNegativeFloat, ...] | None = None


class Quantity(Record):
    """A quantity's spread."""

    key: str
    label: str
    unit: str
    n: NonNegativeInt
    mean: float
    quantiles: tuple[float, float, float, float, float, float, float]
    """At 0, 5, 25, 50, 75, 95 and 100%."""
    reweighted_mean: float | None = None
    reweighted_median: float | None = None


class Stratum(Record):
    """Houses of a kind, and how many there are to be."""

    name: str
    target_share: float
    task_share: float


class Weighting(Record):
    """How tasks were reweighted."""

    mix: str
    by: str
    covered_share: float
    """Part of the mix that the tasks have at all."""
    num_left_out: NonNegativeInt
    """Tasks in houses that the mix has none of."""
    effective_num_tasks: float
    strata: tuple[Stratum, ...]


class TaskStatistics(Record):
    """The whole."""

    schema_version: Literal[1] = 1
    sources: tuple[str, ...]
    """Folders, as given."""
    generators: tuple[str, ...]
    seeds: tuple[int, ...]
    num_tasks: NonNegativeInt
    num_houses: NonNegativeInt
    num_stages: NonNegativeInt
    parameters: tuple[str, ...]
    """Θ as JSON, each once."""
    weighting: Weighting | None
    measures: tuple[Measure, ...]
    tests: tuple[Test, ...]
    distributions: tuple[Distribution, ...]
    quantities: tuple[Quantity, ...]

    def measure(self, key: str) -> Measure:
        """A measure by its key."""
        return next(one for one in self.measures if one.key == key)

    def test(self, key: str) -> Test | None:
        """A test by its key; `None` where there was too little to test."""
        return next((one for one in self.tests if one.key == key), None)

    def distribution(self, key: str) -> Distribution | None:
        """A distribution by its key; `None` where nothing was counted."""
        return next((one for one in self.distributions if one.key == key), None)

    def quantity(self, key: str) -> Quantity | None:
        """A quantity by its key; `None` where none was noted."""
        return next((one for one in self.quantities if one.key == key), None)
