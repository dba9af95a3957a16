"""Generate the task of one house in a worker, and move the task's folder to its place."""

import json
import os
import shutil
import socket
from collections.abc import Callable, Mapping
from pathlib import Path

from evonav.errors import EvonavError, HouseError, InvalidArgumentError, SimulationError, StoreError, TaskError
from evonav.generation.journal import Outcome
from evonav.generation.pipeline import TaskRejectedError, generate_task, short_name
from evonav.house import House
from evonav.parallel.folders import put_folder, sha256_of_file
from evonav.parallel.pool import Answer
from evonav.records import Record
from evonav.tasks import write_task
from evonav.tasks.dataset import RejectReason
from evonav.tasks.manifest import Task
from evonav.tasks.parameters import GenerationParameters

WORK = "evonav.generation.worker:make_worker"
PARTIAL_NAME = ".partial"
HOUSE_TIMEOUT_S = 120.0
"""Default number of seconds before a house is abandoned."""
"""Folder beside the tasks, for those that are being written."""
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


class _Reply(Record):
    """The reply of a worker; exactly one field is set."""

    outcome: Outcome | None = None
    invalid_argument: str | None = None
    """Message for an option outside its domain."""
    write_error: str | None = None
    """Message for a task that cannot be written."""


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
            reply = _Reply(outcome=process_house(index, name, house, lambda parsed: generate(parsed, *more)))
        except InvalidArgumentError as error:
            reply = _Reply(invalid_argument=str(error))
        except (TaskError, OSError) as error:
            reply = _Reply(write_error=str(error))
        return reply.model_dump_json(exclude_defaults=True)

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
        detail = answer.detail[-MAX_DETAIL:]
        return Outcome(index=answer.key, house=short_name(name), reason=answer.failure, detail=detail)
    reply = _Reply.model_validate_json(answer.text)
    if reply.invalid_argument is not None:
        raise InvalidArgumentError(reply.invalid_argument)
    if reply.outcome is None:
        raise StoreError(str(reply.write_error))
    return reply.outcome


def is_complete(outcome: Outcome, folder: Path) -> bool:
    """Return whether the task of an outcome is in a folder as it was written."""
    try:
        return sha256_of_file(folder / str(outcome.task_id) / "task.json") == outcome.task_sha256
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

    def without_task(reason: RejectReason, error: EvonavError, stage: int = 0) -> Outcome:
        detail = str(error)[:MAX_DETAIL]
        return Outcome(index=index, house=short_name(name), reason=reason, stage=stage, detail=detail)

    try:
        house = House(text, name=name)
    except HouseError as error:
        return without_task("malformed_house", error)
    try:
        tasks = generate(house)
    except TaskRejectedError as error:
        return without_task(error.reason, error, error.stage)
    except (HouseError, SimulationError) as error:
        return without_task("unusable_house", error)
    label = f"{socket.gethostname()}-{os.getpid()}"
    roots = [put_task(task, folder, label) for folder, task in tasks.items()]
    task = next(iter(tasks.values()))
    return Outcome(
        index=index,
        house=short_name(name),
        task_id=task.task_id,
        house_sha256=task.header.house.sha256,
        task_sha256=sha256_of_file(roots[-1] / "task.json"),
    )


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
