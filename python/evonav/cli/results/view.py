"""`evonav view`: show episodes in a browser, round by round."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import status
from evonav.cli.options.shared import (
    Exchanges,
    RunAgents,
    RunFolder,
    RunTask,
    RunTasks,
    Stages,
    listed,
    numbers_of,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from evonav.report.pages.replays import ListedPage
    from evonav.report.run import Run


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
        run: A run.
        task: Id of a task; default: the best highlight.
        agents: Names; default: all of the run's.
        stages: The stages to show, each on a page of its own; default: all, on one page.
        tasks: Folder of the run's tasks.
        exchanges: File of a model's answers.
        out: Folder to write.
    """
    from evonav.report.pages.highlights import best_highlight
    from evonav.report.run import load_run

    found = load_run(run)
    agents = agents or found.agents
    # The best highlight is a task in which memory misleads the first agents, and not the last one.
    ranked = sorted(agents, key=lambda name: name not in ("fu", "stage-reset"))
    task_id = task if task is not None else best_highlight(found, ranked)[0]
    episodes = [(name, task_id) for name in agents]
    return replay_pages(found, episodes, stages=stages, tasks=tasks, exchanges=exchanges, out=out)


def replay_pages(
    found: "Run",
    episodes: "Sequence[tuple[str, str]]",
    *,
    stages: "Sequence[int]" = (),
    tasks: Path | None = None,
    exchanges: Path | None = None,
    out: Path | None = None,
) -> "tuple[list[ListedPage], Path]":
    """Replay these episodes (agent, task) of a run, and write their pages and the index; see `make_pages`."""
    from evonav.replay.pages import write_episode, write_index
    from evonav.replay.replay import RunReplay
    from evonav.report.maps.stage_map import VIEW_DIR

    replay = RunReplay(found.run_dir, task_path(found.run_dir, tasks), exchanges)
    out_dir = out or found.run_dir / VIEW_DIR
    pages = []
    with status("Replaying") as tell:
        for name, task_id in episodes:
            last = max(stages, default=None)
            replayed = list(replay.episode(name, task_id, _teller(tell, name, task_id), last_stage=last))
            for only in stages or (None,):
                pages += write_episode(
                    replayed,
                    out_dir,
                    budget=replay.budget(name),
                    success_radius_m=found.success_radius_m,
                    only=only,
                    records_sha256=found.episodes_sha256[name, task_id],
                )
    return pages, write_index(pages, out_dir, found.run_dir.resolve().name)


def _teller(tell: "Callable[[str], None]", agent: str, task_id: str) -> "Callable[[int, int], None]":
    return lambda stage, round_: tell(f"{agent} in {task_id}, stage {stage}, round {round_ + 1}")


def task_path(run: Path, tasks: Path | None) -> "Callable[[str], Path]":
    """Return a function that finds a task: in `tasks`, the run's folder, where the run found it, or among the bundled.

    Raises:
        TaskError: There are none.
    """
    from evonav.errors import TaskError
    from evonav.evaluation.records.store import RunStore
    from evonav.tasks.bundled import bundled_tasks

    with RunStore(run) as store:
        noted = store.meta("tasks_dir")
    with bundled_tasks() as bundled:
        places = [tasks] if tasks is not None else [run / "tasks", *([Path(noted)] if noted else []), bundled]

    def find(task_id: str) -> Path:
        found = next((place / task_id for place in places if (place / task_id / "task.json").is_file()), None)
        if found is None:
            looked = ", ".join(str(place) for place in places)
            raise TaskError(f"no task {task_id!r} in {looked}; name the folder of the run's tasks with --tasks")
        return found

    return find
