"""Measure the memory of objects that a perception makes: the paper's object map after a tour, against the house.

What an entry was made of is counted from its detections' pixels, which only the evaluator can see through to objects:
so an entry in the wrong place, or with the wrong label, still has the object that it came from.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from evonav.evaluation.episode.staleness import EVIDENCE_RANGE_M, matched_object
from evonav.memory.objects import ObjectMap
from evonav.perception import Percept
from evonav.perception_benchmark.matching import NONE, TrueObjects, main_objects
from evonav.perception_benchmark.records import MemoryState
from evonav.sensors.observation import NO_OCCUPANCY, View
from evonav.world.simulator import Frame, SceneObject


@dataclass(slots=True)
class JudgedMemory:
    """An object map and what its entries were made of."""

    map: ObjectMap = field(default_factory=ObjectMap)
    _votes: dict[int, Counter[str]] = field(default_factory=dict)
    """Votes by entry: detections by the id of the object that has most of their pixels; "" for none."""
    _objects: Sequence[SceneObject] = ()
    _seen: set[str] = field(default_factory=set)
    _right_before: set[int] = field(default_factory=set)
    """Entries that were right at the end of the stage before."""
    _categories: dict[str, str] = field(default_factory=dict)
    """Categories by id, of every object of any stage so far."""
    _stage: int = 0
    _num_views: int = 0

    def begin_stage(self, stage: int, objects: Sequence[SceneObject]) -> None:
        """Begin another house, with the memory of those before; `objects` are its bodies, in instance order."""
        if self._stage:
            self._right_before = set(self._matched())
        self._objects, self._stage, self._num_views, self._seen = objects, stage, 0, set()
        self._categories.update({body.id: body.category for body in objects})
        self.map.begin_stage(stage)

    def look(self, frame: Frame, percept: Percept, truth: TrueObjects) -> None:
        """Add a view to the memory."""
        view = View(percept.pose, frame.intrinsics, percept.depth_m, percept.detections, NO_OCCUPANCY)
        sources = main_objects(truth, percept.detections).tolist()
        done = self.map.update(view)
        for entry_id, source in zip(done.entry_ids, sources, strict=True):
            if entry_id is not None:
                name = "" if source == NONE else self._objects[source].id
                self._votes.setdefault(entry_id, Counter())[name] += 1
        for gone, became in done.merged:
            self._votes.setdefault(became, Counter()).update(self._votes.pop(gone, Counter()))
        for gone in done.removed:
            self._votes.pop(gone, None)
        for index in truth.bodies[: truth.num_wanted].tolist():
            body = self._objects[index]
            if math.hypot(body.centre_m[0] - frame.pose.x_m, body.centre_m[2] - frame.pose.z_m) <= EVIDENCE_RANGE_M:
                self._seen.add(body.id)
        self._num_views += 1

    def state(self, share: float) -> MemoryState:
        """Return the state of the memory now, after a share of the stage's tour."""
        entries, matched = self.map.entries, self._matched()
        # The object that most detections of an entry are of, the first of equals; "" for none.
        votes = ((entry.id, self._votes.get(entry.id)) for entry in entries)
        sources = {entry_id: mine.most_common(1)[0][0] if mine else "" for entry_id, mine in votes}
        there = {body.id: body for body in self._objects}
        named = [name for name in sources.values() if name]
        errors_m = [
            math.dist(entry.centre_m, there[name].centre_m)
            for entry in entries
            if (name := sources[entry.id]) in there and there[name].category == entry.label
        ]
        num_wrong = sum(self._categories.get(sources[entry.id], entry.label) != entry.label for entry in entries)
        return MemoryState(
            stage=self._stage,
            num_views=self._num_views,
            share=share,
            num_entries=len(entries),
            num_right=len(matched),
            num_wrong_label=num_wrong,
            num_phantoms=sum(not name for name in sources.values()),
            num_objects=len(set(named)),
            num_surplus=len(named) - len(set(named)),
            num_seen=len(self._seen),
            num_seen_held=len(self._seen & {body.id for body in matched.values()}),
            num_stale=len((self._right_before & sources.keys()) - matched.keys()),
            error_m=math.fsum(errors_m),
            num_error=len(errors_m),
        )

    def _matched(self) -> dict[int, SceneObject]:
        """Return the object of each entry that has one of its label in its place."""
        bodies: dict[str, list[SceneObject]] = {}
        for body in self._objects:
            bodies.setdefault(body.category, []).append(body)
        found = {entry.id: matched_object(entry.label, entry.centre_m, bodies) for entry in self.map.entries}
        return {entry_id: body for entry_id, body in found.items() if body is not None}
