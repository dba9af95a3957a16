"""Generate the task of one house in a worker, and move the task's folder to its place."""

import json
import os
import shutil
import socket
from collections.abc import Callable, Mapping
from pathlib import Path

from evonav.errors import HouseError, InvalidArgumentError, SimulationError, StoreError, TaskError
from evonav.generation.journal import Outcome
from evonav.generation.pipeline import TaskRejectedError, generate_task, short_name
from evonav.house import House
from evonav.parallel.folders import put_folder, sha256_of_file
from evonav.parallel.pool import Answer
from evonav.records import Record
from evonav.tasks import write_task
from evonav.tasks.dataset import HouseRejection, RejectReason, TaskEntry
from evonav.tasks.manifest import Task
from evonav.tasks.parameters import GenerationParameters

WORK = "evonav.generation.worker:make_worker"
PARTIAL_NAME = ".partial"
"""Folder beside the tasks, for those that are being written."""
HOUSE_TIMEOUT_S = 120.0
"""Default number of seconds before a house is abandoned."""
MAX_DETAIL = 2000
"""Largest number of characters in the detail of an outcome, as in `dataset.json`."""


class GenerationOptions(Record):
    """The options that determine the task of a house."""

    seed: int = 0
    parameters: GenerationParameters = GenerationParameters()
    dataset: str = "evonav"
    split: str = "none"
    allow_unknown_assets: bool = False

    def generate(self, house: House) -> Task:
        """Generate the task of a house.

        Raises:
            EvonavError: The house gives no task, or an option is invalid; see `evonav.generation.generate_task`.
        """
        return generate_task(
            house,
            seed=self.seed,
            config=self.parameters,
            dataset=self.dataset,
            split=self.split,
            allow_unknown_assets=self.allow_unknown_assets,
        )


class WorkerSettings(Record):
    """The settings of a worker."""

    out: str
    """Folder of the tasks."""
    options: GenerationOptions


def make_worker(settings: str, _alive: Callable[[], None]) -> Callable[[str], str]:
    """Return the function of a worker, for `evonav.parallel.pool`.

    Args:
        settings: `WorkerSettings` as JSON.

    Returns:
        The function of `worker_of`; its jobs begin with `[index, name]`.
    """
    parsed = WorkerSettings.model_validate_json(settings)
    return worker_of(lambda house: {Path(parsed.out): parsed.options.generate(house)})


def worker_of(generate: Callable[..., Mapping[Path, Task]]) -> Callable[[str], str]:
    """Return the function of a worker that generates tasks from houses and writes them.

    Args:
        generate: Function from a house, and further values of the job, to tasks by the folder that each is written to.
            The last task is written last: if it exists, all do.

    Returns:
        A function from a job to a reply, which `outcome_of` reads. A job is the JSON `[index, name, ...]`, a line feed,
        and the text of a house.
    """

    def work(text: str) -> str:
        head, _, house = text.partition("\n")
        index, name, *more = json.loads(head)
        try:
            outcome = process_house(index, name, house, lambda parsed: generate(parsed, *more))
        except InvalidArgumentError as error:
            return json.dumps({"invalid_argument": str(error)})
        except (TaskError, OSError) as error:
            return json.dumps({"write_error": str(error)})
        return outcome.model_dump_json(exclude_defaults=True)

    return work


def outcome_of(answer: Answer, name: str) -> Outcome:
    """Return the outcome of a house from a worker's answer.

    Args:
        answer: The answer of a worker made by `worker_of`.

    Raises:
        InvalidArgumentError: An option is outside its domain.
        StoreError: A task cannot be written.
    """
    if answer.failure is not None:
        return _without_task(answer.key, name, answer.failure, answer.detail[-MAX_DETAIL:])
    reply = json.loads(answer.text)
    if "invalid_argument" in reply:
        raise InvalidArgumentError(reply["invalid_argument"])
    if "write_error" in reply:
        raise StoreError(reply["write_error"])
    return Outcome.model_validate_json(answer.text)


def _without_task(index: int, name: str, reason: RejectReason, detail: str, stage: int = 0) -> Outcome:
    rejection = HouseRejection(house=short_name(name), reason=reason, stage=stage, detail=detail)
    return Outcome(index=index, house=rejection.house, rejection=rejection)


def is_complete(outcome: Outcome, folder: Path) -> bool:
    """Return whether the task of an outcome is in a folder as it was written."""
    try:
        task = outcome.task
        return task is not None and sha256_of_file(folder / task.task_id / "task.json") == task.sha256
    except OSError:
        return False


def process_house(index: int, name: str, text: str, generate: Callable[[House], Mapping[Path, Task]]) -> Outcome:
    """Generate the tasks of a house and write them.

    Args:
        index: Index of the house in its source.
        text: ProcTHOR JSON.
        generate: Function from the house to its tasks, by the folder that each is written to.

    Raises:
        TaskError: A task cannot be written.
        OSError: A task cannot be moved to its place.
        InvalidArgumentError: A parameter is outside its domain.
    """
    try:
        house = House(text, name=name)
    except HouseError as error:
        return _without_task(index, name, "malformed_house", str(error)[:MAX_DETAIL])
    try:
        tasks = generate(house)
    except TaskRejectedError as error:
        return _without_task(index, name, error.reason, str(error)[:MAX_DETAIL], error.stage)
    except (HouseError, SimulationError) as error:
        return _without_task(index, name, "unusable_house", str(error)[:MAX_DETAIL])
    label = f"{socket.gethostname()}-{os.getpid()}"
    roots = [put_task(task, folder, label) for folder, task in tasks.items()]
    task = next(iter(tasks.values()))
    entry = TaskEntry(
        task_id=task.task_id,
        sha256=sha256_of_file(roots[-1] / "task.json"),
        house_sha256=task.header.house.sha256,
    )
    return Outcome(index=index, house=short_name(name), task=entry)


def put_task(task: Task, out: Path, label: str) -> Path:
    """Write a task's folder atomically, and replace one of the same name.

    Args:
        label: Label of this process, different from those of all others.

    Returns:
        The task's own folder.

    Raises:
        TaskError: The task cannot be written.
        OSError: The task cannot be moved to its place.
    """
    partial = out / PARTIAL_NAME / label
    shutil.rmtree(partial / task.task_id, ignore_errors=True)  # left by an attempt that was not finished
    root = out / task.task_id
    put_folder(write_task(task, partial), root, aside=partial / "replaced")
    return root
