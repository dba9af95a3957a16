"""The page of a sweep: its tables, and links to the reports of its cells."""

import os
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from evonav.errors import StoreError
from evonav.report.pages.template import page_environment, policy, text_of
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
    css = text_of("report.css")
    cells = [(cell, quote(os.path.relpath(path, out_dir).replace(os.sep, "/"))) for cell, path in reports]
    page = page_environment().get_template("sweep.html.j2")
    path = out_dir / "report.html"
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
        text = page.render(name=name, css=css, policy=policy((css,)), tables=tables, cells=cells)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise StoreError(f"{path}: {error}") from error
    return path
