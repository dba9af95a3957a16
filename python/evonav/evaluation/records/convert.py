"""Convert poses, sensors and actions to the parts of records that describe them."""

from evonav.agents.agent import AgentAction, Move, NavigateTo, PlaceBelief, SensorConfig, ViewSchedule
from evonav.evaluation.records.base import BeliefRecord, PlacesRecord
from evonav.evaluation.records.schema import ActionRecord, PoseRecord, SensingRecord
from evonav.world.pose import Pose


def pose_record(pose: Pose) -> PoseRecord:
    """Return a pose for the record."""
    return PoseRecord(x_m=pose.x_m, y_m=pose.y_m, z_m=pose.z_m, yaw_rad=pose.yaw_rad, horizon_rad=pose.horizon_rad)


def sensing_record(sensors: SensorConfig) -> SensingRecord:
    """Return the sensors that an agent was granted, for the record."""
    first, later = sensors.first_round, sensors.later_rounds
    return SensingRecord(
        first_round=(first.count, first.spacing_deg),
        later_rounds=(later.count, later.spacing_deg),
        motion=sensors.motion,
        max_travel_m=sensors.max_travel_m,
        occupancy_range_m=sensors.occupancy_range_m,
    )


def sensor_config(record: SensingRecord) -> SensorConfig:
    """Return the sensors that a record describes."""
    return SensorConfig(
        first_round=ViewSchedule(*record.first_round),
        later_rounds=ViewSchedule(*record.later_rounds),
        motion=record.motion,
        max_travel_m=record.max_travel_m,
        occupancy_range_m=record.occupancy_range_m,
    )


def action_record(action: AgentAction) -> ActionRecord:
    """Return an agent's answer for the record."""
    if isinstance(action, NavigateTo):
        return ActionRecord(kind="navigate_to", position_m=action.position_m, face_m=action.face_m)
    if isinstance(action, Move):
        return ActionRecord(kind="move", action=action.action.value)
    return ActionRecord(kind="stop", reason=str(action.reason))


def with_places(belief: BeliefRecord | None, places: PlaceBelief | None) -> BeliefRecord | None:
    """Return an agent's belief, for the record, with where it believes the target to be."""
    if places is None:
        return belief
    record = PlacesRecord(cell_m=places.cell_m, centres_m=places.centres_m, probabilities=places.probabilities)
    return (belief or BeliefRecord()).model_copy(update={"places": record})
