"""Describe how a stage ended. The causes are decided in `evonav.evaluation.metrics.failure_causes`."""

from evonav.evaluation.metrics.failure_causes import FailureCause, cause_of
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.tasks.language import noun_of

__all__ = ["CAUSE_NAMES", "FailureCause", "cause_of", "sentence"]

CAUSE_NAMES: dict[FailureCause, str] = {
    FailureCause.NO_OBJECT: "stopped without an object",
    FailureCause.STALE_ENTRY: "stopped at a stale entry",
    FailureCause.WRONG_CATEGORY: "stopped at another kind of object",
    FailureCause.STOPPED_SHORT: "stopped short of the target",
    FailureCause.WRONG_INSTANCE: "stopped at another instance",
    FailureCause.NEVER_IN_VIEW: "target never in view",
    FailureCause.NOT_REMEMBERED: "target in view, not recognised",
    FailureCause.NOT_APPROACHED: "target known, never chosen",
    FailureCause.NOT_REACHED: "target known, not reached in time",
    FailureCause.NO_PATH: "errored: no path to the target",
    FailureCause.DECISION_FAILURE: "errored: no valid decision",
    FailureCause.AGENT_ERROR: "errored: the agent failed",
    FailureCause.HARNESS_ERROR: "errored: the simulator or evonav failed",
    FailureCause.NOT_RUN: "not run",
}
"""Names of the causes in reports."""


def sentence(record: StageRecord) -> str:
    """Describe how a stage ended, in one sentence."""
    if record.error is not None:
        return (
            f"{record.state.value.replace('_', ' ').capitalize()} ({record.error.kind.value}): {record.error.message}"
        )
    cause = cause_of(record)
    if record.state is EndState.GUIDED:
        return "The evaluator walked the reference trajectory; the agent looked on."
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
    return f"{CAUSE_NAMES[cause].capitalize()}{named}{distance}."
