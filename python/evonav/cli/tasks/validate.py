"""`evonav tasks validate`: check task files."""

from collections import Counter
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import progress_bar
from evonav.cli.options.shared import AnyAsset, AsJson, Limit, TaskFolder, Workers, num_workers_of
from evonav.counted import counted

if TYPE_CHECKING:
    from evonav.generation.validation import FolderReport

NUM_EXAMPLES = 3
"""Largest number of examples of each kind of problem."""


def validate(
    folder: TaskFolder = None,
    limit: Limit = None,
    as_json: AsJson = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Also count oddities that the source houses have themselves.")
    ] = False,
    allow_unknown_assets: AnyAsset = False,
    workers: Workers = None,
) -> None:
    """Check that tasks are complete, correct and hide the answers.

    Files, records, physics, reference views and paths are checked. The exit code is 1 if a task is invalid.
    """
    from evonav.generation.validation import validate_folder
    from evonav.tasks.listing import task_folder

    with progress_bar("tasks") as on_progress:
        report = validate_folder(
            task_folder(folder),
            limit=limit,
            num_workers=num_workers_of(workers),
            allow_unknown_assets=allow_unknown_assets,
            on_progress=on_progress,
        )
    if as_json:
        typer.echo(report_json(report), nl=False)
    else:
        print_report(report, is_verbose=verbose)
    if report.problems:
        raise typer.Exit(1)


def print_report(report: "FolderReport", *, is_verbose: bool = False) -> None:
    """Print whether tasks are valid, problems by kind, and if asked what the source houses already have."""
    from evonav.generation.validation import KINDS

    for kind, num in Counter(problem.kind for problem in report.problems).most_common():
        found = [problem for problem in report.problems if problem.kind == kind]
        num_wrong = len({problem.task_id for problem in found})
        typer.echo(f"{kind}: {counted(num, 'problem')} in {counted(num_wrong, 'task')}: {KINDS[kind]}")
        for one in found[:NUM_EXAMPLES]:
            typer.echo(f"  {one.task_id} {one.stage or ''}: {one.detail[:200]}")
    num_tasks, num_stages = len(report.reports), sum(one.num_stages for one in report.reports)
    verdict = "valid" if not report.num_invalid else "INVALID"
    num_valid = f"{num_tasks - report.num_invalid} of {counted(num_tasks, 'task')} valid"
    typer.echo(f"{verdict}: {num_valid}, {counted(num_stages, 'stage')}")
    if report.source_counts and is_verbose:
        counts = ", ".join(f"{num} {kind}" for kind, num in report.source_counts.most_common())
        typer.echo(f"oddities of the source houses, which make no task invalid: {counts}")


def report_json(report: "FolderReport") -> str:
    """Return all problems as JSON, and how many of them the source houses already have."""
    import json

    document = {
        "num_tasks": len(report.reports),
        "num_invalid": report.num_invalid,
        "problems": [problem.model_dump() for problem in report.problems],
        "own": dict(sorted(report.source_counts.items())),
    }
    return json.dumps(document, indent=2) + "\n"
