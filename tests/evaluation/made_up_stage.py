"""Records made up by hand for tests of measures. Never results."""

from evonav.agents.agent import NavigateTo
from evonav.evaluation.records.schema import (
    EndState,
    EntryRecord,
    ErrorKind,
    GoalRecord,
    RoundRecord,
    StageError,
    StageRecord,
    TargetRecord,
    TransitionRecord,
)
from evonav.world.pose import Pose

TARGET_M = (5.0, 0.8, 1.0)


def pose(x_m, z_m=1.0):
    return Pose(x_m, 0.9, z_m, 0.0, 0.0)


def entry(label="Mug", centre_m=TARGET_M, entry_id=7, *, is_stale=False):
    return EntryRecord(
        entry_id=entry_id, label=label, centre_m=centre_m, size_m=(0.1, 0.1, 0.1), num_detections=2, is_stale=is_stale
    )


def taken(number, chosen=None, *, step_m=0.5, is_target_visible=False, counters=None, is_action_success=True):
    """A round that walks `step_m` along x."""
    x_m = number * 0.5
    return RoundRecord(
        round=number,
        pose=pose(x_m),
        action=NavigateTo((9.0, 1.0)),
        path_m=((x_m, 1.0), (x_m + step_m, 1.0)),
        is_action_success=is_action_success,
        is_target_visible=is_target_visible,
        choice="frontier 1" if chosen is None else f"object {chosen.entry_id}",
        chosen_entry=chosen,
        num_entries=1,
        num_frontiers=1,
        counters=counters or {},
        details={},
    )


def made_up_record(state=EndState.FAILURE, *, stage=1, error=None, trace=(), **fields):
    """A stage at a mug; fields of the record by name."""
    is_scored = state in (EndState.SUCCESS, EndState.FAILURE)
    known = {
        "agent": "fu",
        "task_id": "t",
        "house": "h",
        "stage": stage,
        "num_stages": 3,
        "state": state,
        "error": None if error is None else StageError(kind=ErrorKind(error), message="it broke"),
        "goal": GoalRecord(category="Mug", instruction="the mug", basic_instruction="the mug"),
        "target": TargetRecord(
            object_id="Mug|1",
            category="Mug",
            position_m=TARGET_M,
            room_id="room|1",
            is_relocated=False,
            is_relocated_now=False,
        ),
        "transition": TransitionRecord(),
        "trace": trace,
        "num_rounds": len(trace),
        "num_target_visible_rounds": sum(one.is_target_visible for one in trace),
    }
    if is_scored:
        known |= {
            "start_distance_m": 6.0,
            "terminal_distance_m": 1.2 if state is EndState.SUCCESS else 3.0,
            "path_length_m": 5.0,
            "reference_length_m": 4.0,
            "spl": 0.8 if state is EndState.SUCCESS else 0.0,
            "soft_spl": 0.4,
        }
    return StageRecord(**{**known, **fields})
