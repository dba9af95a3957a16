"""Define a controlled analysis on disk: the same tasks in several arms that differ in one thing (paper, Sec. 4.3).

`controlled.json` says what the arms are. Each arm is an ordinary folder of tasks, `tasks/<arm>`, and what agents did in
it an ordinary run, `runs/<arm>`; a task has the same id in every arm.
"""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, NonNegativeInt, PositiveInt

from evonav.errors import TaskError
from evonav.parallel.folders import write_atomically
from evonav.records import Record, Version
from evonav.tasks.dataset import HouseRejection, SourceFile
from evonav.tasks.manifest import TaskId
from evonav.tasks.parameters import GenerationParameters
from evonav.tasks.records import Id, Probability, parse_record, read_file, record_bytes

FILE_NAME = "controlled.json"

Kind = Literal["pairs", "rates"]
"""`pairs`: one house as it was, and evolved for certain. `rates`: the same goals at several probabilities."""


class Arm(Record):
    """A variant in which all tasks are made."""

    name: Id
    evolve_probability: Probability
    """Probability of each transition; of `pairs`, of the transition before the evaluated stage."""


class ControlledRecord(Record):
    """All of `controlled.json`."""

    schema_version: Version = 1
    kind: Kind
    arms: Annotated[tuple[Arm, ...], Field(min_length=2)]
    generator: Id
    sources: tuple[SourceFile, ...]
    seed: Annotated[int, Field(ge=0, lt=2**64)]
    limit: PositiveInt | None
    """Most houses."""
    per_house: PositiveInt
    """Tasks of each house in each arm."""
    allow_unknown_assets: bool
    parameters: GenerationParameters
    """Θ before what the arms set."""
    task_ids: tuple[TaskId, ...]
    num_attempts: NonNegativeInt
    """Draws over all tasks, those that were dropped included."""
    rejections: tuple[HouseRejection, ...]


def write_controlled(record: ControlledRecord, directory: Path) -> Path:
    """Write `controlled.json`, all of it or nothing."""
    return write_atomically(directory / FILE_NAME, record_bytes(record))


def read_controlled(directory: Path) -> ControlledRecord:
    """Read `controlled.json`.

    Raises:
        TaskError: It is missing or malformed; it says what to do.
    """
    path = directory / FILE_NAME
    if not path.is_file():
        raise TaskError(
            f"{directory}: no controlled analysis ({FILE_NAME} not found): `evonav controlled generate` first"
        )
    return parse_record(ControlledRecord, read_file(path), path)


def tasks_of(directory: Path, arm: str) -> Path:
    """Return the folder of an arm's tasks."""
    return directory / "tasks" / arm


def run_of(directory: Path, arm: str) -> Path:
    """Return the folder of an arm's run."""
    return directory / "runs" / arm
