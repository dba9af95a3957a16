"""Define a task: header, public stages, oracle stages, stage houses. `evonav.tasks.files` reads and writes it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    Field,
    NonNegativeInt,
    PositiveInt,
)

from evonav.house import House
from evonav.records import Record, Version
from evonav.tasks.oracle import Evolution, OracleStage
from evonav.tasks.parameters import GenerationParameters
from evonav.tasks.public import Goal
from evonav.tasks.records import Id, PoseRecord, Sha256, record_bytes, sha256_of
from evonav.world.pose import Pose

TaskId = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,127}$")]


class HouseSource(Record):
    """The origin of a task's first house."""

    name: Annotated[str, Field(max_length=512)]
    """File without folders (or set and split), line, and index in a list of houses."""
    index: NonNegativeInt | None
    """Index of the line in its file, or of the house in its list, from 0; `None` for houses of other origin."""
    sha256: Sha256
    """SHA-256 of the house JSON as evonav writes it."""
    num_rooms: PositiveInt
    num_objects: PositiveInt


class Control(Record):
    """A task's place in a controlled analysis (paper, Sec. 4.3; docs/controlled.md); its arms differ in one factor."""

    arm: Id
    """The arm: `fixed` or `evolved`, or a probability of evolution such as `p0.25`."""
    attempt: NonNegativeInt
    """Number of earlier draws that were rejected because a goal was not possible in every arm."""
    guided_stages: tuple[PositiveInt, ...]
    """Stages in which the evaluator moves the agent along the reference trajectory. They are not scored."""
    shown_goals: tuple[PositiveInt, ...]
    """The stage whose instructions and image the agent receives, for each stage.

    It is the stage itself or the earlier one with the same target, so that the input is the same whatever has changed.
    """


class TaskHeader(Record):
    """The content of `task.json` (paper, Sec. A.3)."""

    schema_version: Version = 1
    task_id: TaskId
    dataset: Id
    split: Id
    generator: Id
    """Program and version that made the task."""
    seed: Annotated[int, Field(ge=0, lt=2**64)]
    num_stages: Annotated[int, Field(ge=1, le=64)]
    house: HouseSource
    start_pose: PoseRecord
    parameters: GenerationParameters
    checksums: dict[str, Sha256]
    """Checksum of each file's contents: JSON as it is, `.gz` uncompressed, `.png` its RGB values row by row."""
    control: Control | None = None
    """The task's place in a controlled analysis; `None` for other tasks."""


class PublicStage(Record):
    """The content of `public/stage_k.json`: the goal g_k without its start pose, which reveals the previous target."""

    schema_version: Version = 1
    stage: Annotated[int, Field(ge=1)]
    category: Id
    basic_instruction: Annotated[str, Field(min_length=1, max_length=2000)]
    appearance_instruction: Annotated[str, Field(min_length=1, max_length=2000)]
    unified_instruction: Annotated[str, Field(min_length=1, max_length=2000)]
    writer: Id
    """Author of the appearance and unified instructions: `evonav-describer 1`, or `vlm:` and a model's name."""


@dataclass(frozen=True, repr=False)
class Task:
    """A task in memory; its stages count from 1."""

    header: TaskHeader
    public_stages: tuple[PublicStage, ...]
    reference_images: tuple[NDArray[np.uint8], ...]
    """The stages' RGB images, `(S, S, 3)`, read-only."""
    oracle_stages: tuple[OracleStage, ...]
    houses_json: tuple[str, ...]
    """The complete house of each stage, as ProcTHOR JSON."""
    root: Path | None = field(default=None, compare=False)
    """The folder from which the task was read, if it was."""

    def __repr__(self) -> str:
        """Return the id and the categories of the goals."""
        goals = ", ".join(stage.category for stage in self.public_stages)
        return f"Task(id={self.task_id!r}, num_stages={self.num_stages}, goals=[{goals}])"

    @property
    def task_id(self) -> str:
        """Id of the task within its data set."""
        return self.header.task_id

    @property
    def num_stages(self) -> int:
        """Number of stages K."""
        return self.header.num_stages

    @property
    def guided_stages(self) -> tuple[int, ...]:
        """Stages in which the evaluator moves the agent."""
        return () if self.header.control is None else self.header.control.guided_stages

    @property
    def start_pose(self) -> Pose:
        """The agent's start pose in stage 1."""
        return self.header.start_pose.pose()

    @cached_property
    def contents(self) -> Mapping[str, bytes]:
        """Uncompressed contents of the task's files except `task.json`, by relative path, serialised once.

        Checksums are computed from these: JSON as it is, images as their RGB values row by row.
        """
        contents: dict[str, bytes] = {}
        for index, house_json in enumerate(self.houses_json):
            contents[f"houses/stage_{index + 1}.json.gz"] = house_json.encode()
            contents[f"oracle/stage_{index + 1}.json"] = record_bytes(self.oracle_stages[index])
            contents[f"public/stage_{index + 1}.json"] = record_bytes(self.public_stages[index])
            contents[f"public/stage_{index + 1}.png"] = self.reference_images[index].tobytes()
        return dict(sorted(contents.items()))

    @property
    def checksums(self) -> dict[str, str]:
        """Checksums of the task's files, as its header must list them."""
        return {name: sha256_of(data) for name, data in self.contents.items()}

    def with_checksums(self) -> "Task":
        """Return the task with the checksums of its files in its header."""
        task = replace(self, header=self.header.model_copy(update={"checksums": self.checksums}))
        vars(task)["contents"] = self.contents  # they do not depend on the header
        return task

    def public(self, stage: int) -> Goal:
        """Return the agent's input of a stage.

        Raises:
            IndexError: The stage does not exist.
        """
        public = self.public_stages[self._index(stage)]
        return Goal(
            stage=stage,
            category=public.category,
            basic_instruction=public.basic_instruction,
            appearance_instruction=public.appearance_instruction,
            unified_instruction=public.unified_instruction,
            reference_image=self.reference_images[self._index(stage)],
        )

    def oracle(self, stage: int) -> OracleStage:
        """Return the evaluator's part of a stage.

        Raises:
            IndexError: The stage does not exist.
        """
        return self.oracle_stages[self._index(stage)]

    def house_json(self, stage: int) -> str:
        """Return the house of a stage as ProcTHOR JSON.

        Raises:
            IndexError: The stage does not exist.
        """
        return self.houses_json[self._index(stage)]

    def house_json_at_end(self, stage: int) -> str:
        """Return the house as a stage leaves it, as ProcTHOR JSON: after the change during the stage, if there is one.

        Raises:
            HouseError: The change names an object that the house does not contain.
            IndexError: The stage does not exist.
        """
        during = self.oracle(stage).during
        if during is None:
            return self.house_json(stage)
        return House(self.house_json(stage)).apply(json.dumps(during.evolution.delta())).to_json()

    def evolutions_before(self, stage: int) -> tuple[Evolution, ...]:
        """Return all changes up to a stage's start, in order: of the transitions, and during earlier stages."""
        found: list[Evolution] = []
        for oracle in self.oracle_stages[:stage]:
            found.append(oracle.evolution)
            if oracle.during is not None and oracle.stage < stage:
                found.append(oracle.during.evolution)
        return tuple(found)

    def _index(self, stage: int) -> int:
        if not 1 <= stage <= self.num_stages:
            raise IndexError(f"task {self.task_id}: stage {stage} of {self.num_stages}")
        return stage - 1
