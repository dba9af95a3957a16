"""Build the JSON of a viewer's page, kept small: images are stored once, maps and entries as their changes.

Coordinates are page coordinates (`svg.cm`). A round's `cells` are runs `LENGTH VALUE` over the map's cells row by row:
the length in base 36, the value a letter, `A` to `D` for the values of `ReplayedMap.cells`, `E` for as in the round
before; what is left of the map is as before, and before the first round all is unknown.
"""

import base64
import json
import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.agents.agent import PlaceBelief
from evonav.agents.explanation import FrontierBelief
from evonav.counted import counted
from evonav.drawing.floor_plan import PlanFrame
from evonav.drawing.svg import clean, cm, polyline, simplified
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import EndState, RoundRecord, StageRecord
from evonav.replay.types import (
    ReplayedEntry,
    ReplayedMap,
    ReplayedQuestion,
    ReplayedRound,
    ReplayedStage,
    Truth,
)
from evonav.report.maps.moments import describe_during, during_facts, moments
from evonav.report.maps.text import describe_change, describe_choice, describe_outcome, describe_reason, entry_name
from evonav.report.tables.causes import sentence
from evonav.tasks.language import noun_of

_DIGITS = "0123456789abcdefghijklmnopqrstuvwxyz"
LEAST_HEAT = 100.0
"""Factor by which a square may be less likely than the likeliest one and still be drawn."""
_SAME = 4
_KINDS = {
    "object": "object",
    "frontier": "frontier",
    "exploration": "frontier",
    "confirmed": "object",
    "temporary": "object",
}
"""First words of choices, UniGoal's last, and their mark in the timeline."""


class PageData:
    """The JSON of one page."""

    def __init__(self) -> None:
        self.stages: list[dict[str, Any]] = []
        self.images: list[str] = []
        """JPEG, base64."""
        self.prompts: list[list[Any]] = []
        self._image_index: dict[bytes, int] = {}
        self._prompt_index: dict[str, int] = {}

    def text(self) -> str:
        """JSON that may stand in a `script` element."""
        content = {"stages": self.stages, "images": self.images, "prompts": self.prompts}
        text = json.dumps(content, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
        return clean(text).replace("<", "\\u003c")

    def image(self, jpeg: bytes) -> int:
        """Index of an image."""
        if jpeg not in self._image_index:
            self._image_index[jpeg] = len(self.images)
            self.images.append(base64.b64encode(jpeg).decode())
        return self._image_index[jpeg]

    def prompt(self, question: ReplayedQuestion) -> int:
        """Index of a prompt: texts, image indices, and `[role, text]` where it is not the user's turn."""
        parts: list[Any] = []
        for role, content in question.parts:
            shown = self.image(content) if isinstance(content, bytes) else content
            parts.append(shown if role == "user" else [role, shown])
        key = json.dumps(parts)
        if key not in self._prompt_index:
            self._prompt_index[key] = len(self.prompts)
            self.prompts.append(parts)
        return self._prompt_index[key]

    def add_stage(self, stage: ReplayedStage, maps: Mapping[int, FloorPlan], frame: PlanFrame, budget: int) -> None:
        """Add a stage, in which the agent had `budget` rounds, to the page."""
        record = stage.record
        rounds = _Rounds(self, record)
        entry: dict[str, Any] = {
            "k": record.stage,
            "state": record.state.value,
            "words": describe_outcome(record),
            "sentence": sentence(record),
            "goal": record.goal.instruction,
            "noun": noun_of(record.goal.category),
            "reference": None if stage.floor_plan is None else stage.floor_plan.reference_image,
            "changed": describe_change(record, maps) + _target_words(record),
            "lost": _lost_words(record),
            "facts": _facts(record),
            "budget": budget,
            "fov": round(math.degrees(stage.fov_rad), 1),
            "unit": round(frame.unit, 2),
            "whyNot": stage.why_not,
            "differences": list(stage.differences),
            "tells": any(_tells(step.record) for step in stage.rounds),
            "hasBelief": any(step.map is not None for step in stage.rounds),
            "end": _end(record),
            "rounds": [rounds.data(step) for step in stage.rounds],
        }
        if (after := moments(record, maps)[1:]) != []:
            entry["during"] = [after[0].first_round, describe_during(after[0])]
        self.stages.append(entry)


class _Rounds:
    """Encode the rounds of a stage one after another, each as its changes."""

    def __init__(self, page: PageData, record: StageRecord) -> None:
        self._page = page
        self._record = record
        self._cells: NDArray[np.uint8] = np.zeros(0, np.uint8)
        self._place: tuple[Any, ...] = ()
        self._entries: dict[int, list[Any]] = {}
        self._frontiers: list[list[Any]] = []
        self._counters: dict[str, int] = {}

    def data(self, step: ReplayedRound) -> dict[str, Any]:
        """Return a round; keys that are empty, or equal to the round before, are left out."""
        record = step.record
        heading_rad = step.pose.yaw_rad
        found: dict[str, Any] = {
            "p": [*cm((step.pose.x_m, step.pose.z_m)), round(math.degrees(heading_rad), 1)],
            "v": [[self._page.image(view.jpeg), _turn_deg(heading_rad, view.pose.yaw_rad)] for view in step.views],
        }
        if record is not None:
            found |= self._decision(record)
        found["kind"] = _kind(record)
        if step.note:
            found["note"] = step.note
        if (truth := describe_truth(self._record, step)) != "":
            found["truth"] = truth
        if step.map is not None:
            found |= self._map(step.map)
            found |= self._changed_entries(step.entries)
            frontiers = [_frontier(frontier) for frontier in step.frontiers]
            if frontiers != self._frontiers:
                found["f"] = self._frontiers = frontiers
        if step.places is not None:
            found["heat"] = _heat(step.places)
        if step.candidate_ids:
            found["cand"] = list(step.candidate_ids)
        if step.questions:
            found["q"] = [self._question(question) for question in step.questions]
        return found

    def _question(self, question: ReplayedQuestion) -> list[Any]:
        """`[kind, outcome, answer, prompt, names, meaning]`: the meaning is the answer's object as the map names it."""
        head, *rest = question.answer.split("\n")
        names = _offered_names(question)
        answer = "\n".join((head, *map(describe_reason, rest)))
        meaning = names.get(head.strip(), "")
        return [question.kind, question.outcome, answer, self._page.prompt(question), _names_text(names), meaning]

    def _decision(self, record: RoundRecord) -> dict[str, Any]:
        action = record.action
        found: dict[str, Any] = {
            "action": "stop",
            "choice": describe_choice(record),
            "path": polyline(simplified([cm(point) for point in record.path_m])),
            "len": round(sum(math.dist(a, b) for a, b in pairwise(record.path_m)), 3),
            "seen": record.is_target_visible,
            "n": [record.num_entries, record.num_frontiers],
        }
        if action.kind == "navigate_to":
            found |= {"action": "go to", "to": list(cm(action.position_m))}
        elif action.kind == "move":
            found["action"] = action.action.value.lower().replace("_", " ")
        elif action.reason:
            found["why"] = describe_reason(action.reason)
        if not record.is_action_success:
            found["failed"] = True
        if record.chosen_entry is not None:
            found["chosen"] = record.chosen_entry.entry_id
        kind, _, number = record.choice.partition(" ")
        if kind == "frontier" and number.isdecimal():
            found["frontier"] = int(number)
        if record.details:
            found["details"] = _plain(record.details)
            if isinstance(reason := record.details.get("reason"), str):
                found["details"]["reason"] = describe_reason(reason)
        counters = {name: count for name, count in record.counters.items() if self._counters.get(name) != count}
        if counters:
            found["counters"] = counters
            self._counters.update(counters)
        return found

    def _map(self, agent_map: ReplayedMap) -> dict[str, Any]:
        found: dict[str, Any] = {}
        place = (*agent_map.cells.shape, agent_map.cell_m, *agent_map.corner_m)
        if place != self._place:
            rows, cols = agent_map.cells.shape
            left, bottom = cm(agent_map.corner_m)
            found["grid"] = [rows, cols, round(100 * agent_map.cell_m, 3), left, bottom]
            self._place, self._cells = place, np.zeros(agent_map.cells.size, np.uint8)
        cells = agent_map.cells.ravel()
        found["cells"] = cells_text(cells, self._cells)
        self._cells = cells
        return found

    def _changed_entries(self, entries: Sequence[ReplayedEntry]) -> dict[str, Any]:
        now = {entry.record.entry_id: _entry(entry, self._record) for entry in entries}
        changed = [data for name, data in now.items() if self._entries.get(name) != data]
        gone = [name for name in self._entries if name not in now]
        self._entries = now
        return {**({"e": changed} if changed else {}), **({"x": gone} if gone else {})}


def _tells(record: RoundRecord | None) -> bool:
    """Return whether the agent described a round."""
    return record is not None and bool(record.choice or record.num_entries or record.num_frontiers)


def _turn_deg(from_rad: float, to_rad: float) -> int:
    """Return the smallest turn from one heading to another, positive to the right."""
    return round(math.degrees(math.remainder(to_rad - from_rad, math.tau)))


def _offered_names(question: ReplayedQuestion) -> dict[str, str]:
    """Return the names on the map of what a prompt offers: `Object 0` is `vase #1`."""
    return {name: entry_name(what, number) for name, what, number in question.offered}


def _names_text(names: Mapping[str, str]) -> str:
    return "On the map: " + "; ".join(f"{name} is {shown}" for name, shown in names.items()) + "." if names else ""


def _plain(value: Any) -> Any:  # noqa: ANN401 - JSON
    """Return JSON data without values that JSON cannot express."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def cells_text(cells: NDArray[np.uint8], before: NDArray[np.uint8]) -> str:
    """Encode a map as runs, see the module.

    Args:
        cells: `(N,)`, values 0 to 3.
        before: Cells of the round before, in the same format.
    """
    values = np.where(cells == before, np.uint8(_SAME), cells)
    if not len(values):
        return ""
    starts = np.concatenate(([0], np.flatnonzero(np.diff(values)) + 1))
    lengths = np.diff(np.concatenate((starts, [len(values)])))
    runs = list(zip(lengths.tolist(), values[starts].tolist(), strict=True))
    if runs[-1][1] == _SAME:
        runs.pop()
    return "".join(_base36(length) + "ABCDE"[value] for length, value in runs)


def _base36(number: int) -> str:
    digits = ""
    while number:
        number, digit = divmod(number, 36)
        digits = _DIGITS[digit] + digits
    return digits


def _entry(entry: ReplayedEntry, record: StageRecord) -> list[Any]:
    """`[id, label, x, y, width, depth, detections, stale, target, now]`; `now`: place, `"gone"` or `None`."""
    belief, truth = entry.record, entry.truth
    x, y = cm((belief.centre_m[0], belief.centre_m[2]))
    size = [min(100_000, round(100 * abs(edge))) if math.isfinite(edge) else 0 for edge in belief.size_m]
    now: Any = None
    if belief.is_stale and truth is not None:
        now = "gone" if truth.now_m is None else list(cm((truth.now_m[0], truth.now_m[2])))
    is_target = truth is not None and truth.object_id == record.target.object_id
    return [
        belief.entry_id,
        noun_of(belief.label),
        x,
        y,
        size[0],
        size[2],
        belief.num_detections,
        int(belief.is_stale),
        int(is_target),
        now,
    ]


def _heat(places: PlaceBelief) -> list[Any]:
    """`[edge, [[x, y, percent], ...]]`: the squares that are not much less likely than the likeliest."""
    least = max(places.probabilities, default=0.0) / LEAST_HEAT
    squares = zip(places.centres_m, places.probabilities, strict=True)
    shown = [[*cm(centre_m), round(100.0 * p, 2)] for centre_m, p in squares if p > 0.0 and p >= least]
    return [round(100 * places.cell_m, 1), shown]


def _frontier(frontier: FrontierBelief) -> list[Any]:
    return [frontier.frontier_id, *cm(frontier.position_m), round(math.degrees(frontier.direction_rad))]


def _kind(record: RoundRecord | None) -> str:
    """Return the kind of a round's mark in the timeline."""
    if record is None:
        return "error"
    if record.action.kind == "stop":
        return "stop"
    if record.chosen_entry is not None:
        return "stale" if record.chosen_entry.is_stale else "object"
    return next((kind for prefix, kind in _KINDS.items() if record.choice.startswith(prefix)), "other")


def describe_truth(stage: StageRecord, step: ReplayedRound) -> str:
    """Describe what the evaluator knows of the entry that a round chose."""
    chosen = None if step.record is None else step.record.chosen_entry
    if chosen is None:
        return ""
    truth = next((entry.truth for entry in step.entries if entry.record.entry_id == chosen.entry_id), None)
    noun = noun_of(chosen.label)
    is_target = truth is not None and truth.object_id == stage.target.object_id
    if chosen.is_stale:
        return f"Stale: {_stale_words(noun, truth, chosen.centre_m, is_target=is_target)}"
    if is_target:
        return f"This {noun} is the target."
    if truth is None:
        return ""
    if chosen.label == stage.target.category:
        return f"There is a {noun} here, but not the one that is asked for."
    return f"There is a {noun} here; what is asked for is another thing: {noun_of(stage.target.category)}."


def _stale_words(noun: str, truth: Truth | None, centre_m: Sequence[float], *, is_target: bool) -> str:
    if truth is None:
        return f"no {noun} ever stood here."
    which = f"the {noun} that is asked for" if is_target else f"the {noun}"
    when = f"{which} stood here in stage {truth.stood_in_stage}"
    if truth.now_m is None:
        return f"{when} and is no longer in the house."
    distance_m = math.hypot(truth.now_m[0] - centre_m[0], truth.now_m[2] - centre_m[2])
    return f"{when} and stands {distance_m:.1f} m away now."


def _target_words(record: StageRecord) -> str:
    if record.target.is_relocated_now:
        return ", the target among them"
    return "; target moved earlier" if record.target.is_relocated else ""


def _lost_words(record: StageRecord) -> str:
    """Describe what an earlier failure of the agent cost it."""
    losses = []
    if record.failed_before:
        stages = ", ".join(map(str, record.failed_before))
        losses.append(f"the agent failed in stage{'s' if len(record.failed_before) > 1 else ''} {stages}")
    if record.memory_lost_at is not None:
        losses.append(f"its process was lost, and it began again, without memory, in stage {record.memory_lost_at}")
    return "; ".join(losses)


def _facts(record: StageRecord) -> list[list[str]]:
    """Return names and values that describe how a stage went."""
    facts: list[tuple[str, str]] = [("rounds", str(record.num_rounds))]
    if record.path_length_m is not None:
        facts.append(("walked", f"{record.path_length_m:.1f} m"))
    if record.reference_length_m is not None:
        facts.append(("shortest path", f"{record.reference_length_m:.1f} m"))
    if record.terminal_distance_m is not None:
        facts.append(("target at the end", f"{record.terminal_distance_m:.2f} m away"))
    facts.append(("target in view", counted(record.num_target_visible_rounds, "round")))
    if record.has_stopped:
        facts.append(("stopped", record.stop_reason or "yes"))
    elif record.terminal is not None:
        facts.append(("stopped", "no, the rounds ran out"))
    if record.is_snapped:
        facts.append(("start", "moved to the nearest free place"))
    return [list(fact) for fact in (*facts, *during_facts(record))]


def _end(record: StageRecord) -> list[int] | None:
    """Return where the stage ended in page coordinates, and whether it is a success."""
    if record.terminal is None:
        return None
    return [*cm((record.terminal.x_m, record.terminal.z_m)), int(record.state is EndState.SUCCESS)]
