"""`evonav tasks show`: draw tasks with their hidden changes."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.options.shared import Limit

if TYPE_CHECKING:
    from evonav.tasks import Task


def show(
    folder: Annotated[Path, typer.Argument(help="Folder of a task, or of a dataset.")],
    task: Annotated[str | None, typer.Option(help="Draw only this task of a dataset.")] = None,
    stage: Annotated[int | None, typer.Option(help="Draw only this stage.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="File or folder to write: a page (.html), a picture of one --stage (.svg, .png or .pdf), or a folder."
        ),
    ] = None,
    limit: Limit = None,
) -> None:
    """Draw tasks with their hidden changes and answers: a page for a task, or a gallery for a dataset."""
    from evonav.report.maps.files import SUFFIXES
    from evonav.report.tasks.pages import write_gallery, write_stage_picture, write_task_page
    from evonav.tasks import load_tasks

    one = _one_task(folder, task, stage)
    if one is None:
        if stage is not None or (out is not None and out.suffix in (*SUFFIXES, ".html")):
            raise typer.BadParameter("--stage and single files are for one task: give its folder, or --task")
        target = out or Path(f"{folder.resolve().name}-pictures")
        path = write_gallery(load_tasks(folder, limit), target, folder.resolve().name, on_task=typer.echo)
    elif out is not None and out.suffix in SUFFIXES:
        if stage is None:
            raise typer.BadParameter("a picture shows one stage: give --stage, too")
        path = write_stage_picture(one, stage, out)
    else:
        name = f"{one.task_id}.html"
        target = Path(name) if out is None else out if out.suffix == ".html" else out / name
        path = write_task_page(one, target, stages=None if stage is None else [stage])
    typer.echo(f"pictures: {path}")


def _one_task(folder: Path, task_id: str | None, stage: int | None) -> "Task | None":
    """Return the chosen task; `None` for all of a dataset.

    Raises:
        InvalidArgumentError: There is no such task or stage.
        TaskError: It is malformed.
    """
    from evonav.errors import InvalidArgumentError
    from evonav.tasks import load_task

    is_task = (folder / "task.json").is_file()
    if task_id is None and not is_task:
        return None
    root = folder if task_id is None else folder / task_id
    if task_id is not None and (is_task or Path(task_id).name != task_id or not (root / "task.json").is_file()):
        raise InvalidArgumentError(f"{folder}: holds no task {task_id!r}")
    task = load_task(root)
    if stage is not None and not 1 <= stage <= task.num_stages:
        raise InvalidArgumentError(f"task {task.task_id}: argument `stage` is {stage}, expected 1 to {task.num_stages}")
    return task
