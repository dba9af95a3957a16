"""`evonav breakdown`: show rates by kind of stage."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.display import show_tables, write_files
from evonav.cli.options.shared import PLOTS, ComparedRuns, files_option, listed


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
    out: Annotated[list[Path] | None, files_option("md", "tex", "csv", *PLOTS)] = None,
) -> None:
    """Show rates by kind of stage, such as by room count.

    Each rate has its number of stages and a 95% interval over houses.
    """
    from evonav.report.compare import breakdown as made
    from evonav.report.compare.selection import read_compared_agents
    from evonav.report.plots.render import check_plot
    from evonav.report.tables.table import latex_tables, markdown_tables

    for path in out or ():
        if path.suffix[1:] in PLOTS:
            check_plot(path)
    compared = read_compared_agents(runs)
    found = [made.breakdown(compared, name, measure) for name in listed(by) or made.STANDARD]
    found = [one for one in found if one.groups]
    tables = [made.breakdown_table(one) for one in found]
    show_tables(made.breakdown_table(one, is_brief=True) for one in found)
    write_files(
        out,
        {
            ".md": lambda _: markdown_tables(tables),
            ".tex": lambda _: latex_tables(tables),
            ".csv": lambda _: made.breakdown_csv(found),
        },
        lambda: [made.breakdown_plot(one) for one in found],
    )
