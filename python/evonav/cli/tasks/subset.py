"""`evonav tasks subset`: list the tasks of a named subset."""

from pathlib import Path
from typing import Annotated

import typer

from evonav.cli.options import completion


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
