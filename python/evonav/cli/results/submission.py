"""`evonav pack` and `evonav verify`: pack a run into a file for submission, and verify such a file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.options.settings import with_settings
from evonav.cli.options.shared import Limit, Subset, Tasks

if TYPE_CHECKING:
    from evonav.evaluation.run.settings import RunSettings
    from evonav.submission.verify import Verdict

EXIT_REJECTED = 1


def pack(
    run: Annotated[Path, typer.Argument(help="Folder of a complete run.")],
    out: Annotated[Path | None, typer.Option(help="File to write. Default: RUN.evonav.zip beside the folder.")] = None,
    agents: Annotated[str | None, typer.Option(help="Agents of the run, separated by commas. Default: all.")] = None,
    title: Annotated[str, typer.Option(help="Title of the entry.")] = "",
    authors: Annotated[str, typer.Option(help="Authors of the entry.")] = "",
    contact: Annotated[str, typer.Option(help="Address for questions.")] = "",
    url: Annotated[str, typer.Option(help="Address of the paper or code.")] = "",
    description: Annotated[
        str, typer.Option(help="Model, prompts, training data and what else readers should know.")
    ] = "",
) -> None:
    """Pack a run's records, configuration and task checksums into one file for a leaderboard."""
    from evonav.submission.pack import SUFFIX, About, pack

    run = run.absolute()
    target = out or run.with_name(run.name + SUFFIX)
    about = About(title=title, authors=authors, contact=contact, url=url, description=description)
    names = None if agents is None else [name.strip() for name in agents.split(",") if name.strip()]
    header = pack(run, target, agents=names, about=about)
    typer.echo(
        f"packed: {target} ({', '.join(part.agent for part in header.records)};"
        f" {len(header.tasks)} tasks; {target.stat().st_size / 1e6:.1f} MB)\nnext: evonav verify {target}"
    )


@with_settings("workers")
def verify(
    workers: "RunSettings",
    file: Annotated[Path, typer.Argument(help="A packed run.")],
    tasks: Tasks = None,
    limit: Limit = None,
    subset: Subset = None,
    scores_only: Annotated[
        bool,
        typer.Option(
            "--scores-only",
            help="Recompute the scores without carrying out the actions: takes seconds, but proves less.",
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the verdict as JSON.")] = False,
) -> None:
    """Score a packed run again by carrying out its actions; exit code 1 if anything was altered or is missing."""
    import json

    from rich.console import Console
    from rich.progress import Progress

    from evonav.submission.verify import verdict_json, verify
    from evonav.tasks.bundled import bundled_tasks
    from evonav.tasks.listing import task_files

    if limit is not None and subset is not None:
        raise typer.BadParameter("give --limit or --subset, not both")
    with bundled_tasks() as bundled, Progress(console=Console(stderr=True), transient=True) as bar:
        line = bar.add_task("carrying actions out again", total=None)
        verdict = verify(
            file,
            task_files(tasks or bundled, limit, subset),
            scores_only=scores_only,
            num_workers=workers.num_workers,
            on_progress=lambda done, total: bar.update(line, completed=done, total=total),
        )
    if as_json:
        typer.echo(json.dumps(verdict_json(verdict), indent=2, sort_keys=True))
    else:
        _print(file, verdict)
    if not verdict.is_accepted:
        raise typer.Exit(EXIT_REJECTED)


def _print(file: Path, verdict: "Verdict") -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    table = Table(title=f"{file.name}: {'accepted' if verdict.is_accepted else 'REJECTED'}")
    for column in ("check", "", "what was found"):
        table.add_column(column, no_wrap=column != "what was found")
    for check in verdict.checks:
        mark = Text("ok", style="green") if check.is_passed else Text("fail", style="bold red")
        table.add_row(check.name, mark, Text(check.detail))
    console.print(table)
    if verdict.is_accepted and verdict.submission is not None:
        scores = Table(title="SR and SPL in %, of the records")
        for column in ("agent", "n", "SR", "SPL"):
            scores.add_column(column, justify="left" if column == "agent" else "right")
        for agent, row in verdict.submission.summary["agents"].items():
            scores.add_row(agent, str(row["n"]), f"{100 * row['sr']:.1f}", f"{100 * row['spl']:.1f}")
        console.print(scores)
        if not verdict.is_rescored:
            console.print("The actions were not carried out again: the recorded paths were taken as they are.")
