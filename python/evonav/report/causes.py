"""Why a stage failed: one cause a stage, the first that fits, judged from its record."""

import math
from enum import Enum

from evonav.evaluation.records import EndState, EntryRecord, StageRecord
from evonav.tasks.language import noun_of

NEAR_TARGET_M = 1.0
"""Ground-plane distance within which an entry of the goal's category is taken for the target's."""


class Cause(str, Enum):
    """What to fix. Values are the words a report uses."""

    STALE_ENTRY = "stopped at a stale entry"
    STOPPED_SHORT = "stopped short of the target"
    WRONG_INSTANCE = "stopped at another instance"
    WRONG_CATEGORY = "stopped at another kind of object"
    NO_OBJECT = "stopped without an object"
    NEVER_IN_VIEW = "target never in view"
    NOT_REMEMBERED = "target in view, not recognised"
    NOT_REACHED = "target known, not reached in time"
    ERRORED = "errored"
    NOT_RUN = "not run"


def cause_of(record: StageRecord) -> Cause | None:
    """The cause of a stage that did not succeed; `None` for a success."""
    if record.state is EndState.SUCCESS:
        return None
    if record.state is EndState.ERRORED:
        return Cause.ERRORED
    if record.state is EndState.NOT_RUN:
        return Cause.NOT_RUN
    if record.has_stopped:
        return _cause_of_stop(record)
    if record.num_target_visible_rounds == 0:
        return Cause.NEVER_IN_VIEW
    return Cause.NOT_REACHED if any(_is_target(record, entry) for entry in record.entries) else Cause.NOT_REMEMBERED


def sentence(record: StageRecord) -> str:
    """How a stage ended, in one sentence."""
    if record.error is not None:
        return (
            f"{record.state.value.replace('_', ' ').capitalize()} ({record.error.kind.value}): {record.error.message}"
        )
    cause = cause_of(record)
    if record.state is EndState.NOT_RUN:
        return "Not run."
    distance = "" if record.terminal_distance_m is None else f", {record.terminal_distance_m:.1f} m away"
    if cause is None:
        how = "Stopped at it" if record.has_stopped else "There when the rounds ran out"
        return f"{how}{distance}."
    entry = record.trace[-1].chosen_entry if record.trace else None
    named = ""
    if record.has_stopped:
        named = f" ({record.stop_reason})" if entry is None and record.stop_reason else ""
        named = f" ({noun_of(entry.label)})" if entry is not None else named
    return f"{cause.value.capitalize()}{named}{distance}."


def _cause_of_stop(record: StageRecord) -> Cause:
    entry = record.trace[-1].chosen_entry if record.trace else None
    if entry is None:
        return Cause.NO_OBJECT
    if entry.is_stale:
        return Cause.STALE_ENTRY
    if entry.label != record.target.category:
        return Cause.WRONG_CATEGORY
    return Cause.STOPPED_SHORT if _is_target(record, entry) else Cause.WRONG_INSTANCE


def _is_target(record: StageRecord, entry: EntryRecord) -> bool:
    x_m, _, z_m = record.target.position_m
    distance_m = math.dist((entry.centre_m[0], entry.centre_m[2]), (x_m, z_m))
    return not entry.is_stale and entry.label == record.target.category and distance_m <= NEAR_TARGET_M
