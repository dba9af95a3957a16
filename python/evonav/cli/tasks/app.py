"""`evonav tasks`: list, draw, describe and check task files."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.options.settings import SettingsGroup
from evonav.cli.options.shared import Limit
from evonav.cli.tasks.schema import schema
from evonav.cli.tasks.show import show
from evonav.cli.tasks.stats import stats
from evonav.cli.tasks.subset import subset
from evonav.cli.tasks.validate import validate
from evonav.cli.tasks.write import write

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


tasks_app.command()(schema)
tasks_app.command()(show)
tasks_app.command()(stats)
tasks_app.command()(subset)
tasks_app.command()(write)
tasks_app.command()(validate)
