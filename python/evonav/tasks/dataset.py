"""Read and write `dataset.json`: a folder's tasks, their source files, and the houses without a task."""

from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, NonNegativeInt, PositiveInt

from evonav.errors import StoreError, TaskError
from evonav.parallel.folders import write_atomically
from evonav.records import Record, Version
from evonav.tasks.manifest import Task, TaskId
from evonav.tasks.parameters import GenerationParameters
from evonav.tasks.records import Id, Sha256, field_error, parse_record, read_file, record_bytes, sha256_of

DATASET_NAME = "dataset.json"

RejectReason = Literal[
    "too_few_rooms",
    "no_start",
    "start_not_free",
    "start_outside",
    "disconnected",
    "no_valid_goal",
    "not_evolved",
    "malformed_house",
    "unusable_house",
    "crash",
    "timeout",
    "error",
]
"""Reason that a house gives no task.

`not_evolved`: a controlled analysis needs a change, and none could be made. `unusable_house`: the world cannot be
built, for example because of an unknown asset. `crash`, `timeout`, `error`: the generator failed.
"""


class SourceFile(Record):
    """A file of houses."""

    name: Annotated[str, Field(min_length=1, max_length=512)]
    """File name without folders, or `procthor-10k:val`."""
    sha256: Sha256
    """SHA-256 of the file's bytes."""


class TaskEntry(Record):
    """A task of the data set."""

    task_id: TaskId
    sha256: Sha256
    """SHA-256 of `task.json`, which contains the checksums of all other files."""
    house_sha256: Sha256
    """SHA-256 of the first house, `house.sha256` in `task.json`; subsets are chosen by it."""


class HouseRejection(Record):
    """A house that gave no task."""

    house: Annotated[str, Field(max_length=512)]
    """The house's name, as `HouseSource.name`."""
    reason: RejectReason
    stage: NonNegativeInt
    """The stage at which the problem was found, 0 before the first."""
    detail: Annotated[str, Field(max_length=2000)]


class DatasetRecord(Record):
    """The content of `dataset.json`. It depends on the request, not on the number of processes."""

    schema_version: Version = 1
    name: Id
    split: Id
    generator: Id
    """Program and version that made the tasks."""
    sources: tuple[SourceFile, ...]
    seed: Annotated[int, Field(ge=0, lt=2**64)]
    limit: PositiveInt | None
    """Largest number of tasks requested."""
    subset: Id | None
    """Named subset that the tasks are limited to (`evonav.tasks.subsets`)."""
    allow_unknown_assets: bool
    parameters: GenerationParameters
    num_houses: NonNegativeInt
    """Number of houses read: `num_tasks` and the rejections."""
    num_tasks: NonNegativeInt
    tasks: tuple[TaskEntry, ...]
    """The tasks, in order of task id."""
    rejections: tuple[HouseRejection, ...]
    """The rejected houses, in their order in the source."""

    @property
    def num_rejected(self) -> Counter[str]:
        """Houses without a task, by reason; `too_few_rooms` are the single-room houses, which the paper filters out."""
        return Counter(rejection.reason for rejection in self.rejections)


def entry_of(task: Task) -> TaskEntry:
    """Return the entry of a task as `write_task` writes it."""
    digest = sha256_of(record_bytes(task.header))
    return TaskEntry(task_id=task.task_id, sha256=digest, house_sha256=task.header.house.sha256)


def write_dataset(record: DatasetRecord, directory: Path | str) -> Path:
    """Write `dataset.json` atomically.

    Raises:
        TaskError: The file cannot be written.
    """
    path = Path(directory) / DATASET_NAME
    try:
        return write_atomically(path, record_bytes(record))
    except StoreError as error:
        raise TaskError(f"{path}: cannot be written: {error}") from error


def read_dataset(directory: Path | str) -> DatasetRecord:
    """Read `dataset.json` and check that it is consistent.

    Raises:
        TaskError: The file is missing or malformed; the message names file, field and value.
    """
    path = Path(directory) / DATASET_NAME
    record = parse_record(DatasetRecord, read_file(path), path)
    ids = [entry.task_id for entry in record.tasks]
    if ids != sorted(set(ids)):
        twisted = next(later for earlier, later in pairwise(ids) if later <= earlier)
        raise field_error(path, "tasks", twisted, "expected each task once, in order of task id")
    if record.num_tasks != len(ids):
        raise field_error(path, "num_tasks", record.num_tasks, f"expected {len(ids)}, the entries of `tasks`")
    if record.num_houses != len(ids) + len(record.rejections):
        expected = f"expected {len(ids) + len(record.rejections)}, tasks and rejections"
        raise field_error(path, "num_houses", record.num_houses, expected)
    return record


def check_dataset(record: DatasetRecord, directory: Path | str) -> list[tuple[str, str]]:
    """Compare a folder's tasks with its `dataset.json`.

    Returns:
        Task id and problem, in order of task id.
    """
    directory = Path(directory)
    entries = {entry.task_id: entry for entry in record.tasks}
    there = {path.parent.name for path in directory.glob("*/task.json")}
    problems = []
    for task_id in sorted(entries.keys() | there):
        if task_id not in there:
            problems.append((task_id, f"listed in {DATASET_NAME}, but not there"))
        elif task_id not in entries:
            problems.append((task_id, f"not listed in {DATASET_NAME}"))
        elif sha256_of(read_file(directory / task_id / "task.json")) != entries[task_id].sha256:
            problems.append((task_id, f"task.json is not the one that {DATASET_NAME} lists"))
    return problems
