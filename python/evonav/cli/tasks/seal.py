"""`evonav tasks key`, `seal` and `unseal`: hidden test sets."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.options.shared import Limit, Subset, chosen_tasks

Key = Annotated[
    Path,
    typer.Option("--key", metavar="FILE", help="Key of the evaluator: the public one seals, the private one opens."),
]


def key(
    out: Annotated[
        Path, typer.Option(metavar="FILE", help="File of the private key; the public one is written to FILE.pub.")
    ] = Path("evaluator.key"),
) -> None:
    """Make the keys of an evaluator: the public one seals tasks, the private one opens them."""
    from evonav.submission.sealed import new_key
    from evonav.tasks.listing import KEY_VARIABLE

    public = new_key(out)
    typer.echo(f"{public}: seals tasks; give it to whoever makes them")
    typer.echo(f"{out}: opens them; keep it secret, and set {KEY_VARIABLE} to its path to evaluate")


def seal(
    folder: Annotated[Path, typer.Argument(metavar="TASKS", help="Folder of tasks.")],
    key: Key,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder to write the sealed set to.")],
    limit: Limit = None,
    subset: Subset = None,
) -> None:
    """Seal tasks for the key of an evaluator, so that nobody else can read them: a hidden test set."""
    from evonav.submission.sealed import seal as seal_tasks

    with chosen_tasks(folder, limit, subset) as tasks:
        index = seal_tasks(tasks, key, out)
    typer.echo(f"{out}: {index.num_tasks} tasks with {index.num_stages} stages, sealed for {index.public_key[:16]}...")


def unseal(
    folder: Annotated[Path, typer.Argument(metavar="SEALED", help="A sealed set.")],
    key: Key,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder to write the tasks to.")],
) -> None:
    """Write the tasks of a sealed set to a folder, to look at them; evaluating needs no such folder."""
    from evonav.submission.sealed import unseal as unseal_tasks

    unseal_tasks(folder, key, out)
    typer.echo(f"{out}: the tasks of {folder}")
