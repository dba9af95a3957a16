"""Find the cause of a failed stage: the first cause that fits, judged from its record alone.

Definitions, in the order in which they are tried, are in docs/metrics.md.
"""

import math
from enum import Enum

from evonav.evaluation.records.schema import EndState, EntryRecord, ErrorKind, StageRecord

NEAR_TARGET_M = 1.0
"""Ground-plane distance within which an entry of the goal's category is taken for the target's."""


class FailureCause(str, Enum):
    """The cause of a failed stage. The first nine are failures, the others stages without a score."""

    STALE_ENTRY = "stale_entry"
    """It stopped at an entry with no object of its label there."""
    WRONG_CATEGORY = "wrong_category"
    """It stopped at an entry of another category than the target's."""
    STOPPED_SHORT = "stopped_short"
    """It stopped at the target's entry, outside of the success radius."""
    WRONG_INSTANCE = "wrong_instance"
    """It stopped at another object of the target's category."""
    NO_OBJECT = "no_object"
    """It stopped with no entry chosen: it gave up, or has no entries."""
    NEVER_IN_VIEW = "never_in_view"
    """The budget ended, and the target was in no view."""
    NOT_REMEMBERED = "not_remembered"
    """The budget ended; the target was in view, and no entry at the end is the target's."""
    NOT_APPROACHED = "not_approached"
    """The budget ended; an entry is the target's, and the agent never chose it."""
    NOT_REACHED = "not_reached"
    """The budget ended; an entry is the target's, and the agent had chosen it."""
    NO_PATH = "no_path"
    """Errored: there is no path from the effective start to the target, so SPL is undefined."""
    DECISION_FAILURE = "decision_failure"
    """Errored: the decision model gave no valid answer."""
    AGENT_ERROR = "agent_error"
    """Errored: the agent raised, died or hung."""
    HARNESS_ERROR = "harness_error"
    """Errored: the simulator, the task or evonav itself failed."""
    NOT_RUN = "not_run"
    """An earlier stage of the episode is errored, or the run has not come to it."""


_OF_ERRORS = {
    ErrorKind.REFERENCE: FailureCause.NO_PATH,
    ErrorKind.DECISION: FailureCause.DECISION_FAILURE,
    ErrorKind.AGENT: FailureCause.AGENT_ERROR,
    ErrorKind.CRASH: FailureCause.AGENT_ERROR,
    ErrorKind.TIMEOUT: FailureCause.AGENT_ERROR,
    ErrorKind.SIMULATION: FailureCause.HARNESS_ERROR,
    ErrorKind.SIMULATOR_LOST: FailureCause.HARNESS_ERROR,
    ErrorKind.HARNESS: FailureCause.HARNESS_ERROR,
}


def cause_of(record: StageRecord) -> FailureCause | None:
    """Return the cause of a stage that did not succeed; `None` for a success and for a guided stage.

    Args:
        record: The whole record, with trace and entries.
    """
    if record.state in (EndState.SUCCESS, EndState.GUIDED):
        return None
    if record.state is EndState.NOT_RUN:
        return FailureCause.NOT_RUN
    if record.state is EndState.ERRORED:
        return _OF_ERRORS[record.error.kind] if record.error is not None else FailureCause.HARNESS_ERROR
    if record.has_stopped:
        return _cause_of_stop(record)
    if record.num_target_visible_rounds == 0:
        return FailureCause.NEVER_IN_VIEW
    if not any(_is_target(record, entry) for entry in record.entries):
        return FailureCause.NOT_REMEMBERED
    was_chosen = any(
        taken.chosen_entry is not None and _is_target(record, taken.chosen_entry) for taken in record.trace
    )
    return FailureCause.NOT_REACHED if was_chosen else FailureCause.NOT_APPROACHED


def _cause_of_stop(record: StageRecord) -> FailureCause:
    entry = record.trace[-1].chosen_entry if record.trace else None
    if entry is None:
        return FailureCause.NO_OBJECT
    if entry.is_stale:
        return FailureCause.STALE_ENTRY
    if entry.label != record.target.category:
        return FailureCause.WRONG_CATEGORY
    return FailureCause.STOPPED_SHORT if _is_target(record, entry) else FailureCause.WRONG_INSTANCE


def _is_target(record: StageRecord, entry: EntryRecord) -> bool:
    x_m, _, z_m = record.target_m_at_end
    distance_m = math.dist((entry.centre_m[0], entry.centre_m[2]), (x_m, z_m))
    return not entry.is_stale and entry.label == record.target.category and distance_m <= NEAR_TARGET_M
