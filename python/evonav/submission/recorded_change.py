"""Find contradictions between a record's change during the stage and the task's, or its rounds (docs/extensions.md).

The path to the target after the change, and what stayed for the agent, show when the actions are executed again.
"""

import math
from collections.abc import Iterator

from evonav.evaluation.episode.motion import polyline_length_m
from evonav.evaluation.episode.spec import StageSpec
from evonav.evaluation.episode.stage_house import changed_ids
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.convert import sensor_config
from evonav.evaluation.records.schema import StageRecord

TOLERANCE = 1e-9
"""Allowed difference of a length, since other machines may round sums differently."""


def change_findings(record: StageRecord, stage: StageSpec, protocol: ProtocolConfig) -> Iterator[str]:
    """Yield where a record's change during the stage is not the task's, or cannot have taken place as recorded.

    Args:
        stage: The task's stage.
        protocol: The run's protocol.
    """
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
        due = protocol.step_of_round(planned.round, sensor_config(record.sensing))
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
