"""Track which entries of an agent's memory are stale, and what the agent could have seen. It defines *stale*.

An entry is *stale* unless an object of its label stands within `STALE_MARGIN_M` of its centre; then it is *right*, and
matched to the nearest such object. An object is *seen* once at least `min_visible_px` of its pixels are in a view that
was taken at most `EVIDENCE_RANGE_M` from it, the range of the paper's object memory. Only what was seen counts against
an agent.

Doors and windows never move, so entries of them count nowhere here: agents differ in whether they remember them.
"""

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from evonav import _core
from evonav.agents.agent import EntryBelief
from evonav.evaluation.records.schema import (
    BeliefRecord,
    EntryRecord,
    MemoryRecord,
    MovedObjectRecord,
    Relocation,
    StaleEntryRecord,
)
from evonav.points import Point3
from evonav.tasks.language import STRUCTURE_TYPES
from evonav.world.camera import project
from evonav.world.pose import Pose
from evonav.world.simulator import Frame, SceneObject

STALE_MARGIN_M = 0.3
"""Distance from an entry's centre to the box of an object up to which the object can be the entry's."""
EVIDENCE_RANGE_M = 3.5
"""Largest distance on the ground plane from the camera to an object or an entry that counts as evidence."""
SURFACE_SLACK_M = 0.05


def matched_object(label: str, centre_m: Point3, bodies: Mapping[str, Sequence[SceneObject]]) -> SceneObject | None:
    """Return the object that an entry stands for; `None` for a stale entry.

    Args:
        bodies: The objects of the stage's house by category.

    Returns:
        The object of this label whose box is nearest to the centre, if it is within `STALE_MARGIN_M`. Of several at the
        same distance, the one with the nearest centre.
    """
    nearest, least = None, (STALE_MARGIN_M, math.inf)
    for body in bodies.get(label, ()):
        distance_m = distance_to_box_m(centre_m, body)
        if distance_m <= least[0]:
            rank = (distance_m, math.dist(centre_m, body.centre_m))
            if rank < least or nearest is None:
                nearest, least = body, rank
    return nearest


def movable(beliefs: Sequence[EntryBelief]) -> list[EntryBelief]:
    """Return the entries of objects: those of doors and windows, which never move, are left out."""
    return [belief for belief in beliefs if belief.label not in STRUCTURE_TYPES]


def matched_objects(
    beliefs: Sequence[EntryBelief], bodies: Mapping[str, Sequence[SceneObject]]
) -> list[SceneObject | None]:
    """Return `matched_object` of each entry."""
    return [matched_object(belief.label, belief.centre_m, bodies) for belief in beliefs]


def entry_record(belief: EntryBelief, bodies: Mapping[str, Sequence[SceneObject]]) -> EntryRecord:
    """Return an entry for the record, with the evaluator's judgement whether it is stale."""
    is_stale = matched_object(belief.label, belief.centre_m, bodies) is None
    return EntryRecord(
        belief.entry_id,
        belief.label,
        belief.centre_m,
        belief.size_m,
        belief.num_detections,
        belief.p_present,
        is_stale=is_stale,
    )


def distance_to_box_m(point_m: Point3, body: SceneObject) -> float:
    """Return the distance from a point to the axis-aligned box of a body; 0 inside."""
    (x_m, y_m, z_m), (width_m, height_m, depth_m) = body.centre_m, body.size_m
    beyond_x_m = max(0.0, abs(point_m[0] - x_m) - width_m / 2)
    beyond_y_m = max(0.0, abs(point_m[1] - y_m) - height_m / 2)
    beyond_z_m = max(0.0, abs(point_m[2] - z_m) - depth_m / 2)
    return math.hypot(beyond_x_m, beyond_y_m, beyond_z_m)


def is_near(place_m: Point3, camera: Pose) -> bool:
    """Return whether a place is within `EVIDENCE_RANGE_M` of a camera."""
    return math.hypot(place_m[0] - camera.x_m, place_m[2] - camera.z_m) <= EVIDENCE_RANGE_M


def shows_place(frame: Frame, belief: EntryBelief) -> bool:
    """Return whether a view shows the centre of an entry: in the image, near enough, and not hidden.

    Args:
        belief: An entry; what stands in its own box does not hide it.
    """
    pose, intrinsics = frame.pose, frame.intrinsics
    if not is_near(belief.centre_m, pose):
        return False
    ((col, row, depth_m),) = project(np.array([belief.centre_m]), pose, intrinsics).tolist()
    # NaN, for a place behind the camera, is in no range.
    if not (0.0 <= col < intrinsics.width_px and 0.0 <= row < intrinsics.height_px):
        return False
    reach_m = max(belief.size_m) / 2.0 + SURFACE_SLACK_M
    return float(frame.depth_m[int(row), int(col)]) >= float(depth_m) - reach_m


@dataclass(slots=True)
class _StaleEntry:
    belief: EntryBelief
    evident_round: int | None = None
    cleared_round: int | None = None


@dataclass(slots=True)
class _MovedObject:
    body: SceneObject
    index: int
    seen_round: int | None = None
    found_round: int | None = None


@dataclass(slots=True)
class TrackedState:
    """The state that is carried from stage to stage of an episode."""

    seen_ids: set[str] = field(default_factory=set)
    """Objects seen so far."""
    beliefs: Sequence[EntryBelief] = ()
    """The agent's entries of objects at the end of the last stage."""
    pending: tuple[Relocation, ...] = ()
    """Moves of the change during the last stage that took place after its end."""


class StalenessTracker:
    """Follows one stage: its views, and the agent's entries at the start, between rounds and at the end."""

    def __init__(
        self,
        objects: Sequence[SceneObject],
        target_id: str,
        relocations: Sequence[Relocation],
        so_far: TrackedState,
        min_visible_px: int,
    ) -> None:
        """Create a tracker that has seen nothing of the stage.

        Args:
            objects: The simulator's bodies, in instance order.
            relocations: The objects that the transition before the stage moved.
            so_far: The state of the episode; objects that are seen are added.
            min_visible_px: Number of pixels from which an object counts as in view.
        """
        self._target_id = target_id
        self._so_far = so_far
        self._min_visible_px = min_visible_px
        self._moved: list[_MovedObject] = []
        self._enter(objects, (*so_far.pending, *relocations))
        self._stale: list[_StaleEntry] = []
        self._matched_before: set[str] = set()
        self._round = 0
        self.is_target_visible = False
        """True if the target is in a view of this round, at any distance."""

    def _enter(self, objects: Sequence[SceneObject], relocations: Sequence[Relocation]) -> None:
        """Take in a house and the moves that led to it; an object that moves again is to be found again."""
        self._objects = objects
        self.bodies: dict[str, list[SceneObject]] = {}
        """The bodies by category."""
        for body in objects:
            self.bodies.setdefault(body.category, []).append(body)
        index_of = {body.id: index for index, body in enumerate(objects)}
        self._target = index_of.get(self._target_id)
        self._seen = {index for index, body in enumerate(objects) if body.id in self._so_far.seen_ids}
        self._movable = {index for index, body in enumerate(objects) if body.kind == "object"}
        origins_m: dict[str, Point3] = {}
        for one in relocations:
            origins_m.setdefault(one.object_id, one.from_m)
        stays = [moved for moved in self._moved if moved.body.id not in origins_m and moved.body.id in index_of]
        for moved in stays:
            moved.index = index_of[moved.body.id]
        self._moved = stays + [
            _MovedObject(objects[index], index)
            for object_id, from_m in origins_m.items()
            if (index := index_of.get(object_id)) is not None
            and distance_to_box_m(from_m, objects[index]) > STALE_MARGIN_M
        ]

    def change_house(self, objects: Sequence[SceneObject], relocations: Sequence[Relocation]) -> None:
        """Take in that the house has changed during the stage: from here on, entries are judged by it.

        Args:
            objects: The simulator's bodies, in instance order.
        """
        self._store_seen()
        self._enter(objects, relocations)
        self._matched_before -= {one.object_id for one in relocations}

    @property
    def is_target_seen(self) -> bool:
        """True if the target was seen, now or earlier in the episode, wherever it stood then."""
        return self._target in self._seen

    def target_box_distance_m(self, point_m: tuple[float, float]) -> float | None:
        """Return the ground-plane distance from a point to the target's box; `None` without a target in the house."""
        if self._target is None:
            return None
        body = self._objects[self._target]
        (x_m, _, z_m), (width_m, _, depth_m) = body.centre_m, body.size_m
        gap_x_m, gap_z_m = abs(point_m[0] - x_m) - width_m / 2, abs(point_m[1] - z_m) - depth_m / 2
        return math.hypot(max(0.0, gap_x_m), max(0.0, gap_z_m))

    def begin(self, beliefs: Sequence[EntryBelief]) -> MemoryRecord:
        """Judge the agent's entries as the stage begins."""
        beliefs = movable(beliefs)
        matches = matched_objects(beliefs, self.bodies)
        earlier = self._so_far.beliefs
        earlier_matches = matches if list(earlier) == list(beliefs) else matched_objects(earlier, self.bodies)
        self._matched_before = {body.id for body in earlier_matches if body is not None}
        self._stale = [_StaleEntry(belief) for belief, body in zip(beliefs, matches, strict=True) if body is None]
        return self._memory(beliefs, matches)

    def stale_ids(self, beliefs: Sequence[EntryBelief]) -> list[int]:
        """Return the ids of the stale entries."""
        beliefs = movable(beliefs)
        matches = matched_objects(beliefs, self.bodies)
        return [belief.entry_id for belief, body in zip(beliefs, matches, strict=True) if body is None]

    def presence(self, beliefs: Sequence[EntryBelief]) -> BeliefRecord | None:
        """Return the probabilities of the entries that have one, and whether these are right; `None` without any."""
        stated = [belief for belief in movable(beliefs) if belief.p_present is not None]
        matches = matched_objects(stated, self.bodies)
        pairs = tuple((one.p_present or 0.0, body is not None) for one, body in zip(stated, matches, strict=True))
        return BeliefRecord(presence=pairs) if pairs else None

    def begin_round(self, number: int) -> None:
        """Begin a round (0-based), whose views come next."""
        self._round = number
        self.is_target_visible = False

    def look(self, frame: Frame) -> None:
        """Take in a view as the simulator rendered it, with instances."""
        instances = frame.stored_instances
        if instances is None:
            return
        areas_px = _core.instance_areas(instances, len(self._objects))
        visible = set((areas_px >= self._min_visible_px).nonzero()[0].tolist())
        self.is_target_visible |= self._target in visible
        visible &= self._movable
        self._seen.update(index for index in visible - self._seen if self._is_near(index, frame.pose))
        for moved in self._moved:
            if moved.seen_round is None and moved.index in visible and self._is_near(moved.index, frame.pose):
                moved.seen_round = self._round
        for stale in self._stale:
            if stale.evident_round is None and shows_place(frame, stale.belief):
                stale.evident_round = self._round

    def _is_near(self, index: int, camera: Pose) -> bool:
        return is_near(self._objects[index].centre_m, camera)

    @property
    def wants_entries(self) -> bool:
        """True while an observed change is not yet reflected in the agent's memory."""
        return any(one.evident_round is not None and one.cleared_round is None for one in self._stale) or any(
            one.seen_round is not None and one.found_round is None for one in self._moved
        )

    def take_entries(self, beliefs: Sequence[EntryBelief]) -> None:
        """Judge the agent's entries after a round's views."""
        by_label: defaultdict[str, list[EntryBelief]] = defaultdict(list)
        for belief in beliefs:
            by_label[belief.label].append(belief)
        for stale in self._stale:
            is_open = stale.evident_round is not None and stale.cleared_round is None
            if is_open and not self._remains(stale, by_label[stale.belief.label]):
                stale.cleared_round = self._round
        for moved in self._moved:
            if moved.seen_round is not None and moved.found_round is None:
                alike = matched_objects(by_label[moved.body.category], self.bodies)
                if any(body is not None and body.id == moved.body.id for body in alike):
                    moved.found_round = self._round

    def end(self, beliefs: Sequence[EntryBelief]) -> tuple[MemoryRecord, int]:
        """Judge the agent's entries at the end, and count the objects that were forgotten though they did not move."""
        beliefs = movable(beliefs)
        matches = matched_objects(beliefs, self.bodies)
        self.close(beliefs)
        forgotten = self._matched_before - {body.id for body in matches if body is not None}
        return self._memory(beliefs, matches), len(forgotten)

    def close(self, beliefs: Sequence[EntryBelief]) -> None:
        """Write the state that the next stage needs to `so_far`."""
        self._store_seen()
        self._so_far.beliefs = movable(beliefs)

    def _store_seen(self) -> None:
        self._so_far.seen_ids.update(self._objects[index].id for index in self._seen)

    def stale_entries(self) -> tuple[StaleEntryRecord, ...]:
        """Return the entries that were stale at the start."""
        return tuple(
            StaleEntryRecord(
                label=one.belief.label,
                centre_m=one.belief.centre_m,
                evident_round=one.evident_round,
                cleared_round=one.cleared_round,
            )
            for one in self._stale
        )

    def moved_objects(self) -> tuple[MovedObjectRecord, ...]:
        """Return the objects that left their old places in the transition."""
        return tuple(
            MovedObjectRecord(object_id=one.body.id, seen_round=one.seen_round, found_round=one.found_round)
            for one in self._moved
        )

    def _remains(self, stale: _StaleEntry, alike: Sequence[EntryBelief]) -> bool:
        """Return whether an entry is still where it was, among those of its label, and still stale; ids may change."""
        centre_m = stale.belief.centre_m
        near = [belief for belief in alike if math.dist(belief.centre_m, centre_m) <= STALE_MARGIN_M]
        return any(body is None for body in matched_objects(near, self.bodies))

    def _memory(self, beliefs: Sequence[EntryBelief], matches: Sequence[SceneObject | None]) -> MemoryRecord:
        ids = {body.id for body in matches if body is not None}
        seen = [self._objects[index].id for index in self._seen]
        errors_m = [
            math.dist(belief.centre_m, body.centre_m)
            for belief, body in zip(beliefs, matches, strict=True)
            if body is not None
        ]
        return MemoryRecord(
            num_entries=len(beliefs),
            num_right=len(errors_m),
            num_held=len(ids),
            num_seen=len(seen),
            num_seen_held=sum(object_id in ids for object_id in seen),
            position_error_m=math.fsum(errors_m) / len(errors_m) if errors_m else None,
        )
