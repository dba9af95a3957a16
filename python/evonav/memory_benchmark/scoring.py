"""Judge the answers of a memory, frame by frame: nothing but counts and spells is kept."""

import hashlib
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from evonav.evaluation.episode.staleness import STALE_MARGIN_M
from evonav.memory_benchmark.answers import CheckedEntries
from evonav.memory_benchmark.metrics.counts import (
    BeliefScore,
    BeliefSnapshot,
    PlaceKey,
    QueryCounts,
    QueryState,
    UpdateCounts,
    change_counts,
)
from evonav.memory_benchmark.metrics.matching import NONE, BodyBoxes
from evonav.memory_benchmark.metrics.spells import Clocks, Spell, TrackedChange
from evonav.memory_benchmark.protocol import FoundPlace, MemoryFrame, StreamInfo
from evonav.memory_benchmark.truth import EVIDENCE_PX, FrameTruth, TrueChange
from evonav.tasks.language import STRUCTURE_TYPES
from evonav.world.simulator import SceneObject

BELIEVED_P = 0.5
"""An entry whose `p_present` is below is not believed: it counts in the belief scores alone."""


class _Scene:
    """The bodies of the house, and what the memory has of them. All arrays are over the bodies of `boxes`."""

    def __init__(self, objects: Sequence[SceneObject], boxes: BodyBoxes, keys: list[PlaceKey]) -> None:
        self.objects, self.boxes, self.keys = objects, boxes, keys
        self.index_of = {body.id: index for index, body in enumerate(boxes.bodies)}
        self.is_object = np.array([body.kind == "object" for body in boxes.bodies], np.bool_)
        self.num_matched = np.zeros(len(boxes), np.intp)
        """Right entries of each object in the last answer."""
        self.is_covered = np.zeros(len(boxes), np.bool_)
        """Whether an entry of the object's label was near it in the last answer, perhaps nearer to another object."""
        self.was_remembered = np.zeros(len(boxes), np.bool_)
        """Whether the object had a right entry in this visit or just before it."""
        self.is_lost = np.zeros(len(boxes), np.bool_)
        """Whether it lost one in this visit."""

    def num_entries_of(self, object_id: str) -> int:
        """Return the right entries that an object has."""
        index = self.index_of.get(object_id)
        return 0 if index is None else int(self.num_matched[index])


@dataclass(slots=True)
class Judge:
    """Takes frames with their truth, and the memory's answers to them."""

    info: StreamInfo
    changes: Sequence[TrueChange]
    counts: UpdateCounts = field(default_factory=UpdateCounts)
    belief: BeliefScore = field(default_factory=BeliefScore)
    queries: dict[QueryState, QueryCounts] = field(
        default_factory=lambda: {"before": QueryCounts(), "after": QueryCounts(), "after_evidence": QueryCounts()}
    )
    snapshots: list[BeliefSnapshot] = field(default_factory=list)
    tracked: list[TrackedChange] = field(default_factory=list)
    seen: set[PlaceKey] = field(default_factory=set)
    clocks: Clocks = field(default_factory=lambda: Clocks(0, 0.0, 0.0))
    num_changes_of: Counter[str] = field(default_factory=Counter)
    _scene: _Scene = field(default_factory=lambda: _Scene([], BodyBoxes(()), []))
    _frame: MemoryFrame | None = None
    _stale: BodyBoxes = field(default_factory=lambda: BodyBoxes(()))
    _stale_changes: list[TrackedChange] = field(default_factory=list)
    _believed_old: frozenset[PlaceKey] = frozenset()
    _answer: tuple[CheckedEntries, int, int] | None = None
    """The visit's last answer, and its numbers of believed and of right entries; doors and windows are not counted."""
    _digest: "hashlib._Hash" = field(default_factory=hashlib.sha256)

    def look(self, frame: MemoryFrame, truth: FrameTruth) -> None:
        """Take a frame, before the memory's answer to it."""
        self._advance(frame)
        if truth.objects is not self._scene.objects:
            self._change_scene(frame.index, truth.objects)
        scene = self._scene
        seen_ids = {one for one in truth.detected_ids if one and truth.visible_px.get(one, 0) >= EVIDENCE_PX}
        self.seen.update(scene.keys[index] for one in seen_ids if (index := scene.index_of.get(one)) is not None)
        for one in self.tracked:
            if one.is_open and truth.empty_px.get(one.index, 0) >= EVIDENCE_PX:
                one.empty.look(self.clocks)
            if one.is_current and one.new_key and one.change.object_id in seen_ids:
                one.found.look(self.clocks)

    def believe(self, entries: CheckedEntries) -> None:
        """Take the memory's entries after the last frame."""
        scene = self._scene
        self._digest.update(entries.ids.tobytes() + entries.numbers.tobytes() + "\0".join(entries.labels).encode())
        is_object = np.array([label not in STRUCTURE_TYPES for label in entries.labels], np.bool_)
        is_believed = is_object & ~(entries.p_present < BELIEVED_P)
        if self._answer is None:
            self._take_belief(entries)
        matches = np.full(len(entries), NONE, np.intp)
        believed = np.flatnonzero(is_believed)
        labels = [entries.labels[index] for index in believed.tolist()]
        matches[believed], scene.is_covered = scene.boxes.match(labels, entries.centres_m[believed])
        num_matched = np.bincount(matches[matches != NONE], minlength=len(scene.boxes))
        # An entry that is nearer to another object now was not forgotten.
        scene.is_lost |= (scene.num_matched > 0) & ~scene.is_covered
        scene.was_remembered |= num_matched > 0
        scene.num_matched = num_matched
        self._answer = (entries, len(believed), int((matches != NONE).sum()))
        self._believe_changes(entries, np.flatnonzero(is_believed & (matches == NONE)))

    def end_visit(self) -> None:
        """Judge the visit that is over."""
        scene, counts = self._scene, self.counts
        if self._answer is None:
            return
        entries, num_believed, num_right = self._answer
        self._take_belief(entries)
        self._close_standing(np.ones(len(scene.boxes), np.bool_))
        is_remembered = scene.num_matched > 0
        scene.was_remembered, scene.is_lost = is_remembered.copy(), np.zeros_like(is_remembered)
        for one in self.tracked:
            self._judge_removal(one)
            self._judge_arrival(one)
        is_seen = np.array([key in self.seen for key in scene.keys], np.bool_) & scene.is_object
        counts.entries += num_believed
        counts.right_entries += num_right
        counts.seen += int(is_seen.sum())
        counts.seen_remembered += int((is_seen & is_remembered).sum())
        counts.remembered += int(is_remembered.sum())
        counts.duplicates += int(np.maximum(scene.num_matched - 1, 0).sum())
        self._take_snapshot(scene)
        self._answer = None

    def _take_snapshot(self, scene: _Scene) -> None:
        covered = {key for key, is_covered in zip(scene.keys, scene.is_covered.tolist(), strict=True) if is_covered}
        self.snapshots.append(
            BeliefSnapshot(
                believed=frozenset(covered) | self._believed_old,
                present=frozenset(scene.keys),
                seen=frozenset(self.seen),
                seen_empty=frozenset(one.old_key for one in self.tracked if one.old_key and one.is_evident),
                taken=frozenset(one.old_key for one in self.tracked if one.old_key and not one.is_open),
            )
        )

    def labels_to_ask(self) -> list[str]:
        """Return the labels of objects that stand where they were seen, sorted: what a memory can be asked for."""
        scene = self._scene
        return sorted(
            {
                body.category
                for body, key, is_object in zip(scene.boxes.bodies, scene.keys, scene.is_object.tolist(), strict=True)
                if is_object and key in self.seen
            }
        )

    def take_places(self, label: str, places: Sequence[FoundPlace]) -> None:
        """Take the answer to `locate(label, k)`, the best place first."""
        scene = self._scene
        of_label = [one for one in self.tracked if one.change.label == label]
        is_known = all(
            (one.old_key is None or one.is_evident or not one.is_open)
            and (one.new_key is None or one.is_seen or not one.is_current)
            for one in of_label
        )
        state: QueryState = "before" if not of_label else "after_evidence" if is_known else "after"
        self.queries[state].take([body for body in scene.boxes.bodies if body.category == label], places)

    def end(self) -> tuple[UpdateCounts, list[Spell]]:
        """Close the stream, and return its counts and spells."""
        gone, come = change_counts(self.snapshots)
        return replace(self.counts, gone=gone, come=come), [spell for one in self.tracked for spell in one.spells()]

    @property
    def digest(self) -> str:
        """Digest of all answers so far: equal for equal bits."""
        return self._digest.hexdigest()

    def _take_belief(self, entries: CheckedEntries) -> None:
        scene, p = self._scene, entries.p_present
        given = [
            index for index in np.flatnonzero(~np.isnan(p)).tolist() if entries.labels[index] not in STRUCTURE_TYPES
        ]
        if given:
            matches, _ = scene.boxes.match([entries.labels[index] for index in given], entries.centres_m[given])
            self.belief.take(p[given], matches != NONE)

    def _advance(self, frame: MemoryFrame) -> None:
        last, clocks = self._frame, self.clocks
        self._frame = frame
        if last is None:
            return
        if frame.visit != last.visit:  # what passes between visits is left out
            self.clocks = replace(clocks, frames=clocks.frames + 1, seconds=clocks.seconds + 1.0 / self.info.rate_hz)
            return
        here, there = last.view.pose, frame.view.pose
        metres = math.hypot(there.x_m - here.x_m, there.z_m - here.z_m)
        seconds = frame.time_s - last.time_s
        self.clocks = Clocks(clocks.frames + 1, clocks.seconds + seconds, clocks.metres + metres)

    def _change_scene(self, frame: int, objects: Sequence[SceneObject]) -> None:
        before = self._scene
        if self._answer is not None:  # in the middle of a visit
            self._take_snapshot(before)
        new = [one for one in enumerate(self.changes) if one[1].frame <= frame][len(self.tracked) :]
        remembered = dict(zip(before.keys, before.num_matched.tolist(), strict=True))
        boxes = BodyBoxes(objects)
        for index, change in new:
            for earlier in self.tracked:
                if earlier.change.object_id == change.object_id and earlier.is_current:
                    self._judge_arrival(earlier)
                    earlier.is_current = False
            key = (change.object_id, self.num_changes_of[change.object_id])
            is_open = change.before is not None and _is_uncovered(change.before, boxes)
            is_remembered = is_open and remembered.get(key, 0) > 0
            self.tracked.append(TrackedChange(index, change, self.clocks, key[1], is_remembered, is_open))
            self.num_changes_of[change.object_id] += 1
        for one in self.tracked:
            if one.is_open and one.change.before is not None and not _is_uncovered(one.change.before, boxes):
                self._judge_removal(one)
                one.is_open = False
        self._stale_changes = [one for one in self.tracked if one.is_open]
        self._stale = BodyBoxes([one.change.before for one in self._stale_changes if one.change.before is not None])
        self._believed_old = frozenset()
        scene = _Scene(objects, boxes, [(body.id, self.num_changes_of[body.id]) for body in boxes.bodies])
        source = {key: index for index, key in enumerate(before.keys)}
        pairs = [(source[key], index) for index, key in enumerate(scene.keys) if key in source]
        old, now = np.array(pairs, np.intp).reshape(-1, 2).T
        for name in ("num_matched", "is_covered", "was_remembered", "is_lost"):
            getattr(scene, name)[now] = getattr(before, name)[old]
        is_gone = np.ones(len(before.boxes), np.bool_)
        is_gone[old] = False
        if self._answer is not None:  # in the middle of a visit: between two, they are counted already
            self._close_standing(is_gone)
        self._scene = scene

    def _close_standing(self, of: NDArray[np.bool_]) -> None:
        scene, counts = self._scene, self.counts
        was_remembered, is_lost = scene.was_remembered & of, scene.is_lost & of
        counts.standing += int(was_remembered.sum())
        counts.false_forgets += int(is_lost.sum())
        counts.false_forgets_at_end += int((is_lost & ~scene.is_covered).sum())

    def _believe_changes(self, entries: CheckedEntries, unmatched: NDArray[np.intp]) -> None:
        """Note which left places have an entry, and which new places have one."""
        scene = self._scene
        labels = [entries.labels[index] for index in unmatched.tolist()]
        rows, places, distances_m = self._stale.pairs(labels, entries.centres_m[unmatched])
        latest = np.full(len(labels), NONE, np.intp)
        is_near = distances_m <= STALE_MARGIN_M
        np.maximum.at(latest, rows[is_near], places[is_near])  # of several changes, the last one left the place
        stale = set(latest[latest != NONE].tolist())
        self._believed_old = frozenset(
            key for place in stale if (key := self._stale_changes[place].old_key) is not None
        )
        for place, one in enumerate(self._stale_changes):
            one.empty.answer(self.clocks, place not in stale)
        for one in self.tracked:
            if one.is_current and one.new_key is not None:
                one.found.answer(self.clocks, scene.num_entries_of(one.change.object_id) > 0)

    def _judge_removal(self, one: TrackedChange) -> None:
        if one.is_removal_judged or not (one.is_open and one.is_remembered and one.is_evident):
            return
        one.is_removal_judged = True
        self.counts.removals += 1
        self.counts.removals_done += one.empty.done is not None

    def _judge_arrival(self, one: TrackedChange) -> None:
        if not one.is_current or not one.is_seen:
            return
        num_matched = self._scene.num_entries_of(one.change.object_id)
        if one.change.kind == "added" and not one.is_arrival_judged:
            one.is_arrival_judged = True
            self.counts.additions += 1
            self.counts.additions_done += num_matched > 0
        is_evident_move = one.change.kind == "moved" and one.is_remembered and one.is_open and one.is_evident
        if is_evident_move and not one.is_move_judged:
            one.is_move_judged = True
            self.counts.moves += 1
            self.counts.moves_done += num_matched == 1 and one.empty.done is not None


def _is_uncovered(body: SceneObject, boxes: BodyBoxes) -> bool:
    """Return whether an entry at the centre of a body would be stale."""
    return bool(boxes.match([body.category], np.array([body.centre_m], np.float64))[0][0] == NONE)
