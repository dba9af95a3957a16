"""Describe a stage in words: what changed before it, what an agent chose and why, and how it ended.

Entries and frontiers are named as on the map.
"""

import re
from collections.abc import Mapping

from evonav.counted import counted
from evonav.evaluation.metrics.stage_metrics import RecordMetrics
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import EndState, RoundRecord, StageRecord
from evonav.report.tables.table import mode_words
from evonav.tasks.language import noun_of

_REASONS = (
    (r"(\w+), (\d+%) of what is said fits", "{0}: {1} of the relations in the instruction hold"),
    (r"relations do not hold", "an object of the category is known, but the relations in the instruction do not hold"),
    (r"nothing remembered fits", "no remembered object fits the goal"),
    (r"towards object (\d+), which the map does not reach", "towards #{0}, to which the map knows no path yet"),
    (r"(\w+) is where the (.+) should be", "the {1} should be at the {0}"),
    (r"verified", "seen again from close by"),
)
"""Reasons as records state them, and in plain words; a first word is the label of an entry."""


def entry_name(label: str, entry_id: int) -> str:
    """Return the name of an entry on the map: `vase #1`."""
    return f"{noun_of(label)} #{entry_id}"


def describe_choice(entry: RoundRecord, *, has_truth: bool = False) -> str:
    """Describe what a round chose, and with `has_truth` whether the entry was stale and the action failed."""
    kind, _, number = entry.choice.partition(" ")
    text = entry.choice or _action_words(entry)
    if kind == "frontier" and number.isdecimal():
        text = f"frontier #{number}"
    if (chosen := entry.chosen_entry) is not None:
        name = entry_name(chosen.label, chosen.entry_id)
        text = name if kind == "object" else f"{text} ({name})"
        text += " (stale)" if has_truth and chosen.is_stale else ""
    if entry.action.kind == "stop" and entry.choice:
        text += ", stop"
    return f"{text}, action failed" if has_truth and not entry.is_action_success else text


def _action_words(entry: RoundRecord) -> str:
    if entry.action.kind == "move":
        return entry.action.action.value.lower().replace("_", " ")
    return "stop" if entry.action.kind == "stop" else "go to a point"


def describe_reason(reason: str) -> str:
    """Return the reason of a rule in plain words; the reason of a model, or of one's own agent, as it is."""
    for pattern, plain in _REASONS:
        if (found := re.fullmatch(pattern, reason)) is not None:
            label, *others = found.groups() or ("",)
            return plain.format(noun_of(label), *others)
    return reason


def describe_change(record: StageRecord, maps: Mapping[int, FloorPlan]) -> str:
    """Describe what happened before the stage in a few words."""
    transition = record.transition
    if transition.kind == "static":
        return "first stage" if record.stage == 1 else "nothing changed"
    rooms = {room.room_id: noun_of(room.room_type) for m in maps.values() for room in m.rooms}
    room = rooms.get(transition.room_id or "", transition.room_id or "a room")
    moved = f"{counted(len(transition.relocations), 'object')} moved"
    phrases = [f"{mode_words(transition.mode)} in the {room}: {moved}"] if transition.mode is not None else []
    if transition.kind == "activities":
        phrases.append(f"daily activities, most in the {room}: {moved}")
    counts = {"came": transition.num_added, "went": transition.num_removed, "opened or switched": transition.num_states}
    phrases.extend(f"{counted(number, 'object')} {what}" for what, number in counts.items() if number)
    return ", ".join(phrases)


def describe_outcome(stage: RecordMetrics | StageRecord) -> str:
    """Return `success, SPL 0.83` and the like."""
    if stage.state == EndState.SUCCESS:
        return "success" if stage.spl is None else f"success, SPL {stage.spl:.2f}"
    return EndState(stage.state).value.replace("_", " ")
