"""Define `statistics.json`: the statistics of a set of tasks, written by `evonav tasks stats`."""

from typing import Annotated, Literal

from pydantic import Field, NonNegativeFloat, NonNegativeInt

from evonav.tasks.records import Record

Range = tuple[float, float]


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
    unit: Literal["share", "m", "stages", "median share", "goals"]
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

    schema_version: Literal[1] = 1
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
    measures: tuple[Metric, ...]
    tests: tuple[Test, ...]
    distributions: tuple[Distribution, ...]
    quantities: tuple[Quantity, ...]

    def metric(self, key: str) -> Metric:
        """Return a metric by its key."""
        return next(one for one in self.measures if one.key == key)

    def test(self, key: str) -> Test | None:
        """Return a test by its key; `None` if there was too little to test."""
        return next((one for one in self.tests if one.key == key), None)

    def distribution(self, key: str) -> Distribution | None:
        """Return a distribution by its key; `None` if nothing was counted."""
        return next((one for one in self.distributions if one.key == key), None)

    def quantity(self, key: str) -> Quantity | None:
        """Return a quantity by its key; `None` if it was not measured."""
        return next((one for one in self.quantities if one.key == key), None)
