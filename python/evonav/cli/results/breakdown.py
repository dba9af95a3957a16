"""`evonav breakdown`: rates by kind of stage."""

from pathlib import Path
from typing import Annotated

import typer


def breakdown(
    runs: Annotated[
        list[str], typer.Argument(help="Runs or sweeps (all agents), RUN:AGENT, or a run and then names of its agents.")
    ],
    by: Annotated[
        list[str] | None,
        typer.Option(
            help="stratum, mode, path-length, earlier-stages, room-count, category, radius, or any field of a stage's "
            "row; repeat it for more. Default: all of these."
        ),
    ] = None,
    measure: Annotated[str, typer.Option(help="Any numeric field of a stage's row.")] = "success",
    md: Annotated[Path | None, typer.Option(help="Markdown file to write.")] = None,
    latex: Annotated[Path | None, typer.Option(help="LaTeX file to write (booktabs, graphicx).")] = None,
    csv: Annotated[Path | None, typer.Option(help="CSV file to write, unrounded.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Plots to write: .svg, .png or .pdf file (extra `viz`).")] = None,
) -> None:
    """Shows rates by kind of stage, each with n and a 95% interval by house."""
    from rich.console import Console

    from evonav.parallel.folders import write_atomically
    from evonav.report.compare import breakdown as made
    from evonav.report.compare.selection import read_compared_agents
    from evonav.report.plots.render import check_plot, write_plots

    if plot is not None:
        check_plot(plot)
    sides = read_compared_agents(runs)
    found = [made.breakdown(sides, name, measure) for name in by or made.STANDARD]
    found = [one for one in found if one.groups]
    tables = [made.breakdown_table(one) for one in found]
    console = Console()
    for one in found:
        console.print(made.breakdown_table(one, is_brief=True).rich())
    texts = (
        (md, "\n".join(f"## {table.title}\n\n{table.markdown()}" for table in tables)),
        (latex, "\n".join(table.latex() for table in tables)),
        (csv, made.breakdown_csv(found)),
    )
    for path, text in texts:
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(path, text)
            typer.echo(f"written: {path}")
    if plot is not None:
        typer.echo(f"written: {write_plots([made.breakdown_plot(one) for one in found], plot)}")
