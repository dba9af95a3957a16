"""`evonav failures`: list failed attempts at stages."""

from typing import Annotated

import typer

from evonav.cli.options.shared import RunFolder


def failures(
    run: RunFolder,
    agent: Annotated[str | None, typer.Option(help="List only this agent.")] = None,
    brief: Annotated[bool, typer.Option("--brief", help="Leave out tracebacks.")] = False,
) -> None:
    """List failed attempts at stages, with tracebacks, including those that were retried."""
    from evonav.evaluation.records.store import RunStore

    with RunStore(run) as store:
        rows = [row for row in store.failures() if agent in (None, row.agent)]
    for row in rows:
        what = "tried again" if row.is_retried else "errored"
        typer.echo(f"{row.agent} {row.task_id} stage {row.stage}: {what}, since {row.kind.phrase}: {row.message}")
        if row.traceback and not brief:
            typer.echo("".join(f"    {line}\n" for line in row.traceback.rstrip().splitlines()))
    if not rows:
        typer.echo("no attempt has failed")
