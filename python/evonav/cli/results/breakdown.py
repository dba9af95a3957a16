"""`evonav breakdown`: show rates by kind of stage."""

from typing import Annotated

import typer

from evonav.cli.display import show_tables, write_texts
from evonav.cli.options.shared import ComparedRuns, CsvFile, LatexFile, MarkdownFile, PlotFile, listed


def breakdown(
    runs: ComparedRuns,
    by: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FIELD",
            help="Kind of stage: stratum, mode, path-length, earlier-stages, room-count, category, radius or any "
            "column of `evonav export`. Repeat the option for more, or separate them by commas. Default: all of "
            "these.",
        ),
    ] = None,
    measure: Annotated[
        str, typer.Option(metavar="FIELD", help="What to average: a numeric column that `evonav export` writes.")
    ] = "success",
    md: MarkdownFile = None,
    latex: LatexFile = None,
    csv: CsvFile = None,
    plot: PlotFile = None,
) -> None:
    """Show rates by kind of stage, such as by room count.

    Each rate has its number of stages and a 95% interval over houses.
    """
    from evonav.report.compare import breakdown as made
    from evonav.report.compare.selection import read_compared_agents
    from evonav.report.plots.render import check_plot, write_plots
    from evonav.report.tables.table import latex_tables, markdown_tables

    if plot is not None:
        check_plot(plot)
    compared = read_compared_agents(runs)
    found = [made.breakdown(compared, name, measure) for name in listed(by) or made.STANDARD]
    found = [one for one in found if one.groups]
    tables = [made.breakdown_table(one) for one in found]
    show_tables(made.breakdown_table(one, is_brief=True) for one in found)
    write_texts(
        (md, lambda: markdown_tables(tables)),
        (latex, lambda: latex_tables(tables)),
        (csv, lambda: made.breakdown_csv(found)),
    )
    if plot is not None:
        typer.echo(f"written: {write_plots([made.breakdown_plot(one) for one in found], plot)}")
