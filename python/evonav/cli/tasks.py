"""Task files: `generate`."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.display import status
from evonav.cli.options import HOUSES, AnyAsset, Limit, Seed


def generate(
    houses: Annotated[Path, typer.Option(help=f"{HOUSES}.")],
    out: Annotated[Path, typer.Option(help="Folder for the tasks.")],
    limit: Limit = None,
    seed: Seed = 0,
    allow_unknown_assets: AnyAsset = False,
) -> None:
    """Generates tasks from multi-room houses."""
    from evonav.evaluation.datasets import make_tasks

    with status("Generating tasks") as tell:
        tasks = make_tasks(houses, out, limit=limit, seed=seed, allow_unknown_assets=allow_unknown_assets, on_task=tell)
    typer.echo(f"{len(tasks)} tasks in {out}")
