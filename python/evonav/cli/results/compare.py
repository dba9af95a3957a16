"""`evonav compare`: compare agents on the same stages."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import show_tables, write_files
from evonav.cli.options.shared import PLOTS, AsJson, ComparedRuns, files_option, listed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from evonav.report.compare.compare import Comparison


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
    out: Annotated[list[Path] | None, files_option("html", "md", "tex", "csv", *PLOTS)] = None,
    as_json: AsJson = False,
) -> None:
    """Compare agents on the same stages: `RUN A B` is A minus B.

    Without names, each pair is the later minus the earlier agent of the run, as in its report. Differences have 95%
    intervals and p-values, and the stages with different outcomes are listed.
    """
    import json

    from evonav.report.compare import wording
    from evonav.report.compare.compare import compare as compare_agents
    from evonav.report.compare.compare import comparison_json
    from evonav.report.compare.page import comparison_page, comparison_plot
    from evonav.report.compare.selection import read_compared_agents

    found = compare_agents(
        read_compared_agents(runs), metrics=listed(measure), baseline=baseline, allow_differences=allow_differences
    )
    content = json.dumps(comparison_json(found), indent=1) + "\n"
    if as_json:
        typer.echo(content, nl=False)
    else:
        _print(found)
    write_files(
        out,
        {
            ".md": lambda _: wording.comparison_markdown(found),
            ".tex": lambda _: wording.comparison_latex(found),
            ".csv": lambda _: wording.comparison_csv(found),
            ".html": lambda path: comparison_page(found, path.parent),
        },
        lambda: [comparison_plot(found)],
        is_error=as_json,
    )


def _print(found: "Sequence[Comparison]") -> None:
    """Print what the comparison says, in sentences and tables, and then the notes."""
    from rich.console import Console

    from evonav.report.compare import wording
    from evonav.report.tables.table import short_names

    console = Console()
    names = short_names(name for one in found for name in (one.a, one.b))
    for line in wording.statements(found) if len(found) == 1 else wording.warnings(found):
        for name, short in names.items():
            line = line.replace(name, short)
        console.print(line, markup=False, highlight=False)
    show_tables(wording.terminal_tables(found), notes=[wording.METHOD])
