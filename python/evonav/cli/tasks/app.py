"""`evonav tasks`: list, draw, describe and check task files."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.options import completion
from evonav.cli.options.settings import SettingsGroup
from evonav.cli.options.shared import Limit
from evonav.cli.tasks.stats import stats
from evonav.cli.tasks.validate import validate
from evonav.cli.tasks.write import write

if TYPE_CHECKING:
    from evonav.tasks import Task

tasks_app = typer.Typer(
    cls=SettingsGroup, help="List, draw, describe, check and rewrite task files.", no_args_is_help=True
)

Folder = Annotated[Path, typer.Argument(help="Folder that holds one folder per task.")]


@tasks_app.command(name="list")
def list_tasks(folder: Folder, limit: Limit = None) -> None:
    """List tasks with their rooms, stages, and the stages before which the house changes."""
    from evonav.tasks import load_tasks

    for task in load_tasks(folder, limit):
        changed = [str(stage.stage) for stage in task.oracle_stages if stage.evolution.outcome == "evolved"]
        rooms = f"{task.header.house.num_rooms:2} rooms"
        typer.echo(f"{task.task_id}  {rooms}  {task.num_stages} stages  changed before: {', '.join(changed) or '-'}")


@tasks_app.command()
def schema(
    name: Annotated[
        str | None, typer.Argument(help="File to describe: dataset, oracle_stage, public_stage or task. Default: all.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write NAME.schema.json files to. Default: print them.")
    ] = None,
) -> None:
    """Print or write the JSON Schemas (draft 2020-12) of task files."""
    from evonav.tasks.schema import MODELS, schema_text, write_schemas

    if out is not None:
        for path in write_schemas(out):
            typer.echo(str(path))
        return
    for each in MODELS if name is None else (name,):
        typer.echo(schema_text(each), nl=False)


@tasks_app.command()
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
    from evonav.drawing.files import SUFFIXES
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


@tasks_app.command()
def subset(
    folder: Annotated[Path, typer.Argument(help="Folder of tasks with a dataset.json.")],
    name: Annotated[str, typer.Argument(help="Subset: SPLIT-N, such as test-90.", autocompletion=completion.subsets)],
    out: Annotated[
        Path | None, typer.Option(help="File to write the task ids to, one per line. Default: print them.")
    ] = None,
) -> None:
    """List the tasks of a named subset, which is the same for everyone with the same houses (docs/tasks.md)."""
    from evonav.errors import TaskError
    from evonav.tasks.subsets import subset_roots

    ids = [root.name for root in subset_roots(folder, name)]
    if out is None:
        typer.echo("\n".join(ids))
        return
    try:
        out.write_text("".join(f"{task_id}\n" for task_id in ids), encoding="utf-8")
    except OSError as error:
        raise TaskError(f"{out}: cannot be written: {error.strerror or error}") from error
    typer.echo(f"{len(ids)} task ids in {out}")


for command in (stats, write, validate):
    tasks_app.command()(command)
