"""`evonav demo`: evaluate the heuristics on the bundled tasks and show the results."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.options.settings import settings_from
from evonav.cli.options.shared import Agents, Limit, Seed, Workers, chosen_tasks, names_of
from evonav.cli.results.view import make_pages
from evonav.cli.run.evaluate import early_worker, exit_if_incomplete, print_results, running


def demo(
    context: typer.Context,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder to write.")] = Path("out/demo"),
    agent: Agents = None,
    limit: Limit = None,
    seed: Seed = 0,
    workers: Workers = None,
) -> None:
    """Run three agents on bundled tasks and write a report.

    It takes a minute or two. The report is a page with tables, maps and replays of one task.
    """
    context.with_resource(early_worker())  # before imports, which take as long as its start
    from evonav.evaluation.run.evaluate import evaluate
    from evonav.report.pages.run_page import write_report

    run = settings_from({"workers": workers})
    config = run.run_config(seed, out)
    task_files = chosen_tasks(None, limit, None)
    with running(out, config) as show:
        summaries = evaluate(
            names_of(agent), task_files, out, config=config, num_workers=run.num_workers, on_progress=show
        )
    print_results(out, summaries)
    _, index = make_pages(out)
    typer.echo(f"report: {write_report(out)}")
    typer.echo(f"replays: {index}")
    exit_if_incomplete(summaries)
