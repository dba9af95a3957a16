"""`evonav failures`: list failed attempts at stages, equal ones once."""

from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.options.shared import RunAgents, RunFolder, listed
from evonav.counted import counted

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from evonav.evaluation.records.store import FailureRow

BUDGET = "over_budget"
"""Part of the message of a stage that ended because the model's budget was spent."""


def failures(
    run: RunFolder,
    agent: RunAgents = None,
    brief: Annotated[bool, typer.Option("--brief", help="Leave out tracebacks.")] = False,
) -> None:
    """List why stages failed, with tracebacks; equal failures once.

    Attempts that were tried again are listed, too.
    """
    from evonav.evaluation.records.store import RunStore

    names = listed(agent)
    with RunStore(run) as store:
        rows = [row for row in store.failures() if not names or row.agent in names]
    groups: dict[tuple[object, ...], list[FailureRow]] = {}
    for row in rows:
        groups.setdefault((row.agent, row.is_retried, row.kind, row.message, row.traceback), []).append(row)
    for group in sorted(groups.values(), key=len, reverse=True):
        _print_group(group, is_brief=brief)
    if not rows:
        typer.echo("no attempt has failed")


def _print_group(group: "Sequence[FailureRow]", *, is_brief: bool) -> None:
    """Print equal failures: how many stages, where the first one was, the reason and the traceback."""
    first = group[0]
    what = "tried again" if first.is_retried else "errored"
    where = f"{first.task_id} stage {first.stage}"
    if len(group) > 1:
        where = f"{counted(len(group), 'stage')}, first: {where}"
    typer.echo(f"{first.agent} {where}: {what}, since {first.kind.phrase}: {first.message}")
    if first.traceback and not is_brief:
        typer.echo("".join(f"    {line}\n" for line in first.traceback.rstrip().splitlines()))


def print_failures(run: "Path") -> None:
    """Print how many attempts at stages failed and why, if any did, and what to do."""
    from collections import Counter

    from evonav.evaluation.records.store import RunStore

    with RunStore(run) as store:
        rows = store.failures()
    for is_retried, what in ((True, "tried again"), (False, "errored")):
        reasons = Counter(_reason(row) for row in rows if row.is_retried is is_retried)
        for reason, count in sorted(reasons.items()):
            typer.echo(f"{counted(count, 'stage')} {what}: {reason}")
    if any(_is_budget(row) and not row.is_retried for row in rows):
        typer.echo("to continue: run the same command with a higher --max-cost and --retry-errored")
    if rows:
        typer.echo(f"why: evonav failures {run}")


def _reason(row: "FailureRow") -> str:
    return "budget reached" if _is_budget(row) else row.kind.phrase


def _is_budget(row: "FailureRow") -> bool:
    return BUDGET in row.message
