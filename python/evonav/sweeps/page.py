"""The page of a sweep: its tables, and links to the reports of its cells."""

import os
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from evonav.parallel.folders import write_atomically
from evonav.report.pages.template import page_text, text_of
from evonav.report.plots.render import plot_elements
from evonav.report.plots.style import plot_css
from evonav.sweeps.plots import cell_words, sweep_plots, swept_axes
from evonav.sweeps.summary import SweepRow
from evonav.sweeps.tables import sweep_tables


def write_sweep_page(out_dir: Path, name: str, rows: Sequence[SweepRow], reports: Sequence[tuple[str, Path]]) -> Path:
    """Write `report.html`: a plot of what was swept, tables, and links to the reports of cells.

    Args:
        rows: Rows of `evonav.sweeps.summary.sweep_rows`.

    Returns:
        The page.

    Raises:
        StoreError: It cannot be written.
    """
    axes = swept_axes([row for row in rows if row.cell])
    titles = {row.cell: cell_words(row, axes) for row in rows if row.cell}
    cells = [
        (titles.get(cell, cell), cell, quote(os.path.relpath(path, out_dir).replace(os.sep, "/")))
        for cell, path in reports
    ]
    plots = plot_elements(sweep_plots(rows), are_even=True)
    css = text_of("report.css") + plot_css()
    text = page_text("sweep.html.j2", css, name=name, tables=sweep_tables(rows), cells=cells, plots=plots)
    return write_atomically(out_dir / "report.html", text)
