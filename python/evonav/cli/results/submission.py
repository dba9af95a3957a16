"""`evonav pack` and `evonav verify`: pack a run into a file for submission, and verify such a file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import percent, print_checks, progress_bar, show_tables
from evonav.cli.options.shared import (
    AsJson,
    Limit,
    RunAgents,
    RunFolder,
    Subset,
    Tasks,
    Workers,
    chosen_tasks,
    listed,
    num_workers_of,
)
from evonav.counted import counted

if TYPE_CHECKING:
    from evonav.submission.verify import PackVerdict

EXIT_REJECTED = 1
SCORES_ONLY_HELP = "Recompute the scores from the recorded paths, without replaying the actions: faster, proves less."


def pack(
    run: RunFolder,
    agent: RunAgents = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="File to write. Default: beside the folder, by its name.")
    ] = None,
    title: Annotated[str, typer.Option(metavar="TEXT", help="Title of the entry.")] = "",
    authors: Annotated[str, typer.Option(metavar="TEXT", help="Authors of the entry.")] = "",
    contact: Annotated[str, typer.Option(metavar="TEXT", help="Email address for questions.")] = "",
    url: Annotated[str, typer.Option(metavar="URL", help="Web address of the paper or code.")] = "",
    description: Annotated[
        str, typer.Option(metavar="TEXT", help="Model, prompts, training data and what else readers should know.")
    ] = "",
) -> None:
    """Pack a complete run into one file to submit.

    The file holds the records, the configuration and checksums of the tasks.
    """
    from evonav.submission.file import SUFFIX, About
    from evonav.submission.pack import pack

    run = run.absolute()
    target = out or run.with_name(run.name + SUFFIX)
    about = About(title=title, authors=authors, contact=contact, url=url, description=description)
    names = listed(agent) or None
    header = pack(run, target, agents=names, about=about)
    typer.echo(
        f"packed: {target} ({', '.join(header.agents)};"
        f" {counted(len(header.tasks), 'task')}; {target.stat().st_size / 1e6:.1f} MB)"
    )
    typer.echo(f"next: evonav verify {target}")


def verify(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A packed run, from `evonav pack`.")],
    tasks: Tasks = None,
    limit: Limit = None,
    subset: Subset = None,
    scores_only: Annotated[bool, typer.Option("--scores-only", help=SCORES_ONLY_HELP)] = False,
    as_json: AsJson = False,
    workers: Workers = None,
) -> None:
    """Check a packed run by replaying its actions.

    The scores are computed again. The exit code is 1 if anything was altered or is missing. With --limit, only the
    first tasks are required and replayed.
    """
    import json

    from evonav.submission.verify import verdict_json, verify

    task_files = chosen_tasks(tasks, None, subset)
    with progress_bar("replaying actions") as on_progress:
        verdict = verify(
            file,
            task_files,
            limit=limit,
            scores_only=scores_only,
            num_workers=num_workers_of(workers),
            on_progress=on_progress,
        )
    if as_json:
        typer.echo(json.dumps(verdict_json(verdict), indent=2, sort_keys=True))
    else:
        _print(file, verdict, limit)
    if not verdict.is_accepted:
        raise typer.Exit(EXIT_REJECTED)


def _print(file: Path, verdict: "PackVerdict", limit: int | None) -> None:
    from evonav.report.tables.table import Table
    from evonav.submission.packed_setup import packed_setup

    marks = {True: ("ok", "green"), False: ("fail", "bold red")}
    print_checks(
        f"{file.name}: {'accepted' if verdict.is_accepted else 'REJECTED'}",
        ((check.name, *marks[check.is_passed], check.detail) for check in verdict.checks),
    )
    num_tasks = 0 if verdict.submission is None else len(verdict.submission.tasks)
    if verdict.is_accepted and limit is not None and limit < num_tasks:
        typer.echo(f"verified {limit} of {counted(num_tasks, 'task')}; without --limit, all")
    if verdict.is_accepted and verdict.submission is not None:
        isolation = packed_setup(verdict.submission).isolation
        typer.echo(f"isolation of agents, as the run notes it: {isolation or 'not noted'}")
    if verdict.is_accepted and verdict.summary is not None:
        rows = tuple(
            (agent, str(row["n"]), percent(row["sr"]), percent(row["spl"]))
            for agent, row in verdict.summary["agents"].items()
        )
        show_tables([Table("SR and SPL in %, as scored again", ("agent", "n", "SR", "SPL"), rows)])
        if not verdict.is_rescored:
            typer.echo("The actions were not replayed: the recorded paths were trusted.")
