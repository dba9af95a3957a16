"""`evonav report`: write a run's report."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import print_table, show_tables, write_files
from evonav.cli.options.shared import Exchanges, RunAgents, RunFolder, RunTasks, listed
from evonav.cli.results.view import replay_pages
from evonav.cli.run.sweep import write_sweep_summary

if TYPE_CHECKING:
    from collections.abc import Callable

    from evonav.report.run import RecordedRun

NUM_REPLAYS = 2


def report(
    run: RunFolder,
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Folder to write, or a Markdown file of --text. Default: RUN.")
    ] = None,
    text: Annotated[
        bool, typer.Option("--text", help="Print the report's tables of metrics to the terminal; write no page.")
    ] = False,
    agent: RunAgents = None,
    replays: Annotated[
        str | None,
        typer.Option(
            metavar="all|N|none",
            help="Episodes to replay in the report: a number, all or none. Default: the "
            f"{NUM_REPLAYS} that best show how agents differ, none for sweeps.",
        ),
    ] = None,
    tasks: RunTasks = None,
    exchanges: Exchanges = None,
    maps: Annotated[bool, typer.Option("--maps", help="Also write the map of every stage to maps/*.svg.")] = False,
) -> None:
    """Write an HTML page about a run: tables, plots, maps, replays.

    A sweep gets a page for each run and one for all. With --text, no page is written, and metrics that explain
    rates are printed: other definitions of success, stale entries, memory, costs.
    """
    from evonav.sweeps import SWEEP_NAME

    if not text and agent is not None:
        raise typer.BadParameter("--agent is for --text; the page shows all agents")
    if text:
        _print_metrics(run, listed(agent) or None, out)
        return
    from evonav.evaluation.run.summary import save_summary
    from evonav.report.pages.run_page import write_report
    from evonav.report.run import load_run

    is_sweep = (run / SWEEP_NAME).is_file()
    num_replays = _count(replays or ("none" if is_sweep else str(NUM_REPLAYS)))

    def write(recorded: "RecordedRun", to: Path | None) -> Path:
        if num_replays != 0:
            _replay(recorded, num_replays, tasks, exchanges)
        return write_report(recorded, to, has_maps=maps)

    if is_sweep:
        typer.echo(f"report: {_report_sweep(run, out, write)}")
        return
    recorded = load_run(run)
    save_summary(run, recorded.summaries, recorded.pairs)
    print_table(sorted(recorded.summaries, key=lambda summary: summary.agent))
    typer.echo(f"report: {write(recorded, out)}")


def _report_sweep(sweep: Path, out: Path | None, write: "Callable[[RecordedRun, Path | None], Path]") -> Path:
    """Write a report for each cell that has records, and a page with links to them."""
    from evonav.evaluation.records.store import FILE_NAME
    from evonav.report.run import load_run
    from evonav.sweeps import RUNS_NAME
    from evonav.sweeps.report import write_sweep_page
    from evonav.sweeps.summary import sweep_title

    rows = write_sweep_summary(sweep)
    reports = []
    for cell in sorted(path.parent for path in (sweep / RUNS_NAME).glob(f"*/{FILE_NAME}")):
        reports.append((cell.name, write(load_run(cell), None if out is None else out / RUNS_NAME / cell.name)))
        typer.echo(f"cell: {reports[-1][1]}")
    return write_sweep_page(out or sweep, sweep_title(sweep), rows, reports)


def _print_metrics(run: Path, agents: "list[str] | None", out: Path | None) -> None:
    """Print the tables of metrics of a run, and write them to a Markdown file if one is named."""
    from evonav.report.tables.metric_tables import measures_tables
    from evonav.report.tables.table import markdown_tables

    tables = [table for table in measures_tables(run, agents) if table.rows]
    show_tables(tables)
    if out is not None:
        write_files([out.with_suffix(".md")], {".md": lambda _: markdown_tables(tables)})


def _count(replays: str) -> int | None:
    """Return the number of episodes to replay; `None` for all."""
    if replays in ("all", "none"):
        return None if replays == "all" else 0
    if not replays.isdecimal():
        raise typer.BadParameter(f"--replays {replays}: a number, all or none")
    return int(replays)


def _replay(run: "RecordedRun", num: int | None, tasks: Path | None, exchanges: Path | None) -> None:
    """Replay the highlights that have no page of the current records."""
    from evonav.errors import EvonavError
    from evonav.replay.run_pages import unwritten_highlights

    missing = unwritten_highlights(run, num)
    if not missing:
        return
    try:
        replay_pages(run, missing, tasks=tasks, exchanges=exchanges)
    except EvonavError as error:  # a report needs only the records
        typer.echo(f"no replays: {error}", err=True)
