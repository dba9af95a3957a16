"""What the evaluator alone sees while an agent acts: what was in view, where memory and world part, and since when.

An entry is *right* if an object of its label stands within `STALE_MARGIN_M` of its centre, else *stale*. An object is
*seen* if `min_visible_px` of it are in a view taken at most `EVIDENCE_RANGE_M` from it, as far as the paper's object
memory takes detections; what an agent could not have known is not held against it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.agents.agent import EntryBelief
from evonav.evaluation.records.convert import STALE_MARGIN_M, distance_to_box_m
from evonav.evaluation.records.schema import MemoryRecord, MovedObjectRecord, Relocation, StaleEntryRecord
from evonav.world.simulator import Frame, SceneObject

EVIDENCE_RANGE_M = 3.5
"""On the ground plane, from the camera to the middle of an object or of an entry."""
SURFACE_SLACK_M = 0.05


@dataclass(slots=True)
class _Stale:
    belief: EntryBelief
    evident_round: int | None = None
    cleared_round: int | None = None


@dataclass(slots=True)
class _Moved:
    body: SceneObject
    index: int
    seen_round: int | None = None
    found_round: int | None = None


@dataclass(slots=True)
class TrackedState:
    """What lasts from stage to stage of an episode."""

    seen_ids: set[str] = field(default_factory=set)
    """Objects seen so far."""
    beliefs: Sequence[EntryBelief] = ()
    """The agent's, at the end of the last stage."""


class StalenessTracker:
    """Of one stage."""

    def __init__(
        self,
        objects: Sequence[SceneObject],
        target_id: str,
        relocations: Sequence[Relocation],
        so_far: TrackedState,
        min_visible_px: int,
    ) -> None:
        """A witness who has seen nothing of the stage yet.

        Args:
            objects: The simulator's bodies, in instance order.
            target_id: Of the stage.
            relocations: Of the transition before it.
            so_far: Of the episode; objects that come into view are added.
            min_visible_px: Pixels from which on an object counts as in view.
        """
        self._objects = objects
        self._so_far = so_far
        self._min_visible_px = min_visible_px
        self.bodies: dict[str, list[SceneObject]] = {}
        """By category."""
        for body in objects:
            self.bodies.setdefault(body.category, []).append(body)
        index_of = {body.id: index for index, body in enumerate(objects)}
        self._target = index_of.get(target_id)
        self._is_object = np.array([body.kind == "object" for body in objects], dtype=np.bool_)
        self._ground_m = np.array([(body.centre_m[0], body.centre_m[2]) for body in objects]).reshape(-1, 2)
        self._is_seen = np.array([body.id in so_far.seen_ids for body in objects], dtype=np.bool_)
        self._moved = [
            _Moved(objects[index], index)
            for moved in relocations
            if (index := index_of.get(moved.object_id)) is not None
            and distance_to_box_m(moved.from_m, objects[index]) > STALE_MARGIN_M
        ]
        self._stale: list[_Stale] = []
        self._held_before: set[str] = set()
        self._round = 0
        self.is_target_visible = False
        """In a view of this round, from however far."""

    @property
    def is_target_seen(self) -> bool:
        """Now or earlier in the episode, wherever it stood then."""
        return self._target is not None and bool(self._is_seen[self._target])

    def target_box_distance_m(self, point_m: tuple[float, float]) -> float | None:
        """From a point to the target's box, on the ground plane; 0 over it, `None` without a target in the house."""
        if self._target is None:
            return None
        body = self._objects[self._target]
        (x_m, _, z_m), (width_m, _, depth_m) = body.centre_m, body.size_m
        gap_x_m, gap_z_m = abs(point_m[0] - x_m) - width_m / 2, abs(point_m[1] - z_m) - depth_m / 2
        return math.hypot(max(0.0, gap_x_m), max(0.0, gap_z_m))

    def begin(self, beliefs: Sequence[EntryBelief]) -> MemoryRecord:
        """Takes what the agent holds as the stage begins."""
        held = held_by(beliefs, self.bodies)
        carried = self._so_far.beliefs
        carried_held = held if list(carried) == list(beliefs) else held_by(carried, self.bodies)
        self._held_before = {body.id for body in carried_held if body is not None}
        self._stale = [_Stale(belief) for belief, body in zip(beliefs, held, strict=True) if body is None]
        return self._memory(beliefs, held)

    def stale_ids(self, beliefs: Sequence[EntryBelief]) -> list[int]:
        """Entries that no object stands for."""
        held = held_by(beliefs, self.bodies)
        return [belief.entry_id for belief, body in zip(beliefs, held, strict=True) if body is None]

    def begin_round(self, number: int) -> None:
        """Another round, whose views come next."""
        self._round = number
        self.is_target_visible = False

    def look(self, frame: Frame) -> None:
        """Takes a view as the simulator rendered it, instances and all."""
        if frame.instances is None:
            return
        is_visible = _core.instance_areas(frame.instances, len(self._objects)) >= self._min_visible_px
        self.is_target_visible |= self._target is not None and bool(is_visible[self._target])
        offsets_m = self._ground_m - (frame.pose.x_m, frame.pose.z_m)
        is_visible &= self._is_object & (np.hypot(offsets_m[:, 0], offsets_m[:, 1]) <= EVIDENCE_RANGE_M)
        self._is_seen |= is_visible
        for moved in self._moved:
            if moved.seen_round is None and is_visible[moved.index]:
                moved.seen_round = self._round
        for stale in self._stale:
            if stale.evident_round is None and shows_place(frame, stale.belief):
                stale.evident_round = self._round

    @property
    def wants_entries(self) -> bool:
        """Whether something has come to light that the agent's entries may not show yet."""
        return any(one.evident_round is not None and one.cleared_round is None for one in self._stale) or any(
            one.seen_round is not None and one.found_round is None for one in self._moved
        )

    def take_entries(self, beliefs: Sequence[EntryBelief]) -> None:
        """What the agent holds after a round's views."""
        for stale in self._stale:
            if stale.evident_round is not None and stale.cleared_round is None and not self._is_kept(stale, beliefs):
                stale.cleared_round = self._round
        for moved in self._moved:
            if moved.seen_round is not None and moved.found_round is None:
                alike = [belief for belief in beliefs if belief.label == moved.body.category]
                if any(body is not None and body.id == moved.body.id for body in held_by(alike, self.bodies)):
                    moved.found_round = self._round

    def end(self, beliefs: Sequence[EntryBelief]) -> tuple[MemoryRecord, int]:
        """The memory at the end, and how many objects were forgotten that stand where they stood."""
        held = held_by(beliefs, self.bodies)
        self.close(beliefs)
        return self._memory(beliefs, held), len(self._held_before - {body.id for body in held if body is not None})

    def close(self, beliefs: Sequence[EntryBelief]) -> None:
        """Hands on to the next stage what lasts."""
        self._so_far.seen_ids.update(
            body.id for body, is_seen in zip(self._objects, self._is_seen.tolist(), strict=True) if is_seen
        )
        self._so_far.beliefs = beliefs

    def stale_entries(self) -> tuple[StaleEntryRecord, ...]:
        """Entries that were stale at the start."""
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
        """Objects that left their old places in the transition."""
        return tuple(
            MovedObjectRecord(object_id=one.body.id, seen_round=one.seen_round, found_round=one.found_round)
            for one in self._moved
        )

    def _is_kept(self, stale: _Stale, beliefs: Sequence[EntryBelief]) -> bool:
        """Whether an entry is still where it was, and still wrong; its number may be another."""
        old = stale.belief
        near = [
            belief
            for belief in beliefs
            if belief.label == old.label and math.dist(belief.centre_m, old.centre_m) <= STALE_MARGIN_M
        ]
        return any(body is None for body in held_by(near, self.bodies))

    def _memory(self, beliefs: Sequence[EntryBelief], held: Sequence[SceneObject | None]) -> MemoryRecord:
        ids = {body.id for body in held if body is not None}
        seen = [body.id for body, is_seen in zip(self._objects, self._is_seen.tolist(), strict=True) if is_seen]
        errors_m = [
            math.dist(belief.centre_m, body.centre_m)
            for belief, body in zip(beliefs, held, strict=True)
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


def held_by(beliefs: Sequence[EntryBelief], bodies: Mapping[str, Sequence[SceneObject]]) -> list[SceneObject | None]:
    """The object that each entry stands for; `None` for a stale one.

    Args:
        beliefs: Entries.
        bodies: Of the stage's house, by category.

    Returns:
        Of the objects of an entry's label, the one whose box is nearest to its centre (of several, the one whose middle
        is), if that is within `STALE_MARGIN_M`.
    """
    held: list[SceneObject | None] = []
    for belief in beliefs:
        nearest, least = None, (STALE_MARGIN_M, math.inf)
        for body in bodies.get(belief.label, ()):
            distance_m = distance_to_box_m(belief.centre_m, body)
            if distance_m <= least[0]:
                rank = (distance_m, math.dist(belief.centre_m, body.centre_m))
                if rank < least or nearest is None:
                    nearest, least = body, rank
        held.append(nearest)
    return held


def shows_place(frame: Frame, belief: EntryBelief) -> bool:
    """Whether a view shows the middle of an entry's place: in the image, near enough, and nothing in front of it.

    Args:
        frame: With depth.
        belief: An entry; what stands in its own box does not hide it.
    """
    pose, intrinsics = frame.pose, frame.intrinsics
    x_m, y_m, z_m = (a - b for a, b in zip(belief.centre_m, pose.position_m, strict=True))
    if math.hypot(x_m, z_m) > EVIDENCE_RANGE_M:
        return False
    sin, cos = math.sin(pose.yaw_rad), math.cos(pose.yaw_rad)
    ahead_m, right_m = x_m * sin + z_m * cos, x_m * cos - z_m * sin
    down, level = math.sin(pose.horizon_rad), math.cos(pose.horizon_rad)
    depth_m = ahead_m * level - y_m * down
    if depth_m <= 0.0:
        return False
    below_m = -ahead_m * down - y_m * level
    scale = intrinsics.focal_px / depth_m
    col, row = intrinsics.width_px / 2.0 + right_m * scale, intrinsics.height_px / 2.0 + below_m * scale
    if not (0.0 <= col < intrinsics.width_px and 0.0 <= row < intrinsics.height_px):
        return False
    reach_m = max(belief.size_m) / 2.0 + SURFACE_SLACK_M
    surface_m: NDArray[np.float32] = frame.depth_m
    return float(surface_m[int(row), int(col)]) >= depth_m - reach_m
