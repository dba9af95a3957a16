"""Replay episodes of a run and write their pages, as `evonav view` and `Run.view` do."""

from collections.abc import Callable, Sequence
from pathlib import Path

from evonav.errors import TaskError
from evonav.evaluation.records.store import RunStore
from evonav.replay.pages import write_episode, write_index
from evonav.replay.replay import RunReplay
from evonav.report.maps.stage_map import VIEW_DIR
from evonav.report.pages.replays import ListedPage, highlights_first, listed_pages
from evonav.report.run import RecordedRun
from evonav.tasks.listing import BUNDLED_TASKS


def write_pages(
    run: RecordedRun,
    episodes: Sequence[tuple[str, str]],
    *,
    stages: Sequence[int] = (),
    tasks: Path | None = None,
    exchanges: Path | None = None,
    out: Path | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[list[ListedPage], Path]:
    """Replay episodes and write their pages and the index.

    Args:
        episodes: Agent and task id of each.
        stages: The stages to show, each on a page of its own; default: all, on one page.
        tasks: Folder of the run's tasks; default: where the run found them.
        exchanges: File of a model's answers; default: the run's.
        out: Folder to write; default: `view` in the run's folder.
        tell: Told what is being replayed.

    Returns:
        The pages, and the path of the index.
    """
    replay = RunReplay(run.run_dir, task_path(run.run_dir, tasks), exchanges)
    out_dir = out or run.run_dir / VIEW_DIR
    pages = []
    for agent, task_id in episodes:
        last = max(stages, default=None)
        replayed = list(replay.episode(agent, task_id, _teller(tell, agent, task_id), last_stage=last))
        for only in stages or (None,):
            pages += write_episode(
                replayed,
                out_dir,
                budget=replay.budget(agent),
                success_radius_m=run.success_radius_m,
                only=only,
                records_sha256=run.episodes_sha256[agent, task_id],
            )
    return pages, write_index(pages, out_dir, run.run_dir.resolve().name)


def unwritten_highlights(run: RecordedRun, num: int | None) -> list[tuple[str, str]]:
    """Return the highlights (agent and task id) that have no page of the run's present records.

    Args:
        num: Number of highlights to look at, the best first; `None` for all episodes.
    """
    written = {
        (page.agent, page.task_id): page.records_sha256
        for page in listed_pages(run.run_dir / VIEW_DIR)
        if page.is_current
    }
    wanted = highlights_first(run)[:num]
    return [episode for episode in wanted if written.get(episode) != run.episodes_sha256[episode]]


def _teller(tell: Callable[[str], None], agent: str, task_id: str) -> Callable[[int, int], None]:
    return lambda stage, round_: tell(f"{agent} in {task_id}, stage {stage}, round {round_ + 1}")


def task_path(run: Path, tasks: Path | None) -> Callable[[str], Path]:
    """Return a function that finds a task: in `tasks`, the run's folder, where the run found it, or among the bundled.

    The function raises a `TaskError` where there is no such task.
    """
    with RunStore(run) as store:
        noted = store.meta("tasks_dir")
    places = [tasks] if tasks is not None else [run / "tasks", *([Path(noted)] if noted else []), BUNDLED_TASKS]

    def find(task_id: str) -> Path:
        found = next((place / task_id for place in places if (place / task_id / "task.json").is_file()), None)
        if found is None:
            looked = ", ".join(str(place) for place in places)
            raise TaskError(f"no task {task_id!r} in {looked}; name the folder of the run's tasks with --tasks")
        return found

    return find
