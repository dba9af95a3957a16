"""Describe a task as the evaluator runs it: its stages, targets and hidden changes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from evonav.evaluation.records.floor_plan import house_map, image_uri, target_record, transition_record
from evonav.evaluation.records.schema import (
    EndState,
    FloorPlan,
    GoalRecord,
    ObjectFootprint,
    Point2,
    StageRecord,
    TargetRecord,
    TransitionRecord,
)
from evonav.house import House
from evonav.tasks import Task
from evonav.tasks.oracle import OracleStage
from evonav.tasks.public import StageInput
from evonav.world.pose import Pose
from evonav.world.simulator import SceneObject

THUMBNAIL_PX = 160


@dataclass(frozen=True, slots=True)
class GuidedWalk:
    """A reference trajectory along which the evaluator moves the agent."""

    path_m: tuple[Point2, ...]
    """Corners, the start first."""
    end: Pose
    """The last pose. Its horizon is not used: an agent's camera keeps the horizon of its house."""


@dataclass(frozen=True, slots=True)
class StageSpec:
    """A stage as the evaluator knows it; only `public` ever reaches an agent."""

    public: StageInput
    house_json: str
    target: TargetRecord
    transition: TransitionRecord
    guided: GuidedWalk | None = None
    """The walk of a guided stage, which the agent does not control and which is not scored; `None` otherwise."""

    @property
    def goal(self) -> GoalRecord:
        """The goal as the agent receives it, for the record."""
        return GoalRecord(
            category=self.public.category,
            instruction=self.public.unified_instruction,
            basic_instruction=self.public.basic_instruction,
        )


@dataclass(frozen=True, slots=True)
class EpisodeSpec:
    """A task as the evaluator knows it."""

    task_id: str
    house: str
    start: Pose
    """The start pose of stage 1, from the manifest."""
    stages: tuple[StageSpec, ...] = field(repr=False)

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
        )


def episode_spec(task: Task) -> EpisodeSpec:
    """Describe a task for the evaluator.

    Raises:
        TaskError: A stage house is malformed.
    """
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
                transition=transition_record(task.oracle(k)),
                guided=_guided_walk(task.oracle(k)) if k in task.guided_stages else None,
            )
            for k in numbers
        ),
    )


def unreadable_task_spec(task_id: str, num_stages: int) -> EpisodeSpec:
    """Stand in for a task that cannot be read, so that its stages have records; all its values are empty."""
    no_image = np.zeros((0, 0, 3), dtype=np.uint8)
    stages = tuple(
        StageSpec(
            public=StageInput(stage, "", "", "", "", no_image),
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


def _guided_walk(oracle: OracleStage) -> GuidedWalk:
    return GuidedWalk(path_m=oracle.reference_path_m, end=oracle.reference_pose.pose())


def floor_plan(case: EpisodeSpec, stage: int, objects: Sequence[SceneObject]) -> FloorPlan:
    """A stage's house from above.

    Args:
        case: The task.
        stage: 1-based.
        objects: The simulator's bodies, for sizes.

    Raises:
        HouseError: The house is malformed.
    """
    house = House(case.stages[stage - 1].house_json, name=case.house)
    yaws_rad = {entry.id: math.radians(entry.rotation_deg[1]) for entry in house.objects}
    return house_map(
        house,
        task_id=case.task_id,
        stage=stage,
        objects=_footprints(yaws_rad, objects),
        reference_image=image_uri(case.stages[stage - 1].public.reference_image, THUMBNAIL_PX),
    )


def room_at(plan: FloorPlan, point_m: Point2) -> str | None:
    """The id of the room over a point (even-odd rule), or `None` outside all of them."""
    return next((room.room_id for room in plan.rooms if _is_inside(room.polygon_m, point_m)), None)


def _is_inside(polygon_m: Sequence[Point2], point_m: Point2) -> bool:
    x, z = point_m
    is_inside = False
    for (x0, z0), (x1, z1) in zip(polygon_m, (*polygon_m[1:], polygon_m[0]), strict=True):
        if (z0 > z) != (z1 > z) and x < x0 + (z - z0) / (z1 - z0) * (x1 - x0):
            is_inside = not is_inside
    return is_inside


def _footprints(yaws_rad: Mapping[str, float], objects: Sequence[SceneObject]) -> tuple[ObjectFootprint, ...]:
    footprints = []
    for body in objects:
        if body.kind != "object":
            continue
        x, _, z = body.centre_m
        corners = _turned_corners(body.size_m[0], body.size_m[2], yaws_rad.get(body.id, 0.0))
        footprints.append(
            ObjectFootprint(
                object_id=body.id,
                category=body.category,
                centre_m=body.centre_m,
                size_m=body.size_m,
                polygon_m=tuple((x + dx, z + dz) for dx, dz in corners),
            )
        )
    return tuple(footprints)


def _turned_corners(box_x_m: float, box_z_m: float, yaw_rad: float) -> list[Point2]:
    """Corners of the rectangle at `yaw_rad` whose axis-aligned box is `box_x_m` by `box_z_m`, about its centre.

    Near 45 degrees many rectangles share a box; there the box itself is drawn.
    """
    c, s = abs(math.cos(yaw_rad)), abs(math.sin(yaw_rad))
    determinant = c * c - s * s
    if abs(determinant) > 0.1:
        width_m = (c * box_x_m - s * box_z_m) / determinant
        depth_m = (c * box_z_m - s * box_x_m) / determinant
        if width_m > 0.0 and depth_m > 0.0:
            sin, cos = math.sin(yaw_rad), math.cos(yaw_rad)
            corners = [(-width_m, -depth_m), (width_m, -depth_m), (width_m, depth_m), (-width_m, depth_m)]
            # Yaw is clockwise seen from above: +z turns towards +x.
            return [((x * cos + z * sin) / 2, (-x * sin + z * cos) / 2) for x, z in corners]
    half_x_m, half_z_m = box_x_m / 2, box_z_m / 2
    return [(-half_x_m, -half_z_m), (half_x_m, -half_z_m), (half_x_m, half_z_m), (-half_x_m, half_z_m)]
