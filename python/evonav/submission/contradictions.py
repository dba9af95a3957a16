"""Find contradictions within a record, and between it and its task, and the record of the stage before.

No simulator is asked: what a wall stops, how long the reference path is, and what a change during the stage left for
the agent show when the actions are executed again.
"""

import math
from collections.abc import Iterator
from itertools import pairwise

from evonav.errors import InvalidArgumentError
from evonav.evaluation.episode.motion import polyline_length_m
from evonav.evaluation.episode.spec import EpisodeSpec, StageSpec
from evonav.evaluation.episode.stage_house import changed_ids
from evonav.evaluation.metrics.scoring import score_stage
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState, RoundRecord, StageRecord
from evonav.points import Point2, Point3
from evonav.world.pose import Pose

TOLERANCE = 1e-9
"""Allowed difference of a claimed score, since other machines may round sums differently."""
SAME_M = 1e-6
"""Distance up to which two poses are at the same place."""
SLACK_M = 0.01
"""Allowed excess of a way: AI2-THOR's steps are not exact."""


def target_findings(record: StageRecord, spec: EpisodeSpec) -> Iterator[str]:
    """Yield where a record describes another stage than the task's."""
    blank, stage = spec.blank_record(record.agent, record.stage), spec.stages[record.stage - 1]
    transition = record.transition.model_copy(update={"is_agent_in_room": blank.transition.is_agent_in_room})
    found = record.model_copy(update={"transition": transition})
    for name in ("house", "num_stages", "goal", "target", "transition"):
        if getattr(found, name) != getattr(blank, name):
            yield f"{name} is another than the task's"
    if (record.state is EndState.GUIDED) != (stage.guided is not None):
        yield f"it is {record.state.value}, the task's stage is {'not ' if stage.guided is None else ''}guided"
    if record.stage == 1 and record.requested_start != spec.start:
        yield "requested_start is another than the task's"


def change_findings(record: StageRecord, stage: StageSpec, protocol: ProtocolConfig) -> Iterator[str]:
    """Yield where a record's change during the stage is not the task's, or cannot have taken place as recorded."""
    found, change = record.during, stage.change
    if found is None or change is None:
        if found is not None or change is not None:
            yield "during is another than the task's"
        return
    planned = change.record
    recorded = found.change.model_copy(update={"is_agent_in_room": planned.change.is_agent_in_room})
    if (found.round, recorded) != (planned.round, planned.change):
        yield "during is another than the task's"
        return
    due = None
    if record.sensing is not None and stage.guided is None:
        due = protocol.step_of_round(planned.round, record.sensing)
    is_due = due is not None and due < len(record.trace)
    if found.at_round != (due if is_due else None):
        yield f"during.at_round is {found.at_round}, the task's round gives {due if is_due else None}"
        return
    if not is_due:
        if found != planned:
            yield "during says more than that the stage ended before the change"
        return
    if not set(found.skipped_ids) <= set(changed_ids(change.delta_json)):
        yield f"during.skipped_ids names what does not change: {found.skipped_ids[:3]}"
    target = record.target
    is_skipped = target.object_id in found.skipped_ids
    if found.target_position_m != (target.position_m if is_skipped else change.target_position_m):
        yield f"during.target_position_m is {found.target_position_m}, which is not the task's"
    if found.is_target_relocated != any(one.object_id == target.object_id for one in found.done):
        yield f"during.is_target_relocated is {found.is_target_relocated}, its moves say otherwise"
    length_m = sum(polyline_length_m(entry.path_m) for entry in record.trace[:due])
    if found.path_before_m is None or not math.isclose(found.path_before_m, length_m, abs_tol=TOLERANCE):
        yield f"during.path_before_m is {found.path_before_m}, its path gives {length_m}"


def path_findings(record: StageRecord, before: StageRecord | None, protocol: ProtocolConfig) -> Iterator[str]:
    """Yield the contradictions of a scored record.

    The formulas are those of the protocol (paper, Sec. C.2), from rounds, target and reference length.

    Args:
        before: The record of the stage before, at whose end this one has to begin; `None` for stage 1.
    """
    if record.state is EndState.GUIDED:
        return  # a guided stage has no score
    start, end, trace = record.effective_start, record.terminal, record.trace
    requested = record.requested_start
    if requested is None or start is None or end is None or record.sensing is None or not trace:
        yield "a scored stage without start, end, sensing or rounds"
        return
    if not all(entry.path_m for entry in trace):
        yield "a round without a path"
        return
    if before is not None and before.terminal is not None and _gap_m(before.terminal, requested) > SAME_M:
        yield "it does not begin where the stage before has ended"
    if record.is_snapped != (_gap_m(start, requested) > SAME_M):
        yield "is_snapped contradicts its start"
    yield from _round_findings(record, protocol)
    if any(
        earlier.path_m[-1] != later.path_m[0] or _place(later.pose) != later.path_m[0]
        for earlier, later in pairwise(trace)
    ):
        yield "the path jumps between rounds"
    if not _place(start) == _place(trace[0].pose) == trace[0].path_m[0] or trace[-1].path_m[-1] != _place(end):
        yield "the path does not lead from start to end"
    yield from _score_findings(record, _place(start), _place(end), protocol)


def _round_findings(record: StageRecord, protocol: ProtocolConfig) -> Iterator[str]:
    """Yield what the protocol does not allow in the rounds."""
    assert record.sensing is not None  # checked by the caller
    trace, sensors = record.trace, record.sensing
    try:
        protocol.check(sensors)
    except InvalidArgumentError as error:
        yield f"more than the protocol grants: {error}"
    if [entry.round for entry in trace] != list(range(len(trace))):
        yield "its rounds are not numbered 0, 1, 2, ..."
    budget = protocol.budget(sensors)
    stops = [number for number, entry in enumerate(trace, start=1) if entry.action.kind == "stop"]
    if len(trace) > budget or stops not in ([], [len(trace)]) or not (stops or len(trace) == budget):
        yield f"{len(trace)} rounds and stops in {stops[:3]}: it ends with the first stop, or after {budget} rounds"
    reach_m = {"navigate_to": protocol.max_travel_m, "move": protocol.waypoint_m}
    for entry in trace:
        hop_m = max((math.dist(a, b) for a, b in pairwise(entry.path_m)), default=0.0)
        if hop_m > protocol.waypoint_m + SLACK_M or _length_m(entry) > reach_m.get(entry.action.kind, 0.0) + SLACK_M:
            yield f"round {entry.round}: the path jumps, or is longer than a round allows"
        if entry.action.kind == "navigate_to" and record.sensing.motion == "actions":
            yield f"round {entry.round}: an agent of single actions walks"


def _score_findings(record: StageRecord, start_m: Point2, end_m: Point2, protocol: ProtocolConfig) -> Iterator[str]:
    trace, reference_m = record.trace, record.reference_length_m
    if (
        reference_m is None
        or reference_m < 0.0
        or not 0.0 <= (record.reference_ring_m or 0.0) <= reference_m + TOLERANCE
    ):
        yield "a scored stage without the length of a reference path, or with an impossible one"
        return
    length_m = sum(map(_length_m, trace))
    score = score_stage(
        start_m,
        end_m,
        _on_ground(record.target_m_at_end),
        path_length_m=length_m,
        reference_length_m=reference_m,
        success_radius_m=protocol.success_radius_m,
        target_at_start_m=_on_ground(record.target.position_m),
    )
    last = trace[-1].action
    made: dict[str, object] = {
        "error": None,
        "num_rounds": len(trace),
        "num_target_visible_rounds": sum(entry.is_target_visible for entry in trace),
        "has_stopped": last.kind == "stop",
        "stop_reason": last.reason if last.kind == "stop" else "",
        "state": EndState.SUCCESS if score.is_success else EndState.FAILURE,
        "path_length_m": length_m,
        "start_distance_m": score.start_distance_m,
        "terminal_distance_m": score.terminal_distance_m,
        "spl": score.spl,
        "soft_spl": score.soft_spl,
    }
    if record.terminal_geodesic_m is not None:
        made["is_geodesic_success"] = record.terminal_geodesic_m < protocol.success_radius_m
    for field, value in made.items():
        claimed = getattr(record, field)
        is_close = isinstance(value, float) and claimed is not None and math.isclose(claimed, value, abs_tol=TOLERANCE)
        if not is_close and claimed != value:
            yield f"{field} is {_plain(claimed)}, its path gives {_plain(value)}"


def _plain(value: object) -> object:
    return value.value if isinstance(value, EndState) else value


def _length_m(entry: RoundRecord) -> float:
    return polyline_length_m(entry.path_m)


def _gap_m(pose: Pose, other: Pose) -> float:
    return math.dist(_place(pose), _place(other))


def _on_ground(point_m: Point3) -> Point2:
    return (point_m[0], point_m[2])


def _place(pose: Pose) -> Point2:
    return (pose.x_m, pose.z_m)
