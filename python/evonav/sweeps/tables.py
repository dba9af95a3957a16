"""The summary of a sweep as tables and files, from its records alone."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from evonav.parallel.folders import write_atomically
from evonav.report.export import csv_text
from evonav.report.tables.numbers import rate
from evonav.report.tables.table import INTERVALS, Table, markdown_tables
from evonav.sweeps.summary import AXES, STATES, SweepRow


def write_sweep_files(out: Path, rows: Sequence[SweepRow], content: Mapping[str, Any]) -> None:
    """Write `summary.json`, `summary.csv` and `summary.md` of a sweep.

    Args:
        content: Content of `summary.json`.

    Raises:
        StoreError: They cannot be written.
    """
    write_atomically(out / "summary.json", json.dumps(content, indent=2, sort_keys=True) + "\n")
    write_atomically(out / "summary.csv", sweep_csv(rows))
    title = content["name"] or out.resolve().name
    write_atomically(out / "summary.md", f"# {title}\n\n{markdown_tables(sweep_tables(rows))}")


def sweep_tables(rows: Sequence[SweepRow]) -> list[Table]:
    """Return a table of cells, and one over seeds if there are several; axes with one value are left out."""
    axes = [axis for axis in AXES if len({getattr(row, axis) for row in rows if row.cell}) > 1]
    cells = [row for row in rows if row.cell]
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
