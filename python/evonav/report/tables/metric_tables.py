"""Build the tables of metrics that explain the rates (docs/metrics.md)."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from evonav.counted import counted
from evonav.evaluation.metrics.aggregate import METRICS, explain
from evonav.evaluation.metrics.navigation import house_of
from evonav.evaluation.metrics.stage_metrics import StageMetrics
from evonav.evaluation.metrics.stage_rows import read_stage_metrics
from evonav.evaluation.records.store import RunStore
from evonav.report.tables.numbers import estimate_text
from evonav.report.tables.table import STRICT_NOTE, Table

TITLES = {
    "success": "Success, by several definitions",
    "staleness": "Stale beliefs",
    "memory": "Memory against the objects seen so far",
    "costs": "What a stage costs",
}
"""Titles of the tables, by kind of metric."""
_DIGITS = {"%": 1, "": 1, "m": 2, "rounds": 1, "s": 3, "$": 4, "MB": 0}


def measures_tables(run_dir: Path, agents: Sequence[str] | None = None) -> list[Table]:
    """Build one table per kind of metric; one row per metric, one column per agent: in the order of `agents`."""
    with RunStore(run_dir) as store:
        rows = read_stage_metrics(store, agents)
    if agents is not None:
        rank = {agent: i for i, agent in enumerate(agents)}
        rows.sort(key=lambda row: rank[row.agent])
    return [measures_table(rows, kind) for kind in METRICS]


def measures_table(rows: Sequence[StageMetrics], kind: str) -> Table:
    """Build the table of one kind of metric, a key of `METRICS`, from the rows of a run."""
    found = explain(rows, METRICS[kind])
    totals = {agent: sum(row.is_scored for row in rows if row.agent == agent) for agent in found}
    lines = []
    for index, metric in enumerate(METRICS[kind]):
        cells = {agent: metrics[index] for agent, metrics in found.items()}
        if any(cell.value is not None for cell in cells.values()):
            name = f"{metric.label}, {metric.unit}" if metric.unit else metric.label
            written = partial(estimate_text, scale=100 if metric.unit == "%" else 1, digits=_DIGITS[metric.unit])
            lines.append((name, *(written(cell, has_n=cell.n != totals[agent]) for agent, cell in cells.items())))
    houses = {agent: len({house_of(row) for row in rows if row.agent == agent and row.is_scored}) for agent in found}
    sizes = "; ".join(
        f"{agent} {counted(totals[agent], 'stage')} of {counted(houses[agent], 'house')}" for agent in found
    )
    note = f"{sizes}. 95% bootstrap over houses. In parentheses: how many stages have a value, if not all."
    notes = (note, STRICT_NOTE) if kind == "success" else (note,)
    return Table(TITLES[kind], ("Measure", *found), tuple(lines), notes)
