"""Measure the memory of objects that a perception makes: the paper's object map after a tour, against the house.

What an entry was made of is counted from its detections' pixels, which only the evaluator can see through to objects:
so an entry in the wrong place, or with the wrong label, still has the object that it came from.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from evonav.agents.agent import EntryBelief
from evonav.evaluation.episode.staleness import EVIDENCE_RANGE_M, matched_objects
from evonav.memory.objects import ObjectMap
from evonav.perception import Percept
from evonav.perception_benchmark.matching import NONE, TrueObjects, main_objects
from evonav.perception_benchmark.records import MemoryState
from evonav.sensors.observation import View, VisibleOccupancy
from evonav.world.simulator import Frame, SceneObject

_NO_CELLS = np.zeros((0, 2), np.int32)


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
            self._right_before = {belief.entry_id for belief in self._right()}
        self._objects, self._stage, self._num_views, self._seen = objects, stage, 0, set()
        self._categories.update({body.id: body.category for body in objects})
        self.map.begin_stage(stage)

    def look(self, frame: Frame, percept: Percept, truth: TrueObjects) -> None:
        """Add a view to the memory."""
        view = View(
            pose=percept.pose,
            intrinsics=frame.intrinsics,
            depth_m=percept.depth_m,
            detections=percept.detections,
            occupancy=VisibleOccupancy(_NO_CELLS, _NO_CELLS),
        )
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
        beliefs = self._beliefs()
        right = self._right()
        remembered = {body.id for body in matched_objects(right, self._bodies()) if body is not None}
        sources = {belief.entry_id: self._source(belief.entry_id) for belief in beliefs}
        there = {body.id: body for body in self._objects}
        named = [name for name in sources.values() if name]
        errors_m = [
            math.dist(belief.centre_m, there[name].centre_m)
            for belief in beliefs
            if (name := sources[belief.entry_id]) in there and there[name].category == belief.label
        ]
        rights = {belief.entry_id for belief in right}
        entry_ids = {belief.entry_id for belief in beliefs}
        return MemoryState(
            stage=self._stage,
            num_views=self._num_views,
            share=share,
            num_entries=len(beliefs),
            num_right=len(right),
            num_wrong_label=sum(
                bool(name) and self._categories[name] != belief.label
                for belief in beliefs
                for name in (sources[belief.entry_id],)
            ),
            num_phantoms=sum(not name for name in sources.values()),
            num_objects=len(set(named)),
            num_surplus=len(named) - len(set(named)),
            num_seen=len(self._seen),
            num_seen_held=len(self._seen & remembered),
            num_stale=len((self._right_before & entry_ids) - rights),
            error_m=math.fsum(errors_m),
            num_error=len(errors_m),
        )

    def _source(self, entry_id: int) -> str:
        """Id of the object that most detections of an entry are of, the first of equals; "" for none."""
        votes = self._votes.get(entry_id)
        return votes.most_common(1)[0][0] if votes else ""

    def _bodies(self) -> dict[str, list[SceneObject]]:
        bodies: dict[str, list[SceneObject]] = {}
        for body in self._objects:
            bodies.setdefault(body.category, []).append(body)
        return bodies

    def _beliefs(self) -> list[EntryBelief]:
        return [
            EntryBelief(entry.id, entry.label, entry.centre_m, entry.size_m, entry.num_detections)
            for entry in self.map.entries
        ]

    def _right(self) -> list[EntryBelief]:
        """Return the entries that have an object of their label in their place."""
        beliefs = self._beliefs()
        matched = matched_objects(beliefs, self._bodies())
        return [belief for belief, body in zip(beliefs, matched, strict=True) if body is not None]
