"""`evonav leaderboard`: verify packed runs and rank their agents on a page."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import progress_bar
from evonav.cli.options import completion
from evonav.cli.options.shared import Limit, Subset, Workers, chosen_tasks, num_workers_of
from evonav.cli.results.submission import SCORES_ONLY_HELP
from evonav.counted import counted

if TYPE_CHECKING:
    from evonav.tasks.listing import TaskFile


def leaderboard(
    packs: Annotated[
        list[Path], typer.Argument(metavar="PACK", help="Packed runs, from `evonav pack`, or folders of them.")
    ],
    tasks: Annotated[
        list[Path] | None,
        typer.Option(
            "--tasks",
            metavar="FOLDER",
            help="Folder of tasks, or bundled: entries have all tasks of one of the folders. Repeat the option for "
            "more. Default: the bundled tasks.",
            autocompletion=completion.task_folders,
        ),
    ] = None,
    limit: Limit = None,
    subset: Subset = None,
    scores_only: Annotated[bool, typer.Option("--scores-only", help=SCORES_ONLY_HELP)] = False,
    page_title: Annotated[str, typer.Option(metavar="TEXT", help="Title of the page.")] = "leaderboard",
    out: Annotated[Path, typer.Option(metavar="FILE", help="Page to write.")] = Path("out/leaderboard.html"),
    workers: Workers = None,
) -> None:
    """Verify packed runs and rank their agents on a page.

    Only agents that were evaluated on the same tasks, with the same perception and kind of decision model share a
    table. Files that fail a check or lack tasks are listed below the tables, with the reason.
    """
    from evonav.submission.leaderboard import RankedTasks, packed_files, rank
    from evonav.submission.leaderboard_page import write_leaderboard
    from evonav.tasks.listing import BUNDLED_TASKS

    files = packed_files(packs)
    task_sets = []
    for folder in tasks or [BUNDLED_TASKS]:
        found = chosen_tasks(folder, limit, subset)
        task_sets.append(RankedTasks(_name(found, limit, subset), tuple(found)))
    with progress_bar("verifying") as on_progress:
        board = rank(
            files, task_sets, scores_only=scores_only, num_workers=num_workers_of(workers), on_progress=on_progress
        )
    for one in board.unranked:
        typer.echo(f"{one.status}: {one.file}: {one.detail}")
    agents = counted(sum(map(len, board.tables.values())), "agent")
    page = write_leaderboard(board, out, page_title)
    tables = counted(len(board.tables), "table")
    typer.echo(f"leaderboard: {page} ({agents} in {tables}; {len(board.unranked)} not ranked)")


def _name(tasks: "list[TaskFile]", limit: int | None, subset: str | None) -> str:
    """Name a set of tasks: by its `dataset.json`, else by its folder, with the part that is taken."""
    from evonav.errors import TaskError
    from evonav.tasks.dataset import read_dataset

    folder = tasks[0].path.parent
    try:
        name = read_dataset(folder).name
    except TaskError:
        name = folder.resolve().name
    return name if limit is None and subset is None else f"{name} ({subset or f'first {len(tasks)}'})"
