"""`evonav paper`: a run beside the paper's tables."""

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer


class Half(str, Enum):
    """Of the paper's tables."""

    GT = "gt"
    PREDICTION = "prediction"


def paper(
    run: Annotated[Path, typer.Argument(help="Folder of a run.")],
    perception: Annotated[Half, typer.Option(help="Which half of the paper's tables.")] = Half.GT,
    out: Annotated[Path | None, typer.Option(help="Markdown file to write, too.")] = None,
) -> None:
    """Shows the paper's Tables 1 and 2 and its stage-1 results beside a run's, and the order of agents."""
    from rich.console import Console

    from evonav.folders import write_atomically
    from evonav.report.paper import paper_markdown, paper_tables
    from evonav.report.run import load_run

    loaded = load_run(run)
    console = Console()
    for table in paper_tables(loaded, perception.value):
        console.print(table.rich())
    if out is not None:
        write_atomically(out, paper_markdown(loaded, perception.value))
        typer.echo(f"tables: {out}")
