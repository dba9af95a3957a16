"""Define a controlled analysis on disk: the same tasks in several arms that differ in one thing (paper, Sec. 4.3).

`controlled.json` says what the arms are. Each arm is an ordinary folder of tasks, `tasks/<arm>`, and what agents did in
it an ordinary run, `runs/<arm>`; a task has the same id in every arm.
"""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, NonNegativeInt, PositiveInt

from evonav.errors import InvalidArgumentError, TaskError
from evonav.parallel.folders import write_atomically
from evonav.records import Record, Version
from evonav.tasks.dataset import HouseRejection, SourceFile
from evonav.tasks.manifest import TaskId
from evonav.tasks.parameters import GenerationParameters
from evonav.tasks.records import Id, Probability, parse_record, read_file, record_bytes

FILE_NAME = "controlled.json"
RATES = (0.0, 0.25, 0.5, 0.75, 1.0)

Kind = Literal["pairs", "rates"]
"""`pairs`: one house as it was, and evolved for certain. `rates`: the same goals at several probabilities."""


class Arm(Record):
    """A variant in which all tasks are made."""

    name: Id
    evolve_probability: Probability
    """Probability of each transition; of `pairs`, of the transition before the evaluated stage."""


class ControlledOptions(Record):
    """Options that decide the tasks of a house."""

    kind: Kind = "pairs"
    seed: Annotated[int, Field(ge=0, lt=2**64)] = 0
    per_house: int = 1
    """Tasks a house: the seeds that follow `seed`."""
    rates: tuple[float, ...] = RATES
    """Probabilities of the arms of `rates`."""
    parameters: GenerationParameters = GenerationParameters()
    """Θ before what the arms set."""
    allow_unknown_assets: bool = False

    def model_post_init(self, _context: object) -> None:
        """Check the domains of the values."""
        if self.per_house < 1:
            raise InvalidArgumentError(f"per_house = {self.per_house}: must be at least 1")
        are_probabilities = all(0.0 <= rate <= 1.0 for rate in self.rates)
        if len(set(self.rates)) < 2 or sorted(set(self.rates)) != list(self.rates) or not are_probabilities:
            raise InvalidArgumentError(f"rates = {self.rates}: must be at least two of [0, 1], ascending")
        if self.parameters.extensions.during_stage is not None:
            message = "is on, but arms differ in the transitions between stages alone"
            raise InvalidArgumentError(f"parameters.extensions.during_stage {message}")

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The ways in which every task is made."""
        if self.kind == "pairs":
            return (Arm(name="fixed", evolve_probability=0.0), Arm(name="evolved", evolve_probability=1.0))
        return tuple(Arm(name=f"p{rate:.2f}", evolve_probability=rate) for rate in self.rates)


class ControlledRecord(Record):
    """All of `controlled.json`."""

    schema_version: Version = 1
    generator: Id
    sources: tuple[SourceFile, ...]
    limit: PositiveInt | None
    """Most houses."""
    options: ControlledOptions
    task_ids: tuple[TaskId, ...]
    num_attempts: NonNegativeInt
    """Draws over all tasks, those that were dropped included."""
    rejections: tuple[HouseRejection, ...]

    @property
    def kind(self) -> Kind:
        """Kind of difference between the arms."""
        return self.options.kind

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The ways in which every task is made."""
        return self.options.arms


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
    try:
        return parse_record(ControlledRecord, read_file(path), path)
    except InvalidArgumentError as error:
        raise TaskError(f"{path}: {error}") from None


def tasks_of(directory: Path, arm: str) -> Path:
    """Return the folder of an arm's tasks."""
    return directory / "tasks" / arm


def run_of(directory: Path, arm: str) -> Path:
    """Return the folder of an arm's run."""
    return directory / "runs" / arm
