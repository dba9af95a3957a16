"""Compute the metrics of a stage from its record (defined in docs/metrics.md): a flat row."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from itertools import accumulate, compress, groupby

from pydantic_core import to_json

from evonav.evaluation.baselines import BASELINES
from evonav.evaluation.metrics.failure_causes import cause_of
from evonav.evaluation.metrics.scoring import stage_spl
from evonav.evaluation.records.costs import StageCosts
from evonav.evaluation.records.schema import EndState, MemoryRecord, StageRecord
from evonav.tasks.language import STRUCTURE_TYPES

STRICT_RADIUS_M = 1.0
"""Largest distance to the target's box for `is_strict_success`."""
COUNTERS = {
    "decisions": "num_decisions",
    "failed_decisions": "num_failed_decisions",
    "conflicts": "num_conflicts",
    "verifications": "num_verifications",
    "rejected_entries": "num_rejected_entries",
}
"""Agents' own counters, cumulative over a task, and the fields that hold what a stage added."""


@dataclass(frozen=True, kw_only=True)
class RecordMetrics:
    """The metrics of one record. Without a score (errored, not run), scores and distances are `None`."""

    agent: str
    is_baseline: bool
    """One of `BASELINES`: never to be ranked among agents."""
    task_id: str
    house: str
    stage: int
    """1-based: `stage - 1` earlier stages share its memory."""
    num_stages: int
    """Stages of the task."""
    state: str
    """`success`, `failure`, `errored` or `not_run`."""
    cause: str | None
    """The reason why it is no success: a value of `FailureCause`."""
    error_kind: str | None
    category: str
    """The target's category."""
    mode: str
    """The kind of the transition before the stage (`TransitionRecord.kind`); `first` in stage 1."""
    stratum: str
    """`stage_1`, `relocated` or `not_relocated` (the paper's)."""
    is_relocated_now: bool
    """The target moved in the transition just before the stage."""
    is_agent_in_changed_room: bool
    num_relocations: int
    """Objects that moved in the transition before the stage."""
    num_failed_before: int
    """Earlier stages of the episode in which the agent failed to answer."""
    has_lost_memory: bool
    """Its process was lost earlier in the episode, and its memory with it."""

    success: bool | None
    """The paper's: within the success radius at the end, on the ground plane."""
    is_strict_success: bool | None
    """It called stop, at most 1 m from the target's box, with the target in view."""
    is_geodesic_success: bool | None
    """The shortest path from its end to the target is shorter than the success radius."""
    spl: float | None
    soft_spl: float | None
    ring_spl: float | None
    """SPL to the success radius instead of the target's centre; `None` for a start within the radius."""
    start_distance_m: float | None
    terminal_distance_m: float | None
    """Ground plane, to the centre of the target: success at another radius is `terminal_distance_m < radius`."""
    terminal_box_distance_m: float | None
    terminal_geodesic_m: float | None
    path_length_m: float | None
    reference_length_m: float | None
    reference_ring_m: float | None

    num_rounds: int
    has_stopped: bool
    stop_reason: str
    is_snapped: bool
    num_target_visible_rounds: int
    first_target_visible_round: int | None
    num_failed_actions: int
    """Rounds whose action could not be carried out."""

    num_stale_visits: int
    """Runs of rounds with one and the same stale entry chosen."""
    num_stale_rounds: int
    stale_path_m: float
    """Walked in rounds that had chosen a stale entry."""
    num_stale_at_start: int | None
    """Entries that are stale as the stage begins."""
    num_stale_evident: int | None
    """The stale entries whose empty place came into view."""
    num_stale_cleared: int | None
    """The evident stale entries that the agent dropped or corrected before the stage ended."""
    rounds_to_clear: float | None
    """Mean over the cleared ones, from the first view of the empty place."""
    metres_to_clear: float | None
    num_moved: int | None
    """Objects that the transition moved out of their old places."""
    num_moved_seen: int | None
    num_moved_found: int | None
    """Objects that were seen at their new place and that an entry came to stand for."""
    rounds_to_find: float | None
    """Mean over the found ones, from the first view of the object at its new place."""
    metres_to_find: float | None
    num_forgotten: int | None
    """Objects known at the start and not at the end though they stand where they stood."""

    num_entries: int | None
    """Entries of objects in memory at the end; doors and windows, which never move, count in none of these."""
    num_stale_entries: int | None
    """Stale entries in memory at the end."""
    precision: float | None
    """Entries at the end with an object of their label in their place, by all; `None` without entries."""
    recall: float | None
    """Objects seen so far that a right entry stands for at the end, by all seen so far."""
    num_seen_objects: int | None
    num_duplicates: int | None
    """Right entries at the end beyond the first for an object."""
    position_error_m: float | None
    num_entries_at_start: int | None
    precision_at_start: float | None
    """The precision at the start, when the agent knows the goal: from stage 2 on it shows the cost of the change."""
    recall_at_start: float | None

    during: str | None = None
    """Effect of the change during the stage, a name of `DURING_STRATA`; `None` without a change in the task."""
    spl_after_change: float | None = None
    """SPL from the change during the stage on: the paths are those from the agent's place at the change."""

    @property
    def is_scored(self) -> bool:
        """True if the stage counts in rates."""
        return self.success is not None


_OWN = {"state", "during"}
_COPIED = tuple(field.name for field in fields(RecordMetrics) if field.name in {*StageRecord.model_fields} - _OWN)
"""The metrics that are fields of the record."""


@dataclass(frozen=True, kw_only=True, slots=True)
class StageMetrics(StageCosts, RecordMetrics):
    """A stage as one row: the metrics of its record, changes since the stage before, and costs."""

    precision_before: float | None
    """Precision at the end of the stage before, in its house; `precision_at_start` is less by what the change cost."""
    num_decisions: int | None
    """Questions that the agent's model answered in this stage, or rounds in which it decided; its own counter."""
    num_failed_decisions: int | None
    num_conflicts: int | None
    num_verifications: int | None
    num_rejected_entries: int | None

    def is_success_at(self, radius_m: float) -> bool | None:
        """Return whether the stage were a success with another radius; `None` where the stage has no score."""
        return None if self.terminal_distance_m is None or not self.is_scored else self.terminal_distance_m < radius_m


def encode_metrics(record: StageRecord) -> str:
    """Encode the metrics and counters of a record as JSON, for `evonav.evaluation.metrics.stage_rows`.

    Args:
        record: The whole record, with its trace.
    """
    last = record.trace[-1].counters if record.trace else {}
    values = {
        "metrics": vars(metrics_of(record)),
        "counters": {name: last[name] for name in COUNTERS if name in last}
        # Agents count failures from the first one on.
        | ({"failed_decisions": last.get("failed_decisions", 0)} if "decisions" in last else {}),
        "is_fresh": record.stage == 1 or record.memory_lost_at == record.stage,
    }
    return to_json(values, inf_nan_mode="constants").decode()


def metrics_of(record: StageRecord) -> RecordMetrics:
    """Return the metrics of one record.

    Args:
        record: The whole record, with its trace.
    """
    is_success = record.state is EndState.SUCCESS if record.is_scored else None
    cause = cause_of(record)
    lengths_m = [math.fsum(map(math.dist, taken.path_m, taken.path_m[1:])) for taken in record.trace]
    travelled_m = list(accumulate(lengths_m, initial=0.0))  # before each round
    chosen = [None if (entry := one.chosen_entry) is None else (entry.entry_id, entry.is_stale) for one in record.trace]
    went_to_stale = [one is not None and one[1] for one in chosen]
    start, end = record.memory_at_start, record.memory_at_end
    has_memory = end is not None
    cleared = [(e.evident_round, e.cleared_round) for e in record.stale_entries]
    found = [(m.seen_round, m.found_round) for m in record.moved_objects]
    has_entries = has_memory or bool(record.entries)
    entries = [entry for entry in record.entries if entry.label not in STRUCTURE_TYPES]
    num_stale = sum(entry.is_stale for entry in entries)
    return RecordMetrics(
        **{name: getattr(record, name) for name in _COPIED},
        is_baseline=record.agent in BASELINES,
        state=record.state.value,
        cause=None if cause is None else cause.value,
        error_kind=None if record.error is None else record.error.kind.value,
        category=record.target.category,
        mode=record.mode,
        stratum=record.stratum,
        is_relocated_now=record.target.is_relocated_now,
        is_agent_in_changed_room=record.transition.is_agent_in_room,
        num_relocations=len(record.transition.relocations),
        num_failed_before=len(record.failed_before),
        has_lost_memory=record.memory_lost_at is not None,
        success=is_success,
        is_strict_success=_is_strict_success(record),
        ring_spl=_ring_spl(record),
        first_target_visible_round=next((r.round for r in record.trace if r.is_target_visible), None),
        num_failed_actions=sum(not taken.is_action_success for taken in record.trace),
        num_stale_visits=sum(one is not None and one[1] for one, _ in groupby(chosen)),
        num_stale_rounds=sum(went_to_stale),
        stale_path_m=math.fsum(compress(lengths_m, went_to_stale)),
        num_stale_at_start=len(record.stale_entries) if has_memory else None,
        num_stale_evident=sum(evident is not None for evident, _ in cleared) if has_memory else None,
        num_stale_cleared=sum(gone is not None for _, gone in cleared) if has_memory else None,
        rounds_to_clear=_mean(b - a for a, b in _whole(cleared)),
        metres_to_clear=_mean(travelled_m[b] - travelled_m[a] for a, b in _whole(cleared)),
        num_moved=len(record.moved_objects) if has_memory else None,
        num_moved_seen=sum(seen is not None for seen, _ in found) if has_memory else None,
        num_moved_found=sum(there is not None for _, there in found) if has_memory else None,
        rounds_to_find=_mean(b - a for a, b in _whole(found)),
        metres_to_find=_mean(travelled_m[b] - travelled_m[a] for a, b in _whole(found)),
        num_entries=len(entries) if has_entries else None,
        num_stale_entries=num_stale if has_entries else None,
        precision=1.0 - num_stale / len(entries) if entries else None,
        recall=_recall(end),
        num_seen_objects=None if end is None else end.num_seen,
        num_duplicates=None if end is None else end.num_right - end.num_held,
        position_error_m=None if end is None else end.position_error_m,
        num_entries_at_start=None if start is None else start.num_entries,
        precision_at_start=start.num_right / start.num_entries if start is not None and start.num_entries else None,
        recall_at_start=_recall(start),
        during=record.during_stratum,
        spl_after_change=_spl_after_change(record),
    )


def _spl_after_change(record: StageRecord) -> float | None:
    """Return the SPL of what followed the change during a stage, from the agent's place at the change."""
    during = record.during
    if during is None or during.reference_after_m is None or record.path_length_m is None or not record.is_scored:
        return None
    path_m = max(0.0, record.path_length_m - (during.path_before_m or 0.0))
    return stage_spl(record.state is EndState.SUCCESS, path_m, during.reference_after_m)


def _whole(spans: Iterable[tuple[int | None, int | None]]) -> Iterator[tuple[int, int]]:
    return ((a, b) for a, b in spans if a is not None and b is not None)


def _mean(values: Iterable[float]) -> float | None:
    found = list(values)
    return math.fsum(found) / len(found) if found else None


def _recall(memory: MemoryRecord | None) -> float | None:
    return memory.num_seen_held / memory.num_seen if memory is not None and memory.num_seen else None


def _is_strict_success(record: StageRecord) -> bool | None:
    if not record.is_scored or record.terminal_box_distance_m is None:
        return None
    # An agent stops where it looked: the views of its last round are those of the terminal pose.
    is_in_view = bool(record.trace) and record.trace[-1].is_target_visible
    return record.has_stopped and is_in_view and record.terminal_box_distance_m <= STRICT_RADIUS_M


def _ring_spl(record: StageRecord) -> float | None:
    if not record.is_scored or not record.reference_ring_m or record.path_length_m is None:
        return None
    is_success = record.state is EndState.SUCCESS
    return record.reference_ring_m / max(record.path_length_m, record.reference_ring_m) if is_success else 0.0
