"""`evonav measures`: show the metrics that explain a run's rates."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.display import write_texts
from evonav.cli.options.shared import RunFolder, listed


def measures(
    run: RunFolder,
    agents: Annotated[
        str | None, typer.Option(help="Show only these agents, separated by commas, in this order. Default: all.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write the tables to a Markdown file too.")] = None,
) -> None:
    """Show metrics that explain a run's rates: success by several definitions, stale entries, memory and costs."""
    from rich.console import Console

    from evonav.report.tables.metric_tables import measures_tables
    from evonav.report.tables.table import markdown_tables

    names = None if agents is None else listed(agents)
    tables = [table for table in measures_tables(run, names) if table.rows]
    console = Console()
    for table in tables:
        console.print(table.rich())
    write_texts((out, lambda: markdown_tables(tables)), label="tables")
