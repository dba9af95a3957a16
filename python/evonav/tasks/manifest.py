"""Define a task: header, public stages, oracle stages, stage houses. `evonav.tasks.files` reads and writes it."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    Field,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    SerializerFunctionWrapHandler,
    model_serializer,
)

from evonav.tasks.extensions import Extensions
from evonav.tasks.oracle import OracleStage
from evonav.tasks.public import StageInput
from evonav.tasks.records import Id, PoseRecord, Probability, Record, Sha256
from evonav.world.pose import Pose

TaskId = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,127}$")]


class GenerationParameters(Record):
    """The fixed hyperparameters Θ (paper, Sec. A.2), and those that the paper leaves open."""

    num_stages: Annotated[tuple[PositiveInt, ...], Field(min_length=1)] = (3, 4, 5)
    """Possible numbers of stages K, drawn uniformly (the paper gives the range only)."""
    evolve_probability: Probability = 0.5
    visited_factor: NonNegativeFloat = 3.0
    recently_changed_factor: NonNegativeFloat = 0.5
    changed_room_window: PositiveInt = 1
    """Number of transitions back in which a change counts as recent (the paper's k-2, counted by first stage)."""
    salient_object_probability: Probability = 0.5
    retain_group_probability: Probability = 0.4
    full_shuffle_probability: Probability = 0.1
    changed_room_multiplier: NonNegativeFloat = 9.0
    previous_goal_room_multiplier: NonNegativeFloat = 0.2
    moved_object_multiplier: NonNegativeFloat = 9.0
    moved_children_multiplier: NonNegativeFloat = 9.0
    """Multiplier for objects that stood on the salient object and moved with it.

    The paper gives 9 to "the moved object". With 1 here, too few goals are relocated (docs/dataset.md).
    """
    goals_on_walls: bool = False
    """Whether objects on walls, which no modification moves, may be goals.

    The paper uses them as anchors of instructions. Without them as goals, the share of relocated goals (Sec. 3.2) is
    the published one.
    """
    reference_min_m: PositiveFloat = 1.0
    reference_max_m: PositiveFloat = 1.5
    reference_image_px: Annotated[int, Field(ge=16, le=4096)] = 300
    reference_min_visible_px: PositiveInt = 50
    """Smallest number of pixels of a visible target (the paper says "visible")."""
    relocated_min_m: NonNegativeFloat = 0.1
    placement_tries: PositiveInt = 100
    """Number of places tried for an object before it stays where it is."""
    modification_tries: Annotated[int, Field(ge=1, le=1000)] = 3
    """Number of attempts at a room's modification, with new places, before it is abandoned."""
    extensions: Extensions = Extensions()


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
    forced_stages: tuple[PositiveInt, ...]
    """Stages in which the evaluator moves the agent along the reference trajectory. They are not scored."""
    shown_goals: tuple[PositiveInt, ...]
    """The stage whose instructions and image the agent receives, for each stage.

    It is the stage itself or the earlier one with the same target, so that the input is the same whatever has changed.
    """


class TaskHeader(Record):
    """The content of `task.json` (paper, Sec. A.3)."""

    schema_version: Literal[2] = 2
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
    """The task's place in a controlled analysis; absent from the files of other tasks."""

    @model_serializer(mode="wrap")
    def _without_control(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        fields: dict[str, Any] = serialize(self)
        return {key: value for key, value in fields.items() if key != "control" or value is not None}


class PublicStage(Record):
    """The content of `public/stage_k.json`: the goal g_k without its start pose, which reveals the previous target."""

    schema_version: Literal[2] = 2
    stage: Annotated[int, Field(ge=1)]
    category: Id
    basic_instruction: Annotated[str, Field(min_length=1, max_length=2000)]
    appearance_instruction: Annotated[str, Field(min_length=1, max_length=2000)]
    unified_instruction: Annotated[str, Field(min_length=1, max_length=2000)]
    writer: Id
    """Author of the appearance and unified instructions: `evonav-describer 1`, or `vlm:` and a model's name."""


@dataclass(frozen=True)
class Task:
    """A task in memory; its stages count from 1."""

    header: TaskHeader
    public_stages: tuple[PublicStage, ...]
    reference_images: tuple[NDArray[np.uint8], ...]
    """The stages' RGB images, `(S, S, 3)`, read-only."""
    oracle_stages: tuple[OracleStage, ...]
    houses_json: tuple[str, ...]
    """The complete house of each stage, as ProcTHOR JSON."""

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
        return () if self.header.control is None else self.header.control.forced_stages

    @property
    def start_pose(self) -> Pose:
        """The agent's start pose in stage 1."""
        return self.header.start_pose.pose()

    def public(self, stage: int) -> StageInput:
        """Return the agent's input of a stage.

        Raises:
            IndexError: The stage does not exist.
        """
        public = self.public_stages[self._index(stage)]
        return StageInput(
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

    def _index(self, stage: int) -> int:
        if not 1 <= stage <= self.num_stages:
            raise IndexError(f"task {self.task_id}: stage {stage} of {self.num_stages}")
        return stage - 1
