"""`evonav tasks`: generate, check, draw and describe tasks."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.group import Command, add_commands, new_app
from evonav.cli.options import completion
from evonav.cli.options.shared import Limit, Stages, TaskFolder, numbers_of
from evonav.cli.tasks.generate import generate
from evonav.cli.tasks.stats import stats
from evonav.cli.tasks.validate import validate
from evonav.cli.tasks.write import write

if TYPE_CHECKING:
    from collections.abc import Sequence

    from evonav.tasks import Task

PICTURES = Path("out/tasks")
"""Folder of pictures of tasks by default."""

tasks_app = new_app(help="Generate, check, draw and describe tasks.")


@tasks_app.command(name="list", cls=Command)
def list_tasks(folder: TaskFolder = None, limit: Limit = None) -> None:
    """List tasks, their rooms and stages, and when houses change."""
    from evonav.tasks import load_tasks
    from evonav.tasks.listing import task_folder

    tasks = list(load_tasks(task_folder(folder), limit))
    width = max(len(task.task_id) for task in tasks)
    typer.echo(f"{'task':{width}}  rooms  stages  the house changes before stages")
    for task in tasks:
        changed = [str(stage.stage) for stage in task.oracle_stages if stage.evolution.outcome == "evolved"]
        counts = f"{task.header.house.num_rooms:5}  {task.num_stages:6}"
        during = [f"{k.stage} (round {k.during.round})" for k in task.oracle_stages if k.during is not None]
        also = f"; during {', '.join(during)}" if during else ""
        typer.echo(f"{task.task_id:{width}}  {counts}  {', '.join(changed) or '-'}{also}")


@tasks_app.command(cls=Command)
def schema(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME", help="File to describe: dataset, oracle_stage, public_stage or task. Default: all."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder to write NAME.schema.json files to. Default: print them."),
    ] = None,
) -> None:
    """Print or write the JSON Schemas of task files."""
    from evonav.tasks.schema import MODELS, schema_text, write_schemas

    if out is not None:
        for path in write_schemas(out):
            typer.echo(str(path))
        return
    for each in MODELS if name is None else (name,):
        typer.echo(schema_text(each), nl=False)


@tasks_app.command(cls=Command)
def show(
    folder: TaskFolder = None,
    task: Annotated[
        str | None, typer.Option("--task", metavar="ID", help="Task to draw. Default: a gallery of all.")
    ] = None,
    stage: Stages = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="What to write: a folder, a page of a --task (.html), or a picture of a --task and --stage (.svg, "
            ".png or .pdf). Default: out/tasks/NAME for a gallery, out/tasks/ID.html for a task.",
        ),
    ] = None,
    limit: Limit = None,
) -> None:
    """Draw tasks: the house, what changes unseen, goals and answers.

    Writes a gallery of all tasks, or a page or picture of one.
    """
    from evonav.drawing.files import SUFFIXES
    from evonav.report.tasks.pages import write_gallery, write_stage_picture, write_task_page
    from evonav.tasks import load_tasks
    from evonav.tasks.listing import task_folder

    stages = numbers_of("--stage", stage)
    found = task_folder(folder)
    one = _one_task(found, task, stages)
    if one is None:
        if stages or (out is not None and out.suffix in (*SUFFIXES, ".html")):
            raise typer.BadParameter("--stage and single files are for one task: name it with --task")
        name = found.resolve().name
        path = write_gallery(list(load_tasks(found, limit)), out or PICTURES / name, name, on_task=typer.echo)
    elif out is not None and out.suffix in SUFFIXES:
        if len(stages) != 1:
            raise typer.BadParameter("a picture shows one stage: name it with --stage")
        path = write_stage_picture(one, stages[0], out)
    else:
        target = out or PICTURES
        target = target if target.suffix == ".html" else target / f"{one.task_id}.html"
        path = write_task_page(one, target, stages=stages or None)
    typer.echo(f"pictures: {path}")


def _one_task(folder: Path, task_id: str | None, stages: "Sequence[int]") -> "Task | None":
    """Return the chosen task; `None` for all of a dataset."""
    from evonav.errors import InvalidArgumentError
    from evonav.tasks import load_task

    is_task = (folder / "task.json").is_file()
    if task_id is None and not is_task:
        return None
    root = folder if task_id is None else folder / task_id
    if task_id is not None and (is_task or Path(task_id).name != task_id or not (root / "task.json").is_file()):
        raise InvalidArgumentError(f"{folder}: holds no task {task_id!r}; `evonav tasks list` shows which there are")
    task = load_task(root)
    for stage in stages:
        if not 1 <= stage <= task.num_stages:
            raise InvalidArgumentError(f"task {task.task_id}: no stage {stage}; it has stages 1 to {task.num_stages}")
    return task


@tasks_app.command(cls=Command)
def subset(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER",
            help="Folder of tasks with a dataset.json, or bundled.",
            autocompletion=completion.task_folders,
        ),
    ],
    name: Annotated[
        str, typer.Argument(metavar="SPLIT-N", help="Subset, such as test-90.", autocompletion=completion.subsets)
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="File to write the task ids to, one per line. Default: print them."),
    ] = None,
) -> None:
    """List the tasks of a named subset, such as test-90.

    A subset is the same for everyone with the same houses.
    """
    from evonav.errors import TaskError
    from evonav.tasks.listing import task_folder
    from evonav.tasks.subsets import subset_roots

    ids = [root.name for root in subset_roots(task_folder(folder), name)]
    if out is None:
        typer.echo("\n".join(ids))
        return
    try:
        out.write_text("".join(f"{task_id}\n" for task_id in ids), encoding="utf-8")
    except OSError as error:
        raise TaskError(f"{out}: cannot be written: {error.strerror or error}") from error
    typer.echo(f"{len(ids)} task ids in {out}")


add_commands(tasks_app, generate, validate, stats, write)
