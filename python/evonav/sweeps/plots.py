"""Plot a sweep: SR and SPL of each agent over what was swept."""

from collections.abc import Sequence

from evonav.report.plots.specs import GroupPlot, Series
from evonav.report.tables.numbers import scaled
from evonav.sweeps.summary import AXES, SweepRow

MAX_GROUPS = 16
"""Largest number of cells in a plot."""


def sweep_plots(rows: Sequence[SweepRow]) -> list[GroupPlot]:
    """Return plots of SR and SPL by cell; seeds of a cell are pooled. Without scored cells there is none."""
    shown = _pooled(rows)
    axes = [axis for axis in swept_axes(shown) if axis != "seed"]
    groups = list(dict.fromkeys(cell_words(row, axes) for row in shown))[:MAX_GROUPS]
    if not any(row.sr is not None for row in shown):
        return []
    by = " and ".join(axes) or "agent"
    return [
        GroupPlot(f"SR by {by}", tuple(groups), _series(shown, axes, groups, "sr"), "SR, %"),
        GroupPlot(f"SPL by {by}", tuple(groups), _series(shown, axes, groups, "spl"), "SPL, %"),
    ]


def swept_axes(rows: Sequence[SweepRow]) -> list[str]:
    """Return the axes of which rows have more than one value."""
    return [axis for axis in AXES if len({getattr(row, axis) for row in rows}) > 1]


def cell_words(row: SweepRow, axes: Sequence[str]) -> str:
    """Return the name of a cell: its values of the swept axes, such as `noisy-0.1, seed 2`."""
    values = (f"seed {row.seed}" if axis == "seed" else str(getattr(row, axis)) for axis in axes)
    return ", ".join(values) or "all tasks"


def _pooled(rows: Sequence[SweepRow]) -> list[SweepRow]:
    """Return the rows over seeds, and those of cells with a single seed."""
    over_seeds = [row for row in rows if not row.cell]
    covered = {_key(row) for row in over_seeds}
    return over_seeds + [row for row in rows if row.cell and _key(row) not in covered]


def _key(row: SweepRow) -> tuple[str, ...]:
    return (row.simulator, row.perception, row.decision, row.tasks, row.agent)


def _series(rows: Sequence[SweepRow], axes: Sequence[str], groups: Sequence[str], measure: str) -> tuple[Series, ...]:
    """Return the values of each agent; `measure` is `sr` or `spl`."""
    found = []
    for agent in dict.fromkeys(row.agent for row in rows):
        by_group = {cell_words(row, axes): row for row in rows if row.agent == agent}
        there = [by_group.get(group) for group in groups]
        values = [None if row is None else getattr(row, measure) for row in there]
        intervals = [None if row is None else getattr(row, f"{measure}_ci95") for row in there]
        percents = tuple(None if value is None else 100 * value for value in values)
        found.append(Series(agent, percents, tuple(map(scaled, intervals))))
    return tuple(found)
