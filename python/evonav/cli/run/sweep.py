"""`evonav sweep`: run many evaluations from one file."""

import json
import signal
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import EXIT_INTERRUPTED, show_tables
from evonav.cli.options import completion
from evonav.cli.options.shared import EXIT_INCOMPLETE, RetryErrored, Workers
from evonav.counted import counted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from evonav.sweeps.file import SweepFile
    from evonav.sweeps.run import Cell, CellRun
    from evonav.sweeps.summary import SweepRow
    from evonav.tasks.listing import TaskFile


def sweep(
    file: Annotated[Path | None, typer.Argument(metavar="FILE", help="Sweep file in TOML.", show_default=False)] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder of the sweep. Default: the file's `out`, else out/NAME."),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Change a value of the file, such as seeds=[0,1] or protocol.max_rounds=20. Repeat for more.",
            autocompletion=completion.sweep_keys,
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="GLOB", help="Run only cells whose name matches, such as '*__s0'. Repeat for more."),
    ] = None,
    retry_errored: RetryErrored = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Run nothing: list cells, stages and the estimated cost of models.")
    ] = False,
    workers: Workers = None,
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON Schema of sweep files, which editors use.")
    ] = False,
) -> None:
    """Run many evaluations that one file lists; run again to resume.

    Every combination of agents, perceptions, decision models, tasks and seeds is a cell, with a run of its own in
    OUT/runs. Also writes summary.json, .csv and .md.
    """
    if schema:
        from evonav.sweeps.file import sweep_schema

        typer.echo(json.dumps(sweep_schema(), indent=2))
        return
    if file is None:
        raise typer.BadParameter("name a sweep file, such as examples/sweeps/noise.toml")
    from evonav.evaluation.run.summary import typed_command
    from evonav.sweeps.file import read_sweep
    from evonav.sweeps.run import cell_runs, cells_of, chosen, task_sets

    settings = read_sweep(file, [*(set_ or ()), *([] if workers is None else [f"workers={workers}"])])
    folder = out or Path(settings.out or f"out/{file.stem}")
    cells = cells_of(settings)
    selected = chosen(cells, only or ())
    tasks = task_sets(settings)
    if dry_run:
        _print_plan(settings, selected, tasks, folder)
        return
    runs = cell_runs(settings, cells, tasks, folder)
    again = typed_command().replace(" --retry-errored", "")
    _run(settings, folder, runs, selected, retry_errored, again)
    is_incomplete = _print_summary(folder, {cell.name for cell in selected}, again)
    if is_incomplete:
        raise typer.Exit(EXIT_INCOMPLETE)


def _run(
    settings: "SweepFile",
    out: Path,
    runs: "Sequence[CellRun]",
    selected: "Sequence[Cell]",
    retry_errored: bool,
    again: str,
) -> None:
    """Run the stages without a record; an interrupt still writes the summary."""
    from evonav.cli.run.sweep_display import SweepProgress, showing
    from evonav.sweeps.run import run_sweep

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)
    names = {cell.name for cell in selected}
    progress = SweepProgress.of(out, [run for run in runs if run.cell.name in names])
    try:
        with showing(progress) as on_progress:
            run_sweep(settings, out, runs, only=sorted(names), retry_errored=retry_errored, on_progress=on_progress)
    except KeyboardInterrupt:
        typer.echo(f"interrupted: {progress.line()}; finished stages are in {out}", err=True)
        typer.echo(f"to resume: {again}", err=True)
        if (out / "sweep.json").exists():
            write_sweep_summary(out)
        raise typer.Exit(EXIT_INTERRUPTED) from None


def write_sweep_summary(out: Path) -> "list[SweepRow]":
    """Write the summary files of a sweep, finished or not.

    Returns:
        Its rows.

    Raises:
        StoreError: There is no sweep, or it cannot be read or written.
    """
    from evonav.sweeps.report import write_sweep_files
    from evonav.sweeps.summary import sweep_json, sweep_rows

    rows = sweep_rows(out)
    write_sweep_files(out, rows, sweep_json(out, rows))
    return rows


def _print_summary(out: Path, selected: "set[str]", again: str) -> bool:
    """Print tables, files and how to run errored stages again; true if a stage of the selected cells is missing."""
    from evonav.cli.options.decisions import print_spending
    from evonav.sweeps.report import sweep_tables

    rows = write_sweep_summary(out)
    show_tables(sweep_tables(rows))
    print_spending(out)
    typer.echo(f"summary: {out / 'summary.md'}, .csv, .json; runs: {out / 'runs'}")
    missing = [row for row in rows if row.is_incomplete and row.cell in selected]
    if any(row.counts["errored"] for row in missing):
        typer.echo(
            f"some stages errored (`evonav failures RUN` says why); run them again with: {again} --retry-errored"
        )
    return bool(missing)


def _print_plan(
    settings: "SweepFile", cells: "Sequence[Cell]", tasks: "Mapping[str, list[TaskFile]]", out: Path
) -> None:
    """Print the cells to run and their estimated cost."""
    from evonav.cli.display import status
    from evonav.evaluation.cost_estimate import estimate_run, total_usage
    from evonav.evaluation.hosting.isolation import AgentHosting
    from evonav.evaluation.run.components import check_agent_names
    from evonav.report.tables.table import Table
    from evonav.sweeps.run import cell_runs

    names = list(dict.fromkeys(agent for cell in cells for agent in cell.agents))
    check_agent_names(names, None if settings.isolation == "none" else AgentHosting())
    has_models = any(settings.decisions[cell.decision].kind == "vlm" for cell in cells)
    columns = ("cell", "tasks", "stages", *(("requests", "tokens in", "dollars") if has_models else ()))
    rows = []
    total, total_usd = 0, 0.0
    with status("Estimating") as tell:
        for run in cell_runs(settings, cells, tasks, out):
            cell = run.cell
            cost = [""] * 3 if has_models else []
            if settings.decisions[cell.decision].kind == "vlm":
                tell(cell.name)
                config = run.evaluation.config
                options = dict(config.backend.decision.options)
                found = estimate_run(
                    cell.agents, run.evaluation.tasks, config, options, num_workers=settings.num_workers
                )
                usage, price = total_usage(found), settings.price(options["model"])
                total_usd += 0.0 if price is None else price.of(usage)
                dollars = "?" if price is None else f"{price.of(usage):.2f}"
                num_requests = sum(estimate.num_requests for estimate in found)
                cost = [f"{num_requests:.0f}", str(usage.input_tokens), dollars]
            total += run.num_stages
            rows.append((cell.name, str(len(run.evaluation.tasks)), str(run.num_stages), *cost))
    show_tables([Table(f"{counted(len(cells), 'cell')} into {out}", columns, tuple(rows))])
    for agents in dict.fromkeys(cell.agents for cell in cells):
        some = [cell.name for cell in cells if cell.agents == agents]
        which = "" if len(some) == len(cells) else f" in {', '.join(some)}"
        typer.echo(f"agents{which}: {', '.join(agents)}")
    typer.echo(counted(total, "stage") + (f", about ${total_usd:.2f}" if total_usd else ""))
    if has_models and settings.prices is None:
        typer.echo("no prices: name a file of prices in the sweep file, such as prices = 'prices.json'")
    if settings.max_cost is not None and total_usd > settings.max_cost:
        typer.echo(f"more than max_cost = {settings.max_cost:g}: stages beyond it would end as errored")
