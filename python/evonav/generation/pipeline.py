"""Generate tasks from houses: the core runs Algorithm 1 of the paper, this module writes its result as a task."""

import json
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.errors import TaskError
from evonav.generation.instructions.describe import (
    WRITER,
    appearance_instruction,
    basic_instruction,
    unified_instruction,
)
from evonav.generation.result import GeneratedStage, GenerationResult, GivenStage
from evonav.house import House
from evonav.tasks.dataset import RejectReason
from evonav.tasks.manifest import HouseSource, PublicStage, Task, TaskHeader
from evonav.tasks.oracle import OracleFields, OracleStage
from evonav.tasks.parameters import GenerationParameters
from evonav.tasks.records import sha256_of


class TaskRejectedError(TaskError):
    """A house gives no task."""

    def __init__(self, house: str, reason: RejectReason, stage: int, detail: str) -> None:
        super().__init__(f"house {house}: {reason} at stage {stage}: {detail}")
        self.reason = reason
        self.stage = stage


def generate_task(
    house: House,
    *,
    seed: int,
    config: GenerationParameters | None = None,
    dataset: str = "evonav",
    split: str = "none",
    allow_unknown_assets: bool = False,
    given: Sequence[GivenStage] = (),
    attempt: int = 0,
) -> Task:
    """Generate a task from a house (paper, Algorithm 1).

    All draws depend only on the seed, the attempt and the house's contents, and each has a random stream of its own:
    tasks that differ in what is given, or in the probability of evolution, share all other draws where possible.

    Args:
        house: House with at least two rooms.
        seed: Seed of all draws, 0 to 2^64 - 1.
        config: Generation parameters; default the paper's.
        dataset: Name of the data set, recorded in the header.
        split: Name of the split, recorded in the header.
        allow_unknown_assets: Give assets that the catalogue does not contain the size and shape of their category.
        given: Given parts of each stage from the first, instead of drawn ones; their number is the number of stages.
        attempt: Number of the attempt; each has its own draws.

    Raises:
        TaskRejectedError: The house gives no task; says why.
        HouseError: An asset is unknown and `allow_unknown_assets` is false.
        InvalidArgumentError: A parameter is outside its domain.
    """
    config = GenerationParameters() if config is None else config
    house_sha256 = sha256_of(house.to_json().encode())
    text, houses, images = _core.generate_task(
        house,
        seed=seed,
        label=house_sha256 if attempt == 0 else f"{house_sha256} attempt {attempt}",
        parameters_json=config.model_dump_json(),
        allow_unknown_assets=allow_unknown_assets,
        given_json=json.dumps({"stages": [stage.model_dump() for stage in given]}),
    )
    result = GenerationResult.model_validate_json(text)
    if result.rejected is not None:
        raise TaskRejectedError(house.name, result.rejected.reason, result.rejected.stage, result.rejected.detail)
    stages = () if result.task is None else result.task.stages
    source = house_source(house, house_sha256)
    header = TaskHeader(
        task_id=f"{_slug(source.name)}-{source.sha256[:6]}-s{seed}",
        dataset=dataset,
        split=split,
        generator=f"evonav {_core.__version__}",
        seed=seed,
        num_stages=len(stages),
        house=source,
        start_pose=stages[0].start_pose,
        parameters=config,
        checksums={},
    )
    task = Task(
        header=header,
        public_stages=tuple(_public_stage(number, stage) for number, stage in enumerate(stages, start=1)),
        reference_images=tuple(_image(data, config.reference_image_px) for data in images),
        oracle_stages=tuple(
            _oracle_stage(number, stage, house_json)
            for number, (stage, house_json) in enumerate(zip(stages, houses, strict=True), start=1)
        ),
        houses_json=tuple(houses),
    )
    return task.with_checksums()


def house_source(house: House, sha256: str) -> HouseSource:
    """Return a header's record of a house whose JSON has this checksum."""
    name = short_name(house.name)
    place = re.search(r":([1-9]\d*)(?:\[(\d+)\])?$", name)
    index = None if place is None else int(place[2]) if place[2] else int(place[1]) - 1
    return HouseSource(
        name=name,
        index=index,
        sha256=sha256,
        num_rooms=len(house.rooms),
        num_objects=len(house.objects),
    )


def _oracle_stage(number: int, stage: GeneratedStage, house_json: str) -> OracleStage:
    fields = {name: getattr(stage, name) for name in OracleFields.model_fields}
    return OracleStage(stage=number, house_sha256=sha256_of(house_json.encode()), **fields)


def _public_stage(number: int, stage: GeneratedStage) -> PublicStage:
    target, relations, appearance = stage.target, stage.relations, stage.appearance
    return PublicStage(
        stage=number,
        category=target.category,
        basic_instruction=basic_instruction(target.category, relations),
        appearance_instruction=appearance_instruction(target.category, target.size_m, appearance),
        unified_instruction=unified_instruction(target.category, target.size_m, relations, appearance),
        writer=WRITER,
    )


def _image(data: bytes, side_px: int) -> NDArray[np.uint8]:
    """Return RGB bytes as a read-only image."""
    return np.frombuffer(data, dtype=np.uint8).reshape(side_px, side_px, 3)


def short_name(name: str) -> str:
    """Return a house's name without the folder of its file."""
    return name.replace("\\", "/").rsplit("/", 1)[-1]


def _slug(name: str) -> str:
    """Return a house's name as a part of a task id, with padded numbers so that ids sort as houses do."""
    stem = re.sub(r"\.(jsonl|json)(\.gz)?", "", name)
    slug = re.sub(r"[^A-Za-z0-9]+", "-", stem).strip("-")[:80] or "house"
    return re.sub(r"\d+", lambda digits: digits.group().zfill(4), slug)
