"""`evonav demo`: evaluate the heuristics on the bundled tasks and show the results."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.options.decisions import HiddenDryRun, decision_component, print_estimate
from evonav.cli.options.settings import with_settings
from evonav.cli.options.shared import Agents, Limit, Seed, names_of
from evonav.cli.results.view import make_pages
from evonav.cli.run.evaluate import early_worker, exit_if_incomplete, print_results, run_tasks, running

if TYPE_CHECKING:  # the command must start fast
    from evonav.evaluation.run.decision_resources import SpendingSettings
    from evonav.evaluation.run.run_settings import RunSettings
    from evonav.evaluation.run.settings import DecisionSettings


@with_settings("workers", "decisions", "spending", hidden=("decisions", "spending"))
def demo(
    workers: "RunSettings",
    decisions: "DecisionSettings",
    spending: "SpendingSettings",
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder to write.")] = Path("out/demo"),
    agent: Agents = None,
    limit: Limit = None,
    seed: Seed = 0,
    dry_run: HiddenDryRun = False,
) -> None:
    """Run three agents on bundled tasks and write a report.

    It takes a minute or two. The report is a page with tables, maps and replays of one task.
    """
    from evonav.evaluation.run.components import Backend
    from evonav.evaluation.run.run import evaluate
    from evonav.evaluation.run.settings import SimulatorSettings
    from evonav.report import write_report

    workers = workers.with_episodes([decisions], [SimulatorSettings()])
    num_workers, names = workers.num_workers, names_of(agent)
    decision = decision_component(decisions, spending, out, seed, workers.num_episodes, dry_run=dry_run)
    config = workers.config(seed, Backend(decision=decision), decisions)
    with run_tasks(out, limit=limit) as task_files:
        if dry_run:
            print_estimate(spending, names, task_files, config, num_workers)
            return
        with running(out, config) as show:
            summaries = evaluate(
                names,
                task_files,
                out,
                config=config,
                num_workers=num_workers,
                episodes_at_once=workers.episodes_at_once or 1,
                on_progress=show,
            )
    print_results(out, summaries)
    _, index = make_pages(out)
    typer.echo(f"report: {write_report(out)}")
    typer.echo(f"replays: {index}")
    exit_if_incomplete(summaries)


demo.beginning = early_worker  # type: ignore[attr-defined]
