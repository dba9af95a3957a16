"""`evonav measures`: what explains a run's rates."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.options.shared import RunFolder


def measures(
    run: RunFolder,
    agents: Annotated[str | None, typer.Option(help="Only these, comma-separated, in this order.")] = None,
    out: Annotated[Path | None, typer.Option(help="Markdown file to write, too.")] = None,
) -> None:
    """Shows success by several definitions, stale entries believed, memory, and what a stage costs."""
    from rich.console import Console

    from evonav.parallel.folders import write_atomically
    from evonav.report.tables.metric_tables import measures_tables

    names = None if agents is None else [name.strip() for name in agents.split(",") if name.strip()]
    tables = [table for table in measures_tables(run, names) if table.rows]
    console = Console()
    for table in tables:
        console.print(table.rich())
    if out is not None:
        write_atomically(out, "\n".join(f"## {table.title}\n\n{table.markdown()}" for table in tables))
        typer.echo(f"tables: {out}")
