"""Weight a run's houses so that they have the room counts of the paper's houses."""

from collections.abc import Sequence

import numpy as np

from evonav.evaluation.agent_order import agents_in_order
from evonav.evaluation.metrics.navigation import house_of, success_and_spl
from evonav.evaluation.metrics.stage_metrics import StageMetrics
from evonav.evaluation.records.store import RunStore
from evonav.report.paper.tables import PAPER, Perception
from evonav.report.run import RecordedRun
from evonav.report.tables.numbers import NONE, percent, rate
from evonav.report.tables.table import Table
from evonav.statistics import ClusterBootstrap, Estimate
from evonav.tasks.statistics import Reweighting, reweight

COLUMNS = {
    "SR %": None,
    "SPL %": None,
    "SR % stage 1": "stage_1",
    "SR % moved": "relocated",
    "SR % not moved": "not_relocated",
}
"""Columns by the stratum of the stages that count; `None` for all."""


def reweighted_table(runs: Sequence[RecordedRun], mix: str, perception: Perception = "gt") -> Table:
    """Return SR and SPL with the weights that give the houses of some runs the room counts of a data set.

    Args:
        runs: Runs on different tasks, whose maps are recorded.
        mix: Name of the data set: `procthor-10k`, the rooms of the published generator's houses with two rooms or more.
        perception: The half of the paper's tables beside it.

    Raises:
        InvalidArgumentError: The mix is unknown, or has none of the houses.
        StoreError: A run cannot be read.
    """
    num_rooms: dict[str, int] = {}
    for run in runs:
        with RunStore(run.run_dir) as store:  # 0 where a house's map is not recorded
            num_rooms |= dict.fromkeys(run.num_stages, 0) | store.num_rooms()
    tasks = list(num_rooms)
    weighting = reweight(mix, list(num_rooms.values()), [None] * len(tasks))
    by_agent: dict[str, list[StageMetrics]] = {}
    for run in runs:
        for agent, mine in run.rows_by_agent().items():
            by_agent.setdefault(agent, []).extend(mine)
    rows = []
    for agent in agents_in_order(by_agent):
        scored = [row for row in by_agent[agent] if row.is_scored]
        cells = []
        for name, stratum in COLUMNS.items():
            part = [row for row in scored if stratum is None or row.stratum == stratum]
            found = _estimate(part, tasks, weighting, is_spl=name.startswith("SPL"))
            cells.append(NONE if found.value is None else rate(found.value, found.ci95))
        paper = PAPER[perception].get(agent)
        theirs = (NONE, NONE) if paper is None else (percent(paper.sr()), percent(paper.spl))
        rows.append((agent, theirs[0], cells[0], theirs[1], *cells[1:]))
    record = weighting.record
    names = tuple(COLUMNS)
    columns = ("Agent", "SR % paper", names[0], "SPL % paper", *names[1:])
    note = (
        f"Weighted by {record.by} to {mix}: equals {record.effective_num_tasks:.0f} equally weighted tasks of "
        f"{len(tasks)}, covers {100 * record.covered_share:.0f}% of the mix, leaves out {record.num_left_out}. 95% "
        "bootstrap over houses within each number of rooms."
    )
    return Table(f"Reweighted to the rooms of {mix}", columns, tuple(rows), (note,))


def _estimate(
    stages: Sequence[StageMetrics], tasks: Sequence[str], weighting: Reweighting, *, is_spl: bool
) -> Estimate:
    """Return the weighted mean over the stages of some tasks."""
    index_of = {task: index for index, task in enumerate(tasks)}
    indices = np.array([index_of[row.task_id] for row in stages], np.int64)
    weights = weighting.weights[indices]
    is_counted = weights > 0.0
    chosen = [row for row, counts in zip(stages, is_counted, strict=True) if counts]
    if not chosen:
        return Estimate(None, None, 0, 0)
    success, spl = success_and_spl(chosen).T
    values = spl if is_spl else success
    strata = weighting.task_strata[indices][is_counted]
    bootstrap = ClusterBootstrap([house_of(row) for row in chosen], strata=strata)
    sums = bootstrap.sums(np.column_stack([weights[is_counted] * values, weights[is_counted]]))
    return bootstrap.ratio(sums[:, 0], sums[:, 1], len(chosen))
