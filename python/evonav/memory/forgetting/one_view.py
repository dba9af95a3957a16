"""Rules that judge an entry by the present view alone."""

from dataclasses import dataclass, field
from typing import ClassVar

from evonav.memory.forgetting.rule import ForgettingRule, look_at_places, remove_all
from evonav.memory.objects import ObjectMap, ObjectUpdate
from evonav.memory.presence import EvidenceConfig, Presence, PresenceConfig, judge_presence
from evonav.sensors.observation import View


@dataclass(slots=True)
class Never(ForgettingRule):
    """Forget nothing: what Frontier-Update, 3D-Mem and ConceptGraphs do with their object entries."""

    name: ClassVar[str] = "never"

    def after_update(self, map_: ObjectMap, view: View, update: ObjectUpdate, time_s: float) -> tuple[int, ...]:
        """Forget nothing."""
        return ()


@dataclass(slots=True)
class Reset(ForgettingRule):
    """Forget everything at the beginning of each visit: Stage-Reset (EvoNav-Bench, Sec. C.4).

    So it forgets what has not changed, too, also in a house where nothing ever changes.
    """

    name: ClassVar[str] = "reset"

    def begin_visit(self, map_: ObjectMap, time_s: float) -> tuple[int, ...]:
        """Forget all entries; ids go on."""
        return remove_all(map_, [entry.id for entry in map_.entries])

    def after_update(self, map_: ObjectMap, view: View, update: ObjectUpdate, time_s: float) -> tuple[int, ...]:
        """Forget nothing within a visit."""
        return ()


@dataclass(slots=True)
class LastWins(ForgettingRule):
    """Forget an entry if the last view of its place shows more empty space there than surface.

    Frontier-Update (EvoNav-Bench, Sec. C.4) and 3D-Mem treat cells of their maps so: the last observation of a cell
    wins, however often it was seen otherwise, and hidden parts do not count. Their object entries stay forever. This
    rule applies to entries what they apply to cells: the points of an entry are its cells, and their majority decides.
    A detection that joins the entry is an observation of the object.
    """

    name: ClassVar[str] = "last-wins"
    min_points: int = 16
    """Smallest number of compared points that the view must show; as `PresenceConfig.min_points`."""
    min_shown: float = 0.5
    """It must also show at least this share of the points that are in view or hidden; ours."""
    evidence: EvidenceConfig = field(default_factory=EvidenceConfig)
    """Parameters of the comparison of points with depth."""

    def after_update(self, map_: ObjectMap, view: View, update: ObjectUpdate, time_s: float) -> tuple[int, ...]:
        """Forget the entries whose places are empty in this view."""
        return remove_all(
            map_,
            [
                look.entry_id
                for look in look_at_places(map_, view, update, self.evidence)
                if not look.is_detected
                and look.is_clear(self.min_points, self.min_shown)
                and look.evidence.num_see_through > look.evidence.num_supported
            ],
        )


@dataclass(slots=True)
class FailedLook(ForgettingRule):
    """Forget an entry on a look at its place that shows that the object is absent.

    Fail-then-Update (EvoNav-Bench, Sec. C.4): "checking whether the target is present upon reaching its stored location
    and revising the entry only if the target is absent". The agent looks at its target alone, on arrival; this rule
    judges every entry in view, by the same test (`judge_presence`). Where something hides the place, the entry stays.
    """

    name: ClassVar[str] = "failed-look"
    presence: PresenceConfig = field(default_factory=PresenceConfig)
    """Thresholds of the test."""
    evidence: EvidenceConfig = field(default_factory=EvidenceConfig)
    """Parameters of the comparison of points with depth."""

    def after_update(self, map_: ObjectMap, view: View, update: ObjectUpdate, time_s: float) -> tuple[int, ...]:
        """Forget the entries that this view shows to be absent."""
        found = look_at_places(map_, view, update, self.evidence)
        absent = Presence.NO
        return remove_all(
            map_,
            [
                look.entry_id
                for look in found
                if judge_presence(look.evidence, is_detected=look.is_detected, config=self.presence) is absent
            ],
        )
