"""A row of a sweep's summary: what reports show of one."""

from collections.abc import Mapping
from dataclasses import dataclass

from evonav.evaluation.records.schema import EndState
from evonav.statistics import Interval

AXES = ("simulator", "perception", "decision", "tasks", "seed")
STATES = ("success", "failure", "errored", "not_run")
"""End states of a stage, in the order of tables."""


@dataclass(frozen=True, slots=True)
class SweepRow:
    """An agent in a cell, or over the seeds of cells."""

    cell: str
    """Empty over seeds."""
    simulator: str
    perception: str
    decision: str
    tasks: str
    seed: int | None
    """`None`: over all of them."""
    agent: str
    n: int
    """Scored stages."""
    num_stages: int
    sr: float | None
    sr_ci95: Interval | None
    spl: float | None
    spl_ci95: Interval | None
    counts: Mapping[str, int]
    """Stages by end state; one that was not begun is not run."""

    @property
    def is_incomplete(self) -> bool:
        """Some stage is errored or not run: no rate may be quoted as final."""
        return self.n + self.counts.get(EndState.GUIDED.value, 0) != self.num_stages
