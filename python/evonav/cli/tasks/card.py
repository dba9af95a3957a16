"""`evonav tasks card`: write the cards that a set of tasks needs on a dataset hub."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.options.shared import TaskFolder, task_folder


def card(
    folder: TaskFolder = None,
    out: Annotated[
        Path,
        typer.Option(
            metavar="FOLDER",
            help="Folder to write to. The tasks are copied there, unless it is their own folder.",
        ),
    ] = Path("out/cards"),
    repo: Annotated[
        str, typer.Option(metavar="ORG/NAME", help="Repository of the dataset on the Hub, for links and commands.")
    ] = "ORG/NAME",
    license_id: Annotated[
        str | None,
        typer.Option(
            "--license",
            metavar="ID",
            help="Licence of the houses by the Hub's name, such as cc-by-4.0. Default: that of the bundled houses, if "
            "the tasks are made from them.",
        ),
    ] = None,
    name: Annotated[
        str | None, typer.Option(metavar="TEXT", help="Title of the card. Default: by the name in dataset.json.")
    ] = None,
    date: Annotated[str | None, typer.Option(metavar="YYYY-MM-DD", help="Day of publication. Default: today.")] = None,
) -> None:
    """Make a folder of tasks ready for the Hugging Face Hub.

    Writes a dataset card (README.md), Croissant metadata (croissant.json), the description of the benchmark (eval.yaml)
    and a table of the stages (metadata.jsonl). Nothing is uploaded.
    """
    from datetime import datetime, timezone

    from evonav.cli.display import status
    from evonav.counted import counted
    from evonav.generation.statistics.compute import statistics_of_folders
    from evonav.report.cards.dataset_card import CardOptions, write_dataset_card
    from evonav.report.cards.hub_benchmark import EVAL_NAME
    from evonav.tasks.dataset import DATASET_NAME

    day = date or datetime.now(timezone.utc).date().isoformat()
    options = CardOptions(date=day, repo=repo, license=license_id, name=name)
    with task_folder(folder) as found, status("Reading tasks"):
        root = found.parent if found.name == DATASET_NAME else found
        statistics = statistics_of_folders([root])
        cards = write_dataset_card(root, out, statistics, options)
    typer.echo(f"cards: {', '.join(map(str, cards))} ({counted(statistics.num_tasks, 'task')})")
    typer.echo(f"next: hf upload {repo} {out} --repo-type dataset --exclude {EVAL_NAME}")
    typer.echo(f"The Hub accepts {EVAL_NAME} once it lists evonav as a framework; upload it then.")
