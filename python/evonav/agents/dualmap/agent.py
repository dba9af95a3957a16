"""DualMap (Jiang et al., 2025): a local map of what is near, and an abstract map of furniture with what lay on it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evonav.agents.agent import AgentAction, EntryBelief
from evonav.agents.dualmap.anchors import AbstractMap, AnchorConfig, Content, FurnitureAnchor
from evonav.agents.explorer import AS_THREE_D_MEM_PLUS
from evonav.agents.frontier_update.agent import FrontierUpdate, FrontierUpdateConfig
from evonav.agents.navigator import Navigator, NavigatorConfig
from evonav.agents.relatedness import Relatedness
from evonav.decision.candidates import ObjectCandidate
from evonav.decision.home_statistics import is_furniture
from evonav.decision.question import DecisionModel
from evonav.memory.objects import ObjectEntry
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal


@dataclass(frozen=True, slots=True)
class DualMapConfig(FrontierUpdateConfig):
    """DualMap's constants; a keyframe is a view here, and there are fewer of them."""

    navigator: NavigatorConfig = field(default_factory=lambda: NavigatorConfig(explorer=AS_THREE_D_MEM_PLUS))
    anchors: AnchorConfig = field(default_factory=AnchorConfig)
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


class DualMap(FrontierUpdate):
    """Goes to the furniture where something like the goal is or was, and looks there again."""

    def __init__(self, config: DualMapConfig | None = None, decision: DecisionModel | None = None) -> None:
        self._own = config or DualMapConfig()
        super().__init__(self._own, decision)

    def _new_navigator(self) -> Navigator:
        self._abstract = AbstractMap(self._own.anchors)
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
        feature = observation.goal_feature if self._goal_input != "image" else None
        self._related = Relatedness(self._matcher, self._matcher.parsed(self._goal), feature)
        return super().act(observation)

    def _after_look(self, observation: Observation) -> None:
        navigator, limit = self._navigator, self._own.window + self._own.max_pending
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
        return entry.num_detections >= self._own.min_sightings and share > self._own.min_label_share

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
        least = self._best_of(first)[0] - self._own.margin
        return [one for one in open_ if self._best_of(one)[0] >= least] or [
            one for one in open_ if one.label == first.label
        ]

    def _stops_at_sight_of_place(self) -> bool:
        return False

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
        least = self._best_of(anchor)[0] - self._own.margin
        half_m = np.array(anchor.size_m) / 2 * (1.0 + self._own.box_growth)
        half_m[1] += self._own.anchors.above_m  # what lies on it reaches beyond its top
        found = [
            (self._related.of(entry.label, entry.feature), entry)
            for entry in self._navigator.objects.entries
            if entry.num_detections >= self._own.min_seen
            and (np.abs(np.array(entry.centre_m) - anchor.centre_m) <= half_m).all()
        ]
        best = max(found, key=lambda one: (one[0], -one[1].id), default=None)
        return best[1] if best is not None and best[0] >= least else None

    def _entry_beliefs(self) -> Sequence[EntryBelief]:
        """Return the local map, then the anchors that it does not have."""
        local = list(super()._entry_beliefs())
        known = {one.entry_id for one in local}
        anchors = [one.candidate() for key, one in self._abstract.anchors.items() if key not in known]
        return [*local, *(_belief(one) for one in anchors)]

    def _round_counters(self) -> Mapping[str, int]:
        return {"anchors_visited": 0, "anchors_failed": 0, **super()._round_counters()}

    def _round_details(self, reason: str) -> Mapping[str, Any]:
        return {
            **super()._round_details(reason),
            "num_anchors": len(self._abstract.anchors),
            **({"failed_anchors": list(self._failed)} if self._failed else {}),
        }


def _belief(one: ObjectCandidate) -> EntryBelief:
    return EntryBelief(one.entry_id, one.label, one.centre_m, one.size_m, one.num_detections)
