"""Describe a task as the evaluator runs it: its stages, targets and hidden changes."""

import hashlib
import hmac
import json
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from evonav.evaluation.records.floor_plans import FloorPlan, floor_plan_of, image_uri
from evonav.evaluation.records.oracle import during_record, target_record, transition_record
from evonav.evaluation.records.schema import (
    ChangeDuringStage,
    EndState,
    GoalRecord,
    StageRecord,
    TargetRecord,
    TransitionRecord,
)
from evonav.house import House
from evonav.points import Point2, Point3
from evonav.tasks import Task
from evonav.tasks.oracle import OracleStage
from evonav.tasks.public import Goal
from evonav.world.pose import Pose

THUMBNAIL_PX = 160
"""Edge of the reference image in a floor plan."""


@dataclass(frozen=True, slots=True)
class GuidedWalk:
    """A reference trajectory along which the evaluator moves the agent."""

    path_m: tuple[Point2, ...]
    """Corners, the start first."""
    end: Pose
    """The last pose. Its horizon is not used: an agent's camera keeps the horizon of its house."""


@dataclass(frozen=True, slots=True)
class HouseChange:
    """A change of the house during a stage, as the evaluator knows it."""

    record: ChangeDuringStage
    """The change as a record has it before it takes place."""
    delta_json: str
    """The change as `House.apply` takes it."""
    target_position_m: Point3
    """Position of the target after it."""


@dataclass(frozen=True, slots=True)
class StageSpec:
    """A stage as the evaluator knows it; only `public` ever reaches an agent."""

    public: Goal
    house_json: str
    target: TargetRecord
    transition: TransitionRecord
    guided: GuidedWalk | None = None
    """The walk of a guided stage, which the agent does not control and which is not scored; `None` otherwise."""
    change: HouseChange | None = None
    """The change during the stage, if there is one."""

    @property
    def goal(self) -> GoalRecord:
        """The goal as the agent receives it, for the record."""
        return GoalRecord(
            category=self.public.category,
            instruction=self.public.unified_instruction,
            basic_instruction=self.public.basic_instruction,
        )


@dataclass(frozen=True)  # without slots: workers refer to it weakly
class EpisodeSpec:
    """A task as the evaluator knows it."""

    task_id: str
    house: str
    start: Pose
    """The start pose of stage 1, from the manifest."""
    stages: tuple[StageSpec, ...] = field(repr=False)
    opaque_id: str = "task"
    """The name that agents are given instead of `task_id`: see `opaque_task_id`."""

    def parsed_house(self, stage: int) -> House:
        """Parse the house as it is in a stage (1-based); `HouseError` if it is malformed."""
        return _parsed(self.stages[stage - 1].house_json, self.house)

    def floor_plan(self, stage: int) -> FloorPlan:
        """Return the floor plan of a stage (1-based); `HouseError` for a malformed house or unknown category."""
        spec = self.stages[stage - 1]
        drawn = _drawn(spec.house_json, self.house, None if spec.change is None else spec.change.delta_json)
        image = image_uri(spec.public.reference_image, THUMBNAIL_PX)
        return drawn.model_copy(update={"task_id": self.task_id, "stage": stage, "reference_image": image})

    def blank_record(self, agent: str, stage: int) -> StageRecord:
        """Return the record of a stage that was not run; all other records of the stage start from it.

        Args:
            agent: The name by which the agent was requested.
            stage: 1-based.
        """
        spec = self.stages[stage - 1]
        return StageRecord(
            agent=agent,
            task_id=self.task_id,
            house=self.house,
            stage=stage,
            num_stages=len(self.stages),
            state=EndState.NOT_RUN,
            goal=spec.goal,
            target=spec.target,
            transition=spec.transition,
            during=None if spec.change is None else spec.change.record,
        )


def episode_spec(task: Task) -> EpisodeSpec:
    """Describe a task for the evaluator; `TaskError` if a stage house is malformed."""
    numbers = range(1, task.num_stages + 1)
    return EpisodeSpec(
        task_id=task.task_id,
        house=task.header.house.name,
        start=task.start_pose,
        stages=tuple(
            StageSpec(
                public=task.public(k),
                house_json=task.house_json(k),
                target=target_record(task, k),
                transition=transition_record(task.oracle(k).evolution),
                guided=_guided_walk(task.oracle(k)) if k in task.guided_stages else None,
                change=_house_change(task.oracle(k)),
            )
            for k in numbers
        ),
    )


def unreadable_task_spec(task_id: str, num_stages: int) -> EpisodeSpec:
    """Stand in for a task that cannot be read, so that its stages have records; all its values are empty."""
    no_image = np.zeros((0, 0, 3), dtype=np.uint8)
    stages = tuple(
        StageSpec(
            public=Goal(stage, "", "", "", "", no_image),
            house_json="",
            target=TargetRecord(
                object_id="",
                category="",
                position_m=(0.0, 0.0, 0.0),
                room_id="",
                is_relocated=False,
                is_relocated_now=False,
            ),
            transition=TransitionRecord(),
        )
        for stage in range(1, num_stages + 1)
    )
    return EpisodeSpec(task_id, "", Pose(0.0, 0.0, 0.0, 0.0), stages)


@lru_cache(maxsize=4)
def _parsed(house_json: str, name: str) -> House:
    """Parse a house once for a stage and its floor plan."""
    return House(house_json, name=name)


@lru_cache(maxsize=1)
def _drawn(house_json: str, name: str, delta_json: str | None) -> FloorPlan:
    """Draw the floor plan of a house, of no stage yet; every other stage has the house of the stage before."""
    house = _parsed(house_json, name)
    at_end = None if delta_json is None else house.apply(delta_json)
    return floor_plan_of(house, task_id="", stage=0, reference_image=None, at_end=at_end)


def _guided_walk(oracle: OracleStage) -> GuidedWalk:
    return GuidedWalk(path_m=oracle.reference_path_m, end=oracle.reference_pose.pose())


def _house_change(oracle: OracleStage) -> HouseChange | None:
    record, during = during_record(oracle), oracle.during
    if record is None or during is None:
        return None
    return HouseChange(record, json.dumps(during.evolution.delta()), during.target_position_m)


def opaque_task_id(secret: str, task_id: str) -> str:
    """Return a task's name for agents, from which only who knows the run's secret can tell the task.

    It is the same for all agents of a run, and in a run that is resumed or replayed. Nothing in a record depends on
    it, unless an agent makes it so.

    Args:
        secret: The run's own, from its header.
        task_id: The task's id, which names the house and the generator's seed.
    """
    return hmac.new(secret.encode(), task_id.encode(), hashlib.sha256).hexdigest()[:16]
