"""Convert poses, sensing and actions to the parts of records that describe them."""

from evonav.agents.agent import AgentAction, Move, NavigateTo, Sensing
from evonav.evaluation.records.schema import ActionRecord, PoseRecord, SensingRecord
from evonav.world.pose import Pose


def pose_record(pose: Pose) -> PoseRecord:
    """Return a pose for the record."""
    return PoseRecord(x_m=pose.x_m, y_m=pose.y_m, z_m=pose.z_m, yaw_rad=pose.yaw_rad, horizon_rad=pose.horizon_rad)


def sensing_record(sensing: Sensing) -> SensingRecord:
    """Return the sensing that an agent was granted, for the record."""
    first, later = sensing.first_round, sensing.later_rounds
    return SensingRecord(
        first_round=(first.count, first.spacing_deg),
        later_rounds=(later.count, later.spacing_deg),
        motion=sensing.motion,
        max_travel_m=sensing.max_travel_m,
        occupancy_range_m=sensing.occupancy_range_m,
    )


def action_record(action: AgentAction) -> ActionRecord:
    """Return an agent's answer for the record."""
    if isinstance(action, NavigateTo):
        return ActionRecord(kind="navigate_to", position_m=action.position_m, face_m=action.face_m)
    if isinstance(action, Move):
        return ActionRecord(kind="move", action=action.action.value)
    return ActionRecord(kind="stop", reason=str(action.reason))
