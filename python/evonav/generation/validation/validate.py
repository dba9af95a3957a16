"""Validate a task completely, or a folder of tasks with any number of workers."""

import json
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evonav.errors import EvonavError, TaskError
from evonav.generation.validation.changes import Found, check_changes, check_displacements, check_relocation
from evonav.generation.validation.integrity import leaks, read_all
from evonav.generation.validation.problems import Problem, Report
from evonav.generation.validation.world import (
    check_moved_target,
    check_path,
    check_physics,
    check_reference,
    check_state,
    check_target,
    rooms_reached,
    simulator_of,
)
from evonav.house import House
from evonav.parallel.pool import Answer, Job, answers, open_pool
from evonav.parallel.worker import Workforce
from evonav.tasks.dataset import DATASET_NAME, check_dataset, read_dataset
from evonav.tasks.listing import task_roots
from evonav.tasks.manifest import Task
from evonav.tasks.oracle import DuringRecord
from evonav.tasks.records import PoseRecord

WORK = "evonav.generation.validation.validate:make_worker"
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


def validate_files(root: Path | str, *, allow_unknown_assets: bool = False) -> Report:
    """Read a task's folder and report all its problems.

    Args:
        root: The task's own folder.
        allow_unknown_assets: The option with which the task was generated.
    """
    root = Path(root)
    task, problems = read_all(root)
    if task is None:
        return Report(task_id=root.name, num_stages=0, problems=tuple(problems), source_counts={})
    report = validate_task(task, allow_unknown_assets=allow_unknown_assets)
    return report.model_copy(update={"task_id": root.name, "problems": (*problems, *report.problems)})


def validate_task(task: Task, *, allow_unknown_assets: bool = False) -> Report:
    """Check a task's records against its houses.

    Args:
        task: A generated or loaded task.
        allow_unknown_assets: The option with which the task was generated.
    """
    check = _TaskCheck(task, allow_unknown_assets)
    for stage in range(1, task.num_stages + 1):
        try:
            check.check_stage(stage)
        except EvonavError as error:
            check.add(stage, [("house", str(error))])
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
            check.add(stage, [("house", f"not a ProcTHOR house: {type(error).__name__}: {error}")])
    source_counts = dict(sorted(check.source_counts.items()))
    return Report(
        task_id=task.task_id, num_stages=task.num_stages, problems=tuple(check.problems), source_counts=source_counts
    )


class _TaskCheck:
    """The checks of a task's stages, and their problems."""

    def __init__(self, task: Task, allow_unknown_assets: bool) -> None:
        self.task = task
        self.problems: list[Problem] = []
        self.source_counts: Counter[str] = Counter()
        self._allow = allow_unknown_assets
        self._simulator = simulator_of(task, allow_unknown_assets=allow_unknown_assets)
        self._houses: dict[int, House] = {}
        self._documents: dict[int, dict[str, Any]] = {}

    def add(self, stage: int, found: Iterable[Found]) -> None:
        for kind, detail in found:
            self.problems.append(Problem(task_id=self.task.task_id, stage=stage, kind=kind, detail=detail))

    def check_stage(self, stage: int) -> None:
        task, oracle, simulator = self.task, self.task.oracle(stage), self._simulator
        document = self._document(stage)
        self.add(stage, (("leak", detail) for detail in leaks(task, stage, document)))
        house = self._house(stage)
        before_json = task.house_json_at_end(stage - 1) if stage > 1 else task.house_json(stage)
        self.add(stage, check_changes(_document_of(before_json), document, oracle.evolution, house))
        self.add(stage, check_relocation(task, stage))
        self.add(stage, check_state(task, stage, house))
        if stage == 1:
            simulator.reset(task.house_json(1), name="stage 1")
            self._check_physics(stage, house)
        elif task.house_json(stage) != before_json:
            self._enter(stage, house, task.house_json(stage), oracle.start_pose)
        self.add(stage, check_target(task, house, simulator, oracle))
        self.add(stage, check_reference(task, stage, house, simulator))
        self.add(stage, check_path(oracle, simulator))
        if oracle.during is not None:
            self._check_during(stage, oracle.during)

    def _check_during(self, stage: int, during: DuringRecord) -> None:
        """Check the change during a stage; the simulator holds the stage's house, and the changed one afterwards."""
        task, oracle = self.task, self.task.oracle(stage)
        parameters = task.header.parameters
        house_json = task.house_json_at_end(stage)
        house = House(house_json, name=f"end of stage {stage}")
        self.add(stage, check_changes(self._document(stage), _document_of(house_json), during.evolution, house))
        self.add(stage, check_displacements(during.evolution, parameters.relocated_min_m))
        if stage in task.guided_stages:
            self.add(stage, [("contradiction", "the house changes during a guided stage")])
        self._enter(stage, house, house_json, oracle.reference_pose)
        self.add(stage, check_moved_target(oracle, during, parameters, house, self._simulator))

    def _enter(self, stage: int, house: House, house_json: str, pose: PoseRecord) -> None:
        """Load a changed house and check its physics, and that all rooms reached from a pose still can be."""
        before = rooms_reached(house, self._simulator, pose)
        self._simulator.reset(house_json, name=house.name)
        self._check_physics(stage, house)
        cut_off = sorted(before - rooms_reached(house, self._simulator, pose))
        self.add(stage, (("room_cut_off", f"{room} can no longer be reached") for room in cut_off))

    def _check_physics(self, stage: int, house: House) -> None:
        self.add(stage, check_physics(self._house(1), house, self.source_counts, allow_unknown_assets=self._allow))

    def _house(self, stage: int) -> House:
        if stage not in self._houses:
            self._houses[stage] = House(self.task.house_json(stage), name=f"stage {stage}")
        return self._houses[stage]

    def _document(self, stage: int) -> dict[str, Any]:
        if stage not in self._documents:
            self._documents[stage] = _document_of(self.task.house_json(stage))
        return self._documents[stage]


def _document_of(house_json: str) -> dict[str, Any]:
    document = json.loads(house_json)
    if not isinstance(document, dict):
        raise TypeError(f"expected an object, found {type(document).__name__}")
    return document
