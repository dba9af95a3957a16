"""`evonav view`: show episodes in a browser, round by round."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import status
from evonav.cli.options.shared import Exchanges, RunAgents, RunFolder, RunTask, RunTasks, Stages, listed, numbers_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from evonav.report.pages.replays import ListedPage
    from evonav.report.run import RecordedRun


def view(
    run: RunFolder,
    task: RunTask = None,
    agent: RunAgents = None,
    stage: Stages = None,
    tasks: RunTasks = None,
    exchanges: Exchanges = None,
    out: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Folder to write. Default: RUN/view.")] = None,
    open_: Annotated[bool, typer.Option("--open", help="Open the page in a browser.")] = False,
) -> None:
    """Show episodes round by round: views, map, memory, answers.

    Writes HTML pages, and an index of them.
    """
    stages = numbers_of("--stage", stage)
    pages, index = make_pages(run, task, listed(agent), stages=stages, tasks=tasks, exchanges=exchanges, out=out)
    for page in pages:
        typer.echo(
            f"page: {index.parent / page.href}{' (the replay differs from the records)' if page.differs else ''}"
        )
    typer.echo(f"index: {index}")
    if open_:
        import webbrowser

        webbrowser.open((index.parent / pages[0].href if len(pages) == 1 else index).resolve().as_uri())


def make_pages(
    run: Path,
    task: str | None = None,
    agents: "Sequence[str]" = (),
    *,
    stages: "Sequence[int]" = (),
    tasks: Path | None = None,
    exchanges: Path | None = None,
    out: Path | None = None,
) -> "tuple[list[ListedPage], Path]":
    """Replay episodes and write their pages and the index.

    Args:
        task: Id of a task; default: the first highlight.
        stages: The stages to show, each on a page of its own; default: all, on one page.
    """
    from evonav.report.pages.replays import highlight_task
    from evonav.report.run import load_run

    found = load_run(run)
    agents = agents or found.agents
    task_id = task if task is not None else highlight_task(found, agents)
    episodes = [(name, task_id) for name in agents]
    return replay_pages(found, episodes, stages=stages, tasks=tasks, exchanges=exchanges, out=out)


def replay_pages(
    found: "RecordedRun",
    episodes: "Sequence[tuple[str, str]]",
    *,
    stages: "Sequence[int]" = (),
    tasks: Path | None = None,
    exchanges: Path | None = None,
    out: Path | None = None,
) -> "tuple[list[ListedPage], Path]":
    """Replay these episodes (agent, task) of a run, and write their pages and the index; see `make_pages`."""
    from evonav.replay.run_pages import write_pages

    with status("Replaying") as tell:
        return write_pages(found, episodes, stages=stages, tasks=tasks, exchanges=exchanges, out=out, tell=tell)
