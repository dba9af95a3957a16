"""The page of a sweep: its tables, and links to the reports of its cells."""

import os
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from evonav.parallel.folders import write_atomically
from evonav.report.pages.template import page_text, text_of
from evonav.report.tables.table import Table


def write_sweep_page(out_dir: Path, name: str, tables: Sequence[Table], reports: Sequence[tuple[str, Path]]) -> Path:
    """Write `report.html`.

    Args:
        out_dir: Folder to write.
        name: Name of the sweep.
        tables: Tables of `evonav.sweeps.tables.sweep_tables`.
        reports: Name and report of each cell.

    Returns:
        The page.

    Raises:
        StoreError: It cannot be written.
    """
    cells = [(cell, quote(os.path.relpath(path, out_dir).replace(os.sep, "/"))) for cell, path in reports]
    text = page_text("sweep.html.j2", text_of("report.css"), name=name, tables=tables, cells=cells)
    return write_atomically(out_dir / "report.html", text)
