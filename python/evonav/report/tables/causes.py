"""How a stage ended, in words. What is what is decided in `evonav.evaluation.metrics.failure_causes`."""

from evonav.evaluation.metrics.failure_causes import Cause, cause_of
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.tasks.language import noun_of

__all__ = ["WORDS", "Cause", "cause_of", "sentence"]

WORDS: dict[Cause, str] = {
    Cause.NO_OBJECT: "stopped without an object",
    Cause.STALE_ENTRY: "stopped at a stale entry",
    Cause.WRONG_CATEGORY: "stopped at another kind of object",
    Cause.STOPPED_SHORT: "stopped short of the target",
    Cause.WRONG_INSTANCE: "stopped at another instance",
    Cause.NEVER_IN_VIEW: "target never in view",
    Cause.NOT_REMEMBERED: "target in view, not recognised",
    Cause.NOT_APPROACHED: "target known, never chosen",
    Cause.NOT_REACHED: "target known, not reached in time",
    Cause.NO_PATH: "errored: no path to the target",
    Cause.DECISION_FAILURE: "errored: no valid decision",
    Cause.AGENT_ERROR: "errored: the agent failed",
    Cause.HARNESS_ERROR: "errored: the simulator or evonav failed",
    Cause.NOT_RUN: "not run",
}
"""What reports call the causes."""


def sentence(record: StageRecord) -> str:
    """How a stage ended, in one sentence."""
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
    return f"{WORDS[cause].capitalize()}{named}{distance}."
