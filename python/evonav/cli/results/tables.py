"""Commands that show runs in numbers: `evonav compare`, `breakdown` and `export`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import show_tables, write_files
from evonav.cli.options.shared import PLOTS, AsJson, ComparedRuns, RunAgents, RunFolder, files_option, listed

if TYPE_CHECKING:  # the command must start fast
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
    from evonav.report.compare.selection import name_notes, read_compared_agents

    compared = read_compared_agents(runs)
    found = compare_agents(compared, metrics=listed(measure), baseline=baseline, allow_differences=allow_differences)
    content = json.dumps(comparison_json(found), indent=1) + "\n"
    if as_json:
        typer.echo(content, nl=False)
    else:
        _print(found, name_notes(compared))
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


def _print(found: "Sequence[Comparison]", notes: "Sequence[str]") -> None:
    """Print what the comparison says, in sentences and tables, and then the notes."""
    from rich.console import Console

    from evonav.report.compare import wording

    console = Console()
    for line in wording.statements(found) if len(found) == 1 else wording.warnings(found):
        console.print(line, markup=False, highlight=False)
    show_tables(wording.terminal_tables(found), notes=[*notes, wording.METHOD])


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
    from evonav.report.compare.selection import name_notes, read_compared_agents
    from evonav.report.plots.render import check_plot
    from evonav.report.tables.table import latex_tables, markdown_tables

    for path in out or ():
        if path.suffix[1:] in PLOTS:
            check_plot(path)
    compared = read_compared_agents(runs)
    found = [made.breakdown(compared, name, measure) for name in listed(by) or made.STANDARD]
    found = [one for one in found if one.groups]
    tables = [made.breakdown_table(one) for one in found]
    show_tables((made.breakdown_table(one, is_brief=True) for one in found), notes=name_notes(compared))
    write_files(
        out,
        {
            ".md": lambda _: markdown_tables(tables),
            ".tex": lambda _: latex_tables(tables),
            ".csv": lambda _: made.breakdown_csv(found),
        },
        lambda: [made.breakdown_plot(one) for one in found],
    )


def export(
    run: RunFolder,
    agent: RunAgents = None,
    out: Annotated[list[Path] | None, files_option("csv", "jsonl", "parquet")] = None,
    rounds: Annotated[
        bool, typer.Option("--rounds", help="Write one row per decision round instead of one per stage.")
    ] = False,
) -> None:
    """Write every metric of a run as CSV, JSON lines or Parquet.

    There is one row per stage, or with --rounds one per decision round.
    """
    from evonav.report import export as made

    names = listed(agent) or None
    if not out:
        raise typer.BadParameter("name a file: --out stages.csv, .jsonl or .parquet")
    for path in out:
        columns = made.ROUND_COLUMNS if rounds else made.stage_columns()
        rows = made.round_table(run, names) if rounds else made.stage_table(run, names)
        typer.echo(f"written: {made.write_table(rows, columns, path)}")
