"""`evonav tasks validate`: check task files."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import progress_bar
from evonav.cli.options.settings import with_settings
from evonav.cli.options.shared import AnyAsset, Limit

if TYPE_CHECKING:
    from evonav.evaluation.run.run_settings import RunSettings
    from evonav.generation.validation import FolderReport

NUM_EXAMPLES = 3
"""Largest number of examples of each kind of problem in the table."""


@with_settings("workers")
def validate(
    workers: "RunSettings",
    folder: Annotated[Path, typer.Argument(help="Folder that holds one folder per task.")],
    limit: Limit = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write all problems to a JSON file.")] = None,
    allow_unknown_assets: AnyAsset = False,
) -> None:
    """Check tasks: files, records, physics, reference views, trajectories, and that no oracle data is public."""
    from evonav.generation.validation import validate_folder

    with progress_bar("tasks") as on_progress:
        report = validate_folder(
            folder,
            limit=limit,
            num_workers=workers.num_workers,
            allow_unknown_assets=allow_unknown_assets,
            on_progress=on_progress,
        )
    if json_file is not None:
        write_json(report, json_file)
    print_report(report)
    if report.problems:
        raise typer.Exit(1)


def print_report(report: "FolderReport") -> None:
    """Print problems by kind, and how many of them the source houses already have."""
    from rich.console import Console
    from rich.table import Table

    from evonav.generation.validation import KINDS

    console = Console()
    num_stages = sum(one.num_stages for one in report.reports)
    if report.problems:
        table = Table(title="Problems")
        for heading in ("kind", "problems", "tasks", "which"):
            table.add_column(heading, justify="right" if heading in ("problems", "tasks") else "left")
        for kind, num in Counter(problem.kind for problem in report.problems).most_common():
            found = [problem for problem in report.problems if problem.kind == kind]
            examples = [f"{one.task_id} {one.stage or ''}: {one.detail[:200]}" for one in found[:NUM_EXAMPLES]]
            which = "\n".join([KINDS[kind], *examples])
            table.add_row(kind, str(num), str(len({problem.task_id for problem in found})), which)
        console.print(table, markup=False)
    if report.source_counts:
        counts = ", ".join(f"{num} {kind}" for kind, num in report.source_counts.most_common())
        console.print(f"as in the source houses, and no problem: {counts}", markup=False)
    num_valid = len(report.reports) - report.num_invalid
    console.print(f"{num_valid} of {len(report.reports)} tasks valid, {num_stages} stages")


def write_json(report: "FolderReport", path: Path) -> None:
    """Write all problems, and how many of them the source houses already have.

    Raises:
        TaskError: It cannot be written.
    """
    import json

    from evonav.errors import TaskError

    document = {
        "num_tasks": len(report.reports),
        "num_invalid": report.num_invalid,
        "problems": [problem.model_dump() for problem in report.problems],
        "own": dict(sorted(report.source_counts.items())),
    }
    try:
        path.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise TaskError(f"{path}: cannot be written: {error.strerror or error}") from error
