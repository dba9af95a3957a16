"""Tasks from houses: the core does Algorithm 1 of the paper, this gives the result its words and its form."""

import dataclasses
import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.errors import TaskError
from evonav.generation.instructions.appearance import parse_appearance
from evonav.generation.instructions.describe import (
    WRITER,
    appearance_instruction,
    basic_instruction,
    parse_relations,
    unified_instruction,
)
from evonav.house import House
from evonav.tasks.dataset import RejectReason
from evonav.tasks.files import checksums_of
from evonav.tasks.manifest import GenerationParameters, HouseSource, PublicStage, Task, TaskHeader
from evonav.tasks.oracle import OracleStage
from evonav.tasks.records import sha256_of

_ORACLE_KEYS = frozenset(OracleStage.model_fields) - {"schema_version", "stage", "house_sha256"}


@dataclass(frozen=True, slots=True)
class GivenStage:
    """What of a stage is given instead of drawn."""

    goal_id: str | None = None
    """Object that is the goal."""
    is_evolved: bool | None = None
    """Whether the transition before the stage evolves the house."""


class TaskRejectedError(TaskError):
    """No task can be made of a house."""

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
    """Makes a task of a house (paper, Algorithm 1).

    What is drawn depends on the seed, the attempt and the house's contents only, each draw by itself: tasks that differ
    in what is given, or in the probability of evolution, share what they can.

    Args:
        house: Two rooms or more.
        seed: Of all draws, 0 to 2^64 - 1.
        config: Θ; default the paper's.
        dataset: Recorded in the header.
        split: Recorded in the header.
        allow_unknown_assets: Give assets that the catalogue lacks the size and shape of their category.
        given: What is not drawn, of each stage from the first; as many stages as the task then has.
        attempt: Another one draws anew.

    Raises:
        TaskRejectedError: The house does not allow a task; it says why.
        HouseError: An asset is unknown, unless allowed.
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
        given_json=json.dumps({"stages": [dataclasses.asdict(stage) for stage in given]}),
    )
    made = json.loads(text)
    if "rejected" in made:
        rejected = made["rejected"]
        raise TaskRejectedError(house.name, rejected["reason"], rejected["stage"], rejected["detail"])
    source = house_source(house, house_sha256)
    stages = made["task"]["stages"]
    oracle = tuple(_oracle_stage(k, stage, houses[k - 1]) for k, stage in enumerate(stages, start=1))
    header = TaskHeader(
        task_id=f"{_slug(source.name)}-{source.sha256[:6]}-s{seed}",
        dataset=dataset,
        split=split,
        generator=f"evonav {_core.__version__}",
        seed=seed,
        num_stages=len(stages),
        house=source,
        start_pose=oracle[0].start_pose,
        parameters=config,
        checksums={},
    )
    task = Task(
        header=header,
        public_stages=tuple(_public_stage(k, stage) for k, stage in enumerate(stages, start=1)),
        reference_images=tuple(_image(data, config.reference_image_px) for data in images),
        oracle_stages=oracle,
        houses_json=tuple(houses),
    )
    return dataclasses.replace(task, header=header.model_copy(update={"checksums": checksums_of(task)}))


@dataclass
class Rejections:
    """Houses that gave no task."""

    num_houses: int = 0
    """Houses looked at."""
    reasons: Counter[str] = field(default_factory=Counter)
    messages: list[str] = field(default_factory=list)

    @property
    def num_rejected(self) -> int:
        """Houses without a task."""
        return sum(self.reasons.values())


def generate_tasks(
    houses: Iterable[House],
    *,
    seed: int,
    config: GenerationParameters | None = None,
    rejections: Rejections | None = None,
    dataset: str = "evonav",
    split: str = "none",
    allow_unknown_assets: bool = False,
) -> Iterator[Task]:
    """One task a house, leaving out houses that allow none.

    Args:
        houses: Any number.
        seed: As for `generate_task`, the same for all houses.
        config: Θ.
        rejections: Filled as houses are left out.
        dataset: Recorded in the headers.
        split: Recorded in the headers.
        allow_unknown_assets: As for `generate_task`.
    """
    rejections = Rejections() if rejections is None else rejections
    for house in houses:
        rejections.num_houses += 1
        try:
            task = generate_task(
                house,
                seed=seed,
                config=config,
                dataset=dataset,
                split=split,
                allow_unknown_assets=allow_unknown_assets,
            )
        except TaskRejectedError as error:
            rejections.reasons[error.reason] += 1
            rejections.messages.append(str(error))
        except (_core.HouseError, _core.SimulationError) as error:
            rejections.reasons["unusable_house"] += 1
            rejections.messages.append(str(error))
        else:
            yield task


def house_source(house: House, sha256: str) -> HouseSource:
    """What a header says of a house, whose JSON has this checksum."""
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


def _oracle_stage(number: int, stage: dict[str, Any], house_json: str) -> OracleStage:
    """The core's record of a stage, checked."""
    record = {key: stage[key] for key in _ORACLE_KEYS}
    record |= {"stage": number, "house_sha256": sha256_of(house_json.encode())}
    return OracleStage.model_validate_json(json.dumps(record))


def _public_stage(number: int, stage: dict[str, Any]) -> PublicStage:
    target = stage["target"]
    category = cast("str", target["category"])
    relations = parse_relations(stage["relations"])
    appearance = parse_appearance(stage["appearance"], target["size_m"])
    return PublicStage(
        stage=number,
        category=category,
        basic_instruction=basic_instruction(category, relations),
        appearance_instruction=appearance_instruction(category, appearance),
        unified_instruction=unified_instruction(category, relations, appearance),
        writer=WRITER,
    )


def _image(data: bytes, side_px: int) -> NDArray[np.uint8]:
    """RGB bytes as a read-only image."""
    return np.frombuffer(data, dtype=np.uint8).reshape(side_px, side_px, 3)


def short_name(name: str) -> str:
    """A house's name without the folder of its file."""
    return name.replace("\\", "/").rsplit("/", 1)[-1]


def _slug(name: str) -> str:
    """A file name's or caller's name in a task id, numbers padded so that ids sort as houses do."""
    stem = re.sub(r"\.(jsonl|json)(\.gz)?", "", name)
    words = re.sub(r"[^A-Za-z0-9]+", "-", stem).strip("-")[:80] or "house"
    return re.sub(r"\d+", lambda digits: digits.group().zfill(4), words)
