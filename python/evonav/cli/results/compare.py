"""`evonav compare`: compare agents on the same stages."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.display import show_tables, write_texts
from evonav.cli.options.shared import (
    AsJson,
    ComparedRuns,
    CsvFile,
    LatexFile,
    MarkdownFile,
    PlotFile,
    listed,
)


def compare(
    runs: ComparedRuns,
    measure: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FIELD",
            help="Compare another numeric column that `evonav export` writes. Repeat the option for more, or separate "
            "them by commas.",
        ),
    ] = None,
    baseline: Annotated[
        str | None, typer.Option(metavar="NAME", help="Compare every other agent with this one. Default: every pair.")
    ] = None,
    allow_differences: Annotated[
        bool,
        typer.Option(
            "--allow-differences", help="Compare runs with different tasks or settings on the stages that they share."
        ),
    ] = False,
    md: MarkdownFile = None,
    latex: LatexFile = None,
    csv: CsvFile = None,
    as_json: AsJson = False,
    html: Annotated[Path | None, typer.Option(metavar="FILE", help="Write an HTML page with links to replays.")] = None,
    plot: PlotFile = None,
) -> None:
    """Compare agents on the same stages: `RUN A B` is A minus B.

    Without names, each pair is the later minus the earlier agent of the run, as in its report. Differences have 95%
    intervals and p-values, and the stages with different outcomes are listed.
    """
    import json

    from rich.console import Console

    from evonav.report.compare import wording
    from evonav.report.compare.compare import compare as compare_agents
    from evonav.report.compare.compare import comparison_json
    from evonav.report.compare.page import comparison_page, comparison_plot
    from evonav.report.compare.selection import read_compared_agents
    from evonav.report.plots.render import write_plots

    found = compare_agents(
        read_compared_agents(runs), measures=listed(measure), baseline=baseline, allow_differences=allow_differences
    )
    content = json.dumps(comparison_json(found), indent=1) + "\n"
    if as_json:
        typer.echo(content, nl=False)
    else:
        console = Console()
        show_tables(wording.terminal_tables(found))
        for line in wording.statements(found) if len(found) == 1 else wording.warnings(found):
            console.print(line, markup=False, highlight=False)
        console.print(wording.METHOD, style="dim", highlight=False)
    write_texts(
        (md, lambda: wording.comparison_markdown(found)),
        (latex, lambda: wording.comparison_latex(found)),
        (csv, lambda: wording.comparison_csv(found)),
        (html, lambda: comparison_page(found, None if html is None else html.parent)),
        is_error=as_json,
    )
    if plot is not None:
        typer.echo(f"written: {write_plots([comparison_plot(found)], plot)}", err=as_json)
