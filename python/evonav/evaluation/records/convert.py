"""Parts of records: poses, actions, and entries as the evaluator judges them."""

import math
from collections.abc import Mapping, Sequence

from evonav.agents.agent import AgentAction, EntryBelief, Move, NavigateTo, Sensing
from evonav.evaluation.records.schema import ActionRecord, EntryRecord, Point3, PoseRecord, SensingRecord
from evonav.world.pose import Pose
from evonav.world.simulator import SceneObject

STALE_MARGIN_M = 0.3
"""An entry whose centre is this near the box of an object of its label is not stale."""


def entry_record(belief: EntryBelief, bodies: Mapping[str, Sequence[SceneObject]]) -> EntryRecord:
    """An entry for the record, judged.

    Args:
        belief: As the agent holds it.
        bodies: Of the stage's house, by category.
    """
    return EntryRecord(
        entry_id=belief.entry_id,
        label=belief.label,
        centre_m=belief.centre_m,
        size_m=belief.size_m,
        num_detections=belief.num_detections,
        is_stale=not any(
            distance_to_box_m(belief.centre_m, body) <= STALE_MARGIN_M for body in bodies.get(belief.label, ())
        ),
    )


def pose_record(pose: Pose) -> PoseRecord:
    """A pose for the record."""
    return PoseRecord(x_m=pose.x_m, y_m=pose.y_m, z_m=pose.z_m, yaw_rad=pose.yaw_rad, horizon_rad=pose.horizon_rad)


def sensing_record(sensing: Sensing) -> SensingRecord:
    """What an agent was granted, for the record."""
    first, later = sensing.first_round, sensing.later_rounds
    return SensingRecord(
        first_round=(first.count, first.spacing_deg),
        later_rounds=(later.count, later.spacing_deg),
        motion=sensing.motion,
        max_travel_m=sensing.max_travel_m,
        occupancy_range_m=sensing.occupancy_range_m,
    )


def action_record(action: AgentAction) -> ActionRecord:
    """What an agent answered, for the record."""
    if isinstance(action, NavigateTo):
        return ActionRecord(kind="navigate_to", position_m=action.position_m, face_m=action.face_m)
    if isinstance(action, Move):
        return ActionRecord(kind="move", action=action.action.value)
    return ActionRecord(kind="stop", reason=str(action.reason))


def distance_to_box_m(point_m: Point3, body: SceneObject) -> float:
    """From a point to the axis-aligned box of a body; 0 inside."""
    gaps_m = (max(0.0, abs(p - c) - s / 2) for p, c, s in zip(point_m, body.centre_m, body.size_m, strict=True))
    return math.hypot(*gaps_m)
