"""What a worker does with a house: reads it, makes its task, and puts the task's folder where it belongs."""

import json
import os
import shutil
import socket
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from evonav.errors import EvonavError, HouseError, InvalidArgumentError, SimulationError, TaskError
from evonav.folders import put_folder, sha256_of_file
from evonav.generation.journal import Outcome
from evonav.generation.pipeline import TaskRejectedError, generate_task, short_name
from evonav.house import House
from evonav.tasks import write_task
from evonav.tasks.dataset import RejectReason
from evonav.tasks.manifest import GenerationParameters, Task

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
    """The function from a house to its `Outcome`, as `evonav.parallel` calls it.

    Args:
        settings: `{"out": ..., "options": ...}`.

    Returns:
        It takes `[index, name]` and, after a line feed, the house; and gives an `Outcome`, or `{"refused": ...}` for
        bad options, or `{"stop": ...}` where nothing can be written.
    """
    values = json.loads(settings)
    options, out = GenerationOptions.from_json(values["options"]), Path(values["out"])

    def work(text: str) -> str:
        head, _, house = text.partition("\n")
        index, name = json.loads(head)
        try:
            return do_house(index, name, house, options, out).model_dump_json()
        except InvalidArgumentError as error:
            return json.dumps({"refused": str(error)})
        except (TaskError, OSError) as error:
            return json.dumps({"stop": str(error)})

    return work


def do_house(index: int, name: str, text: str, options: GenerationOptions, out: Path) -> Outcome:
    """Makes the task of a house and writes it.

    Raises:
        TaskError: It cannot be written.
        OSError: It cannot be written.
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
        task = options.generate(house)
    except TaskRejectedError as error:
        return without_task(error.reason, error, error.stage)
    except (HouseError, SimulationError) as error:
        return without_task("unusable_house", error)
    root = put(task, out, f"{socket.gethostname()}-{os.getpid()}")
    return Outcome(
        index=index,
        house=short_name(name),
        task_id=task.task_id,
        house_sha256=task.header.house.sha256,
        task_sha256=sha256_of_file(root / "task.json"),
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
