"""DualMap (Jiang et al., 2025): a local map of what is near, and an abstract map of furniture with what lay on it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from evonav.agents.agent import AgentAction, EntryBelief
from evonav.agents.frontier_update.agent import FrontierUpdate, FrontierUpdateConfig
from evonav.agents.navigator import WITH_FALLBACK, Navigator, NavigatorConfig
from evonav.agents.rivals.relatedness import Feature, Relatedness
from evonav.decision.candidates import ObjectCandidate
from evonav.decision.home_statistics import is_furniture
from evonav.memory.objects import ObjectEntry
from evonav.points import Point3
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal

CONTENT_M = 0.1
"""Edge of the cube by which contents are described: their places are not remembered."""


@dataclass(frozen=True, slots=True)
class DualMapConfig(FrontierUpdateConfig):
    """DualMap's constants; a keyframe is a view here, and there are fewer of them."""

    navigator: NavigatorConfig = WITH_FALLBACK
    min_overlap: float = 0.8
    """Two anchors are the same if their footprints share this part of either one."""
    min_on: float = 0.8
    """A thing lies on another if this share of its footprint is over it..."""
    below_m: float = 0.1
    """...and the other's main plane is at most this far below its bottom..."""
    above_m: float = 0.2
    """...and at most this far above it."""
    plane_bin_m: float = 0.02
    """Height of the bins of which the fullest one is the main plane."""
    window: int = 10
    """Number of views after a detection in which an object is *updating*."""
    max_pending: int = 5
    """Number of further views after which it leaves the local map."""
    min_sightings: int = 3
    """Number of detections of a *stable* object; 8 in DualMap, which has ten keyframes a metre: three are here."""
    min_label_share: float = 1 / 3
    """Share of a stable object's detections that must agree on its label."""
    min_seen: int = 3
    """Number of detections of an object that is accepted at an anchor."""
    box_growth: float = 0.1
    """Share by which the box of an anchor is grown when objects in it are looked for."""
    margin: float = 0.1
    """An object is accepted if its score is at most this far below the anchor's; so is a next anchor."""


@dataclass(frozen=True, slots=True)
class Content:
    """A thing that lay on an anchor, as the anchor remembers it."""

    entry_id: int
    """Id of the entry that it was."""
    label: str
    feature: Feature | None


@dataclass(frozen=True, slots=True)
class FurnitureAnchor:
    """A piece of furniture that stays in memory."""

    entry_id: int
    """Id of the entry that it was first."""
    label: str
    feature: Feature | None
    centre_m: Point3
    size_m: Point3
    plane_m: float
    """Height of its main plane."""
    contents: tuple[Content, ...] = ()

    def candidate(self, content: Content | None = None) -> ObjectCandidate:
        """Return the anchor, or one of its contents on the middle of it, as questions describe them."""
        if content is None:
            return ObjectCandidate(self.entry_id, self.label, self.centre_m, self.size_m, 1)
        centre_m = (self.centre_m[0], self.plane_m + CONTENT_M / 2, self.centre_m[2])
        return ObjectCandidate(content.entry_id, content.label, centre_m, (CONTENT_M,) * 3, 1)


class AbstractMap:
    """All anchors. None is ever removed, and no content either."""

    def __init__(self, config: DualMapConfig) -> None:
        self.config = config
        self.anchors: dict[int, FurnitureAnchor] = {}
        """Anchors by id."""

    def add(self, entry: ObjectEntry, points_m: NDArray[np.float32]) -> None:
        """Add an entry of a piece of furniture, with its `(N, 3)` points, as an anchor without contents.

        If it overlaps an anchor of the same label, it is that one, which keeps its contents.
        """
        same = (one for one in self.anchors.values() if one.label == entry.label and self._overlaps(one, entry))
        known = next(same, None)
        plane_m = main_plane_m(points_m, self.config.plane_bin_m)
        anchor = FurnitureAnchor(entry.id, entry.label, entry.feature, entry.centre_m, entry.size_m, plane_m)
        if known is not None:
            anchor = replace(anchor, entry_id=known.entry_id, contents=known.contents)
        self.anchors[anchor.entry_id] = anchor

    def put(self, entry: ObjectEntry) -> bool:
        """Add an entry to the contents of the anchors that it lies on; return whether there is one."""
        below = [one for one in self.anchors.values() if self.lies_on(entry, one)]
        for anchor in below:  # a content with the same label gives way
            others = tuple(one for one in anchor.contents if one.label != entry.label)
            contents = (*others, Content(entry.id, entry.label, entry.feature))
            self.anchors[anchor.entry_id] = replace(anchor, contents=contents)
        return bool(below)

    def lies_on(self, upper: ObjectEntry, lower: FurnitureAnchor) -> bool:
        """Return whether an entry lies on an anchor, by their boxes and its main plane."""
        config, bottom_m = self.config, upper.centre_m[1] - upper.size_m[1] / 2
        is_level = bottom_m - config.below_m <= lower.plane_m <= bottom_m + config.above_m
        return is_level and _shared_m2(upper, lower) >= config.min_on * _footprint_m2(upper)

    def _overlaps(self, anchor: FurnitureAnchor, entry: ObjectEntry) -> bool:
        smaller_m2 = min(_footprint_m2(anchor), _footprint_m2(entry))
        return _shared_m2(anchor, entry) > self.config.min_overlap * smaller_m2


def main_plane_m(points_m: NDArray[np.float32], bin_m: float) -> float:
    """Return the height at which most of `(N, 3)` points lie, of equals the lowest: the middle of that bin."""
    bins = np.floor(points_m[:, 1].astype(np.float64) / bin_m).astype(np.int64)
    levels, counts = np.unique(bins, return_counts=True)
    return (float(levels[counts.argmax()]) + 0.5) * bin_m


def _footprint_m2(one: ObjectEntry | FurnitureAnchor) -> float:
    return one.size_m[0] * one.size_m[2]


def _shared_m2(one: ObjectEntry | FurnitureAnchor, other: ObjectEntry | FurnitureAnchor) -> float:
    """Return the area that two boxes share on the ground plane."""
    sides_m = []
    for axis in (0, 2):
        low_m = max(thing.centre_m[axis] - thing.size_m[axis] / 2 for thing in (one, other))
        high_m = min(thing.centre_m[axis] + thing.size_m[axis] / 2 for thing in (one, other))
        sides_m.append(max(0.0, high_m - low_m))
    return sides_m[0] * sides_m[1]


class DualMap(FrontierUpdate):
    """Goes to the furniture where something like the goal is or was, and looks there again."""

    config: DualMapConfig = DualMapConfig()
    _counted: ClassVar[tuple[str, ...]] = (*FrontierUpdate._counted, "anchors_visited", "anchors_failed")
    _stops_at_sight_of_place = False

    def _new_navigator(self) -> Navigator:
        self._abstract = AbstractMap(self.config)
        self._places: dict[int, FurnitureAnchor] = {}
        """The anchor of each candidate that the last question offered for one."""
        return super()._new_navigator()

    def begin_stage(self, goal: Goal) -> None:
        """Take a new goal: the local map begins again, and stable furniture is in the abstract one."""
        self._leave(self._navigator.objects.entries)
        super().begin_stage(goal)
        self._failed: list[int] = []
        """Anchors of this stage at which nothing was accepted, in order."""

    def act(self, observation: Observation) -> AgentAction:
        """Look, and go to a local object, to an anchor or to a frontier."""
        self._related = Relatedness(self._matcher, self._matcher.parsed(self._goal), self._goal_feature(observation))
        return super().act(observation)

    def _after_look(self, observation: Observation) -> None:
        navigator, limit = self._navigator, self.config.window + self.config.max_pending
        objects = navigator.objects
        target_id = None if navigator.target is None else navigator.target.entry_id
        old = [one for one in objects.entries if objects.num_views - one.last_seen_view >= limit]
        self._leave([one for one in old if one.id != target_id])

    def _leave(self, entries: Sequence[ObjectEntry]) -> None:
        """Take entries out of the local map: stable furniture, and what lies on it, goes into the abstract map."""
        objects, abstract = self._navigator.objects, self._abstract
        stable = [one for one in entries if self._is_stable(one)]
        for entry in stable:
            points_m = objects.points_m(entry.id)
            if is_furniture(entry.label) and points_m is not None and len(points_m):
                abstract.add(entry, points_m)
        for entry in objects.entries:
            if self._is_stable(entry) and not is_furniture(entry.label):
                abstract.put(entry)
        for entry in entries:
            objects.remove(entry.id)

    def _is_stable(self, entry: ObjectEntry) -> bool:
        share = max(count for _, count in entry.label_counts) / entry.num_detections
        return entry.num_detections >= self.config.min_sightings and share > self.config.min_label_share

    def _decide(self, observation: Observation) -> AgentAction:
        """Ask about the local objects, the anchors and their contents that have most to do with the goal."""
        objects = self._navigator.objects.entries
        local = [self._navigator.candidate(entry) for entry in objects]
        scored = [
            (self._related.of(entry.label, entry.feature), candidate)
            for entry, candidate in zip(objects, local, strict=True)
            if self._is_offered(entry)
        ]
        self._places = {}
        for anchor in self._open_anchors():
            score, content = self._best_of(anchor)
            candidate = anchor.candidate(content)
            self._places[candidate.entry_id] = anchor
            scored.append((score, candidate))
        ranked = sorted(scored, key=lambda one: (-one[0], -one[1].num_detections, one[1].entry_id))
        remembered = [*local, *(anchor.candidate() for anchor in self._abstract.anchors.values())]
        return self._choose([candidate for _, candidate in ranked], remembered, observation)

    def _best_of(self, anchor: FurnitureAnchor) -> tuple[float, Content | None]:
        """Return an anchor's score, and the content that has it; `None` if it has it itself."""
        own = self._related.of(anchor.label, anchor.feature)
        scores = [(self._related.of(one.label, one.feature), one) for one in anchor.contents]
        best = max(scores, key=lambda one: one[0], default=None)
        return best if best is not None and best[0] > own else (own, None)

    def _open_anchors(self) -> list[FurnitureAnchor]:
        """Return the anchors that may be gone to: after a failure those that are about as good as the first.

        If none of them is left, the others of the first anchor's label are.
        """
        anchors = self._abstract.anchors
        open_ = [anchor for one, anchor in anchors.items() if one not in self._failed]
        if not self._failed:
            return open_
        first = anchors[self._failed[0]]
        least = self._best_of(first)[0] - self.config.margin
        return [one for one in open_ if self._best_of(one)[0] >= least] or [
            one for one in open_ if one.label == first.label
        ]

    def _act_at_place(self, entry_id: int, observation: Observation) -> AgentAction | None:
        """Stop at a local object; at an anchor, go to an object on it that is as good, or ignore the anchor."""
        anchor = self._places.get(entry_id)
        if anchor is None:
            return None if self._navigator.objects.entry(entry_id) is None else self._stop("at its place", entry_id)
        self._counters["anchors_visited"] += 1
        found = self._accepted(anchor)
        if found is None:
            self._counters["anchors_failed"] += 1
            self._failed.append(anchor.entry_id)
            return None
        self._places = {}
        return self._go_to_object(self._navigator.candidate(found), (observation.pose.x_m, observation.pose.z_m))

    def _accepted(self, anchor: FurnitureAnchor) -> ObjectEntry | None:
        """Return the best local object in an anchor's box; `None` if none is about as good as the anchor."""
        least = self._best_of(anchor)[0] - self.config.margin
        half_m = np.array(anchor.size_m) / 2 * (1.0 + self.config.box_growth)
        half_m[1] += self.config.above_m  # what lies on it reaches beyond its top
        found = [
            (self._related.of(entry.label, entry.feature), entry)
            for entry in self._navigator.objects.entries
            if entry.num_detections >= self.config.min_seen
            and (np.abs(np.array(entry.centre_m) - anchor.centre_m) <= half_m).all()
        ]
        best = max(found, key=lambda one: (one[0], -one[1].id), default=None)
        return best[1] if best is not None and best[0] >= least else None

    def _entry_beliefs(self) -> Sequence[EntryBelief]:
        """Return the local map, then the anchors that it does not have."""
        local = list(super()._entry_beliefs())
        known = {one.entry_id for one in local}
        anchors = [one for key, one in self._abstract.anchors.items() if key not in known]
        return [*local, *(EntryBelief(one.entry_id, one.label, one.centre_m, one.size_m, 1) for one in anchors)]

    def _round_details(self, reason: str) -> Mapping[str, Any]:
        return {
            **super()._round_details(reason),
            "num_anchors": len(self._abstract.anchors),
            **({"failed_anchors": list(self._failed)} if self._failed else {}),
        }
