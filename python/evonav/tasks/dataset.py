"""`dataset.json`: what a folder of tasks is, what it was made of, and which houses gave none."""

from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, NonNegativeInt, PositiveInt

from evonav.errors import StoreError, TaskError
from evonav.parallel.folders import write_atomically
from evonav.tasks.manifest import GenerationParameters, Task, TaskId
from evonav.tasks.records import Id, Record, Sha256, field_error, parse_record, read_file, record_bytes, sha256_of

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
"""Why a house gives no task; `not_evolved` when a controlled analysis needs a change and none could be made,
`unusable_house` when the world cannot be built, such as for an unknown asset. At a `crash`, `timeout` or `error` it is
the generator that failed."""


class SourceFile(Record):
    """A file of houses."""

    name: Annotated[str, Field(min_length=1, max_length=512)]
    """Without folders, or `procthor-10k:val`."""
    sha256: Sha256
    """Of its bytes."""


class TaskEntry(Record):
    """A task of the set."""

    task_id: TaskId
    sha256: Sha256
    """Of the bytes of `task.json`, which holds the checksums of all else."""
    house_sha256: Sha256
    """Of the first house, `task.json`'s `house.sha256`: what subsets are chosen by."""


class HouseRejection(Record):
    """A house that gave no task."""

    house: Annotated[str, Field(max_length=512)]
    """As `HouseSource.name`."""
    reason: RejectReason
    stage: NonNegativeInt
    """At which it was found, 0 before the first."""
    detail: Annotated[str, Field(max_length=2000)]


class DatasetRecord(Record):
    """All of `dataset.json`. It depends on what was asked for, not on how many processes did it."""

    schema_version: Literal[2] = 2
    name: Id
    split: Id
    generator: Id
    """Program and version."""
    sources: tuple[SourceFile, ...]
    seed: Annotated[int, Field(ge=0, lt=2**64)]
    limit: PositiveInt | None
    """Most tasks that were asked for."""
    subset: Id | None
    """Named subset that alone was made (`evonav.tasks.subsets`)."""
    allow_unknown_assets: bool
    parameters: GenerationParameters
    num_houses: NonNegativeInt
    """Houses looked at: `num_tasks` and the rejections."""
    num_tasks: NonNegativeInt
    tasks: tuple[TaskEntry, ...]
    """In order of task id."""
    rejections: tuple[HouseRejection, ...]
    """In order of the houses."""

    @property
    def num_rejected(self) -> Counter[str]:
        """Houses without a task, by reason; `too_few_rooms` are the single-room houses, which the paper filters out."""
        return Counter(rejection.reason for rejection in self.rejections)


def entry_of(task: Task) -> TaskEntry:
    """The entry of a task as `write_task` writes it."""
    digest = sha256_of(record_bytes(task.header))
    return TaskEntry(task_id=task.task_id, sha256=digest, house_sha256=task.header.house.sha256)


def write_dataset(record: DatasetRecord, directory: Path | str) -> Path:
    """Writes `dataset.json`, all of it or nothing.

    Raises:
        TaskError: It cannot be written.
    """
    path = Path(directory) / DATASET_NAME
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, record_bytes(record))
    except (OSError, StoreError) as error:
        raise TaskError(f"{path}: cannot be written: {error}") from error
    return path


def read_dataset(directory: Path | str) -> DatasetRecord:
    """Reads `dataset.json` and checks that it does not contradict itself.

    Raises:
        TaskError: With file, field and value.
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
    """What of a folder's tasks is not as its `dataset.json` says.

    Returns:
        Task id, and what is wrong, in order of task id.
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
