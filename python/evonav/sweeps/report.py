"""Show a sweep: its tables and files, plots of what was swept, and a page with links to the reports of its cells."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from evonav.parallel.folders import write_atomically
from evonav.report.export import csv_text
from evonav.report.pages.template import page_text, text_of
from evonav.report.plots.render import plot_elements
from evonav.report.plots.specs import GroupPlot, Series
from evonav.report.plots.style import plot_css
from evonav.report.tables.numbers import rate, scaled
from evonav.report.tables.table import INTERVALS, Table, markdown_tables, short_names, shortened
from evonav.sweeps.summary import AXES, STATES, SweepRow


def write_sweep_files(out: Path, rows: Sequence[SweepRow], content: Mapping[str, Any]) -> None:
    """Write `summary.json`, `summary.csv` and `summary.md` of a sweep."""
    write_atomically(out / "summary.json", json.dumps(content, indent=2, sort_keys=True) + "\n")
    write_atomically(out / "summary.csv", sweep_csv(rows))
    title = content["name"] or out.resolve().name
    write_atomically(out / "summary.md", f"# {title}\n\n{markdown_tables(sweep_tables(rows))}")


def sweep_tables(rows: Sequence[SweepRow]) -> list[Table]:
    """Return a table of cells, and one over seeds if there are several; axes with one value are left out."""
    cells = [row for row in rows if row.cell]
    axes = swept_axes(cells)
    seeds = [row for row in rows if not row.cell]
    tables = [_table("Cells", cells, axes)]
    if seeds:
        tables.append(_table("Over seeds", seeds, [axis for axis in axes if axis != "seed"]))
    return tables


def sweep_csv(rows: Sequence[SweepRow]) -> str:
    """Return CSV with a line per row; rates are fractions."""
    ends = [f"{measure}_{end}" for measure in ("sr", "spl") for end in ("mean", "low95", "high95")]
    columns = ["cell", *AXES, "agent", "n", "num_stages", *ends, *STATES, "is_incomplete"]
    lines: list[list[object]] = []
    for row in rows:
        axes = ["all" if axis == "seed" and row.seed is None else getattr(row, axis) for axis in AXES]
        rates = [row.sr, *(row.sr_ci95 or (None, None)), row.spl, *(row.spl_ci95 or (None, None))]
        counts = [row.counts[state] for state in STATES]
        lines.append([row.cell, *axes, row.agent, row.n, row.num_stages, *rates, *counts, row.is_incomplete])
    return csv_text(columns, lines)


def _table(title: str, rows: Sequence[SweepRow], axes: Sequence[str]) -> Table:
    columns = ("Agent", *axes, "SR % [95% CI]", "SPL % [95% CI]", "n", "stages")
    lines = tuple(
        (
            row.agent,
            *(str(getattr(row, axis)) for axis in axes),
            rate(row.sr, row.sr_ci95),
            rate(row.spl, row.spl_ci95),
            str(row.n),
            f"all {row.num_stages}" if not row.is_incomplete else f"{_missing(row)}, incomplete",
        )
        for row in rows
    )
    notes = [INTERVALS]
    if any(row.is_incomplete for row in rows):
        notes.append("Incomplete: some stages errored or were not run; their rates are not final.")
    return Table(title, columns, lines, tuple(notes))


def _missing(row: SweepRow) -> str:
    errored = row.counts["errored"]
    not_run = row.num_stages - row.n - errored
    parts = [f"{count} {state}" for count, state in ((errored, "errored"), (not_run, "not run")) if count]
    return f"{row.n} of {row.num_stages} ({', '.join(parts)})"


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
    names = short_names(row.agent for row in rows)
    for agent in dict.fromkeys(row.agent for row in rows):
        by_group = {cell_words(row, axes): row for row in rows if row.agent == agent}
        there = [by_group.get(group) for group in groups]
        values = [None if row is None else getattr(row, measure) for row in there]
        intervals = [None if row is None else getattr(row, f"{measure}_ci95") for row in there]
        percents = tuple(None if value is None else 100 * value for value in values)
        found.append(Series(names.get(agent, agent), percents, tuple(map(scaled, intervals))))
    return tuple(found)


def write_sweep_page(out_dir: Path, name: str, rows: Sequence[SweepRow], reports: Sequence[tuple[str, Path]]) -> Path:
    """Write `report.html`: a plot of what was swept, tables, and links to the reports of cells."""
    axes = swept_axes([row for row in rows if row.cell])
    titles = {row.cell: cell_words(row, axes) for row in rows if row.cell}
    cells = [
        (titles.get(cell, cell), cell, quote(os.path.relpath(path, out_dir).replace(os.sep, "/")))
        for cell, path in reports
    ]
    plots = plot_elements(sweep_plots(rows), are_even=True)
    css = text_of("report.css") + plot_css()
    tables = shortened(sweep_tables(rows))
    text = page_text("sweep.html.j2", css, name=name, tables=tables, cells=cells, plots=plots)
    return write_atomically(out_dir / "report.html", text)
