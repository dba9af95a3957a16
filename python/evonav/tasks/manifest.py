"""A task: header, public stages, oracle stages, stage houses. `evonav.tasks.files` reads and writes them."""

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
    """The fixed hyperparameters Θ (paper, Sec. A.2), and what the paper leaves open."""

    num_stages: Annotated[tuple[PositiveInt, ...], Field(min_length=1)] = (3, 4, 5)
    """K is drawn uniformly from these (the paper gives the range only)."""
    evolve_probability: Probability = 0.5
    visited_factor: NonNegativeFloat = 3.0
    recently_changed_factor: NonNegativeFloat = 0.5
    changed_room_window: PositiveInt = 1
    """Transitions back in which a change counts as recent (the paper's k-2, counted by first stage)."""
    salient_object_probability: Probability = 0.5
    retain_group_probability: Probability = 0.4
    full_shuffle_probability: Probability = 0.1
    changed_room_multiplier: NonNegativeFloat = 9.0
    previous_goal_room_multiplier: NonNegativeFloat = 0.2
    moved_object_multiplier: NonNegativeFloat = 9.0
    moved_children_multiplier: NonNegativeFloat = 9.0
    """Of what stood on the salient object and moved with it. The paper gives 9 to "the moved object": with 1 here, too
    few goals have been relocated (docs/dataset.md)."""
    goals_on_walls: bool = False
    """Whether what hangs on walls, which no modification moves, may be a goal. The paper uses it as an anchor of
    instructions; leaving it out of the goals brings the share of relocated goals (Sec. 3.2) to the published one."""
    reference_min_m: PositiveFloat = 1.0
    reference_max_m: PositiveFloat = 1.5
    reference_image_px: Annotated[int, Field(ge=16, le=4096)] = 300
    reference_min_visible_px: PositiveInt = 50
    """Fewest pixels of a visible target (the paper says "visible")."""
    relocated_min_m: NonNegativeFloat = 0.1
    placement_tries: PositiveInt = 100
    """Places tried for an object before it stays where it is."""
    modification_tries: Annotated[int, Field(ge=1, le=1000)] = 3
    """Times that a room's modification is tried, with fresh places, before it is given up."""
    extensions: Extensions = Extensions()


class HouseSource(Record):
    """Where a task's first house comes from."""

    name: Annotated[str, Field(max_length=512)]
    """File without folders (or set and split), line, and place in a list of houses."""
    index: NonNegativeInt | None
    """Of the line in its file, or of the house in its list, from 0; unknown for houses from elsewhere."""
    sha256: Sha256
    """Of the house JSON as evonav writes it."""
    num_rooms: PositiveInt
    num_objects: PositiveInt


class Control(Record):
    """How a task is one of several that differ in one thing alone (paper, Sec. 4.3; docs/controlled.md)."""

    arm: Id
    """Which of them: `fixed` or `evolved`, or a probability of evolution such as `p0.25`."""
    attempt: NonNegativeInt
    """Draws of goals and changes that were dropped before, because a goal could not be one in every arm."""
    forced_stages: tuple[PositiveInt, ...]
    """Stages in which the evaluator walks the reference trajectory and the agent looks on. They are not scored."""
    shown_goals: tuple[PositiveInt, ...]
    """For each stage, the stage whose words and image the agent is given: its own, or the earlier one with the same
    target, so that it is told the same whatever has changed since."""


class TaskHeader(Record):
    """`task.json` (paper, Sec. A.3)."""

    schema_version: Literal[2] = 2
    task_id: TaskId
    dataset: Id
    split: Id
    generator: Id
    """Program and version."""
    seed: Annotated[int, Field(ge=0, lt=2**64)]
    num_stages: Annotated[int, Field(ge=1, le=64)]
    house: HouseSource
    start_pose: PoseRecord
    parameters: GenerationParameters
    checksums: dict[str, Sha256]
    """Per file of the task, of its contents: JSON as it is, `.gz` uncompressed, `.png` its RGB values row by row."""
    control: Control | None = None
    """Left out of the files of tasks that belong to no controlled analysis."""

    @model_serializer(mode="wrap")
    def _without_control(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        fields: dict[str, Any] = serialize(self)
        return {key: value for key, value in fields.items() if key != "control" or value is not None}


class PublicStage(Record):
    """`public/stage_k.json`: the goal g_k, less its start pose (which would tell where the last target was)."""

    schema_version: Literal[2] = 2
    stage: Annotated[int, Field(ge=1)]
    category: Id
    basic_instruction: Annotated[str, Field(min_length=1, max_length=2000)]
    appearance_instruction: Annotated[str, Field(min_length=1, max_length=2000)]
    unified_instruction: Annotated[str, Field(min_length=1, max_length=2000)]
    writer: Id
    """Who wrote the appearance and unified instructions: `evonav-describer 1`, or `vlm:` and a model's name."""


@dataclass(frozen=True)
class Task:
    """A task in memory. Stages count from 1."""

    header: TaskHeader
    public_stages: tuple[PublicStage, ...]
    reference_images: tuple[NDArray[np.uint8], ...]
    """`(S, S, 3)` RGB each, read-only."""
    oracle_stages: tuple[OracleStage, ...]
    houses_json: tuple[str, ...]
    """The whole house of each stage, ProcTHOR JSON."""

    @property
    def task_id(self) -> str:
        """Names the task within its data set."""
        return self.header.task_id

    @property
    def num_stages(self) -> int:
        """K."""
        return self.header.num_stages

    @property
    def forced_stages(self) -> tuple[int, ...]:
        """Stages in which the evaluator walks and the agent looks on."""
        return () if self.header.control is None else self.header.control.forced_stages

    @property
    def start_pose(self) -> Pose:
        """Where the agent starts stage 1."""
        return self.header.start_pose.pose()

    def public(self, stage: int) -> StageInput:
        """What the agent is given at a stage.

        Raises:
            IndexError: There is no such stage.
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
        """What only the evaluator knows of a stage.

        Raises:
            IndexError: There is no such stage.
        """
        return self.oracle_stages[self._index(stage)]

    def house_json(self, stage: int) -> str:
        """The house of a stage, ProcTHOR JSON.

        Raises:
            IndexError: There is no such stage.
        """
        return self.houses_json[self._index(stage)]

    def _index(self, stage: int) -> int:
        if not 1 <= stage <= self.num_stages:
            raise IndexError(f"task {self.task_id}: stage {stage} of {self.num_stages}")
        return stage - 1
