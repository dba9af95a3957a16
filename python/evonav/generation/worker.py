"""What a worker does with a house: reads it, makes its task, and puts the task's folder where it belongs."""

import json
import os
import shutil
import socket
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from evonav.errors import EvonavError, HouseError, InvalidArgumentError, SimulationError, StoreError, TaskError
from evonav.generation.journal import Outcome
from evonav.generation.pipeline import TaskRejectedError, generate_task, short_name
from evonav.house import House
from evonav.parallel.folders import put_folder, sha256_of_file
from evonav.parallel.pool import Answer
from evonav.tasks import write_task
from evonav.tasks.dataset import RejectReason
from evonav.tasks.manifest import Task
from evonav.tasks.parameters import GenerationParameters

WORK = "evonav.generation.worker:make_worker"
PARTIAL_NAME = ".partial"
"""Beside the tasks: those that are being written."""
MAX_DETAIL = 2000
"""Characters, as `dataset.json` has them."""


@dataclass(frozen=True, slots=True)
class GenerationOptions:
    """What decides the task of a house."""

    seed: int = 0
    parameters: GenerationParameters = field(default_factory=GenerationParameters)
    dataset: str = "evonav"
    split: str = "none"
    allow_unknown_assets: bool = False

    def as_json(self) -> dict[str, Any]:
        """As JSON, to be read by `from_json`."""
        return {**asdict(self), "parameters": self.parameters.model_dump(mode="json")}

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> "GenerationOptions":
        """What `as_json` gave."""
        parameters = GenerationParameters.model_validate_json(json.dumps(values["parameters"]))
        return cls(**{**values, "parameters": parameters})

    def generate(self, house: House) -> Task:
        """The task of a house.

        Raises:
            EvonavError: As `evonav.generation.generate_task`.
        """
        return generate_task(
            house,
            seed=self.seed,
            config=self.parameters,
            dataset=self.dataset,
            split=self.split,
            allow_unknown_assets=self.allow_unknown_assets,
        )


def make_worker(settings: str, _alive: Callable[[], None]) -> Callable[[str], str]:
    """The function from a house to its `Outcome`, as `evonav.parallel.pool` calls it.

    Args:
        settings: `{"out": ..., "options": ...}`.

    Returns:
        See `worker_of`; nothing beside the name heads a house.
    """
    values = json.loads(settings)
    options, out = GenerationOptions.from_json(values["options"]), Path(values["out"])
    return worker_of(lambda house: {out: options.generate(house)})


def worker_of(make: Callable[..., Mapping[Path, Task]]) -> Callable[[str], str]:
    """What a worker does that makes tasks of houses and writes them.

    Args:
        make: From a house, and what else heads it, to its tasks by the folder that each goes to. The last is written
            last: if it is there, all are.

    Returns:
        It takes `[index, name, ...]` and, after a line feed, the house; and gives an `Outcome`, or `{"refused": ...}`
        for bad options, or `{"stop": ...}` where nothing can be written. `outcome_of` reads it.
    """

    def work(text: str) -> str:
        head, _, house = text.partition("\n")
        index, name, *more = json.loads(head)
        try:
            return _do_house(index, name, house, lambda found: make(found, *more)).model_dump_json()
        except InvalidArgumentError as error:
            return json.dumps({"refused": str(error)})
        except (TaskError, OSError) as error:
            return json.dumps({"stop": str(error)})

    return work


def outcome_of(answer: Answer, name: str) -> Outcome:
    """What a worker said of a house.

    Args:
        answer: Of a worker that does what `worker_of` gave.
        name: Of the house.

    Raises:
        InvalidArgumentError: An option is outside its domain.
        StoreError: A task cannot be written.
    """
    if answer.failure is not None:
        detail = answer.detail[-MAX_DETAIL:]
        return Outcome(index=answer.key, house=short_name(name), reason=answer.failure, detail=detail)
    values = json.loads(answer.text)
    if "refused" in values:
        raise InvalidArgumentError(values["refused"])
    if "stop" in values:
        raise StoreError(values["stop"])
    return Outcome.model_validate(values)


def is_whole(outcome: Outcome, folder: Path) -> bool:
    """Whether a task that the journal tells of is in a folder, as it was written."""
    try:
        return sha256_of_file(folder / str(outcome.task_id) / "task.json") == outcome.task_sha256
    except OSError:
        return False


def _do_house(index: int, name: str, text: str, make: Callable[[House], Mapping[Path, Task]]) -> Outcome:
    """Makes the tasks of a house and writes them.

    Raises:
        TaskError: One cannot be written.
        OSError: One cannot be written.
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
        tasks = make(house)
    except TaskRejectedError as error:
        return without_task(error.reason, error, error.stage)
    except (HouseError, SimulationError) as error:
        return without_task("unusable_house", error)
    label = f"{socket.gethostname()}-{os.getpid()}"
    roots = [put(task, folder, label) for folder, task in tasks.items()]
    task = next(iter(tasks.values()))
    return Outcome(
        index=index,
        house=short_name(name),
        task_id=task.task_id,
        house_sha256=task.header.house.sha256,
        task_sha256=sha256_of_file(roots[-1] / "task.json"),
    )


def put(task: Task, out: Path, label: str) -> Path:
    """Writes a task's folder wholly or not at all.

    Args:
        task: A task.
        out: Where its folder is to be; one of the same name is replaced.
        label: Of this process alone.

    Raises:
        TaskError: It cannot be written.
        OSError: It cannot be moved.
    """
    beside = out / PARTIAL_NAME / label
    shutil.rmtree(beside / task.task_id, ignore_errors=True)  # of an attempt that was not finished
    root = out / task.task_id
    put_folder(write_task(task, beside), root, aside=beside / "replaced")
    return root
