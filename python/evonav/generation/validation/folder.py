"""Validate a folder of tasks with any number of workers."""

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from evonav.errors import TaskError
from evonav.generation.validation.problems import Problem, Report
from evonav.generation.validation.task import validate_files
from evonav.parallel.pool import Answer, Job, answers, open_pool
from evonav.parallel.worker import Workforce
from evonav.tasks.dataset import DATASET_NAME, check_dataset, read_dataset
from evonav.tasks.listing import task_roots

WORK = "evonav.generation.validation.folder:make_worker"
TASK_TIMEOUT_S = 300.0


@dataclass(frozen=True, slots=True)
class FolderReport:
    """The result of validating a folder."""

    reports: tuple[Report, ...]
    """Reports of the tasks in order of task id."""
    problems: tuple[Problem, ...]
    """Problems of all tasks and of `dataset.json`."""

    @property
    def source_counts(self) -> Counter[str]:
        """Number of flaws in source houses, by kind; see `Report.source_counts`."""
        total: Counter[str] = Counter()
        for report in self.reports:
            total.update(report.source_counts)
        return total

    @property
    def num_invalid(self) -> int:
        """Number of tasks with a problem."""
        return len({problem.task_id for problem in self.problems if problem.task_id})


def validate_folder(
    folder: Path | str,
    *,
    limit: int | None = None,
    num_workers: int = 0,
    allow_unknown_assets: bool = False,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> FolderReport:
    """Validate a folder's tasks, and its `dataset.json` if it exists.

    Args:
        limit: Number of tasks, from the first by id; default all.
        num_workers: Number of processes; 0 for this process.
        allow_unknown_assets: Accept unknown assets even if `dataset.json` does not.
        on_progress: Called with the number of finished tasks and of all tasks, at the beginning and after every task.

    Raises:
        TaskError: The folder holds no task.
        EngineError: The workers cannot be started.
    """
    folder = Path(folder).resolve()
    roots = task_roots(folder)[:limit]
    problems: list[Problem] = []
    if (folder / DATASET_NAME).exists():
        try:
            record = read_dataset(folder)
            allow_unknown_assets |= record.allow_unknown_assets
            problems += [_dataset_problem(task_id, detail) for task_id, detail in check_dataset(record, folder)]
        except TaskError as error:
            problems.append(_dataset_problem("", str(error)))
    on_progress(0, len(roots))
    reports: dict[int, Report] = {}
    settings = json.dumps({"allow_unknown_assets": allow_unknown_assets})
    jobs = (Job(index, str(root)) for index, root in enumerate(roots))
    with open_pool(WORK, settings, Workforce(num_workers), timeout_s=TASK_TIMEOUT_S) as pool:
        for answer in answers(pool, jobs):
            reports[answer.key] = _report_of(answer, roots[answer.key].name)
            on_progress(len(reports), len(roots))
    ordered = tuple(reports[index] for index in sorted(reports))
    return FolderReport(ordered, (*problems, *(problem for report in ordered for problem in report.problems)))


def make_worker(settings: str, _alive: Callable[[], None]) -> Callable[[str], str]:
    """Return the function from a task's folder to its `Report`, for the pool of workers."""
    allow = bool(json.loads(settings)["allow_unknown_assets"])
    return lambda root: validate_files(root, allow_unknown_assets=allow).model_dump_json()


def _report_of(answer: Answer, task_id: str) -> Report:
    if answer.failure is None:
        return Report.model_validate_json(answer.text)
    problem = Problem(task_id=task_id, stage=0, kind="crash", detail=f"{answer.failure}: {answer.detail}")
    return Report(task_id=task_id, num_stages=0, problems=(problem,), source_counts={})


def _dataset_problem(task_id: str, detail: str) -> Problem:
    return Problem(task_id=task_id, stage=0, kind="dataset", detail=detail)
