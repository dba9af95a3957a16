"""What comes of a run: `report`, `strip`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import print_table
from evonav.cli.options import RunFolder
from evonav.cli.view import replay_pages

if TYPE_CHECKING:
    from evonav.report.run import Run

NUM_REPLAYS = 2


def report(
    run: RunFolder,
    out: Annotated[Path | None, typer.Option(help="Where to write; default: RUN.")] = None,
    replays: Annotated[
        str,
        typer.Option(metavar="all|N|none", help="Episodes to show round by round, the most telling first."),
    ] = str(NUM_REPLAYS),
    tasks: Annotated[
        Path | None, typer.Option(help="Folder of the run's tasks; default: where the run had them.")
    ] = None,
    exchanges: Annotated[Path | None, typer.Option(help="File of a model's answers; default: the one in RUN.")] = None,
    maps: Annotated[bool, typer.Option("--maps", help="Write every stage's map as a file too, maps/*.svg.")] = False,
) -> None:
    """Writes a run's report: one HTML file with tables, maps, and episodes round by round (docs/report.md)."""
    from evonav.evaluation.engine import write_summary
    from evonav.report import load_run, write_report

    num_replays = _count(replays)
    print_table(write_summary(run))
    if num_replays != 0:
        _replay(load_run(run), num_replays, tasks, exchanges)
    typer.echo(f"report: {write_report(run, out, has_maps=maps)}")


def strip(
    run: RunFolder,
    out: Annotated[Path, typer.Option(help="SVG file to write.")],
    task: Annotated[str | None, typer.Argument(help="Id of a task of the run; default: the most telling one.")] = None,
    agents: Annotated[str, typer.Option(help="Agents of the run, comma-separated: a row each.")] = "ftu",
    stages: Annotated[str, typer.Option(help="Stages, comma-separated; default: all.")] = "",
) -> None:
    """Draws one task of a run as a picture: stages side by side, agents below each other."""
    from evonav.report import write_strip

    try:
        numbers = [int(stage) for stage in stages.split(",")] if stages else None
    except ValueError:
        raise typer.BadParameter(f"--stages {stages}: numbers, comma-separated") from None
    typer.echo(f"picture: {write_strip(run, task, agents.split(','), out, stages=numbers)}")


def _count(replays: str) -> int | None:
    """How many; `None` for all."""
    if replays in ("all", "none"):
        return None if replays == "all" else 0
    if not replays.isdecimal():
        raise typer.BadParameter(f"--replays {replays}: a number, all or none")
    return int(replays)


def _replay(run: "Run", num: int | None, tasks: Path | None, exchanges: Path | None) -> None:
    """Makes the pages of the most telling episodes that have none of these records yet."""
    from evonav.errors import EvonavError
    from evonav.report.maps import VIEW_DIR
    from evonav.report.telling import telling_episodes
    from evonav.report.viewer import listed_pages

    there = {
        (page.agent, page.task_id): page.records_sha256
        for page in listed_pages(run.run_dir / VIEW_DIR)
        if page.is_current
    }
    wanted = telling_episodes(run)[:num]
    missing = [episode for episode in wanted if there.get(episode) != run.episodes_sha256[episode]]
    if not missing:
        return
    try:
        replay_pages(run, missing, tasks=tasks, exchanges=exchanges)
    except EvonavError as error:  # records alone are a report too
        typer.echo(f"no episodes round by round: {error}", err=True)
