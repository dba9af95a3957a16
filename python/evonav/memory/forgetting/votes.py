"""Forgetting by votes over several looks."""

from collections import deque
from dataclasses import dataclass, field
from typing import ClassVar

from evonav.memory.forgetting.rule import EntryStates, ForgettingRule, Look, expected_px, look_at_places, remove_all
from evonav.memory.objects import ObjectMap, ObjectUpdate
from evonav.memory.presence import EvidenceConfig
from evonav.sensors.observation import View


@dataclass(slots=True)
class RayVotes(ForgettingRule):
    """Forget an entry when most rays of several looks pass through its surface: Khronos (Schmid et al., RSS 2024).

    A point of the surface gets a vote *present* from a ray that ends within a tolerance of its depth, a vote *absent*
    from a ray that passes through it, and none from a ray that ends before it. Votes are counted in bins of time, and
    a window slides over the bins: an object changed where the absent share of a window exceeds 0.6. Khronos' bins have
    5 s and its window 5 bins; here a bin is a view that votes, so that it means the same at any frame rate. Khronos
    reads all rays after the fact, in both directions of time; here windows end at the present view, which
    must itself show more empty space than surface, and have `min_looks` views at least, so that one look never decides.
    """

    name: ClassVar[str] = "ray-votes"
    window: int = 5
    """Largest number of views in a window (Khronos' `window_size`)."""
    min_looks: int = 3
    """Smallest number of views in a window; ours."""
    max_absent_share: float = 0.6
    """An entry is forgotten if more of a window's votes are for its absence (Khronos' `absence_confidence`)."""
    min_votes: int = 16
    """A view votes if it shows at least this many of the compared points; as `PresenceConfig.min_points`."""
    evidence: EvidenceConfig = field(default_factory=lambda: EvidenceConfig(band_share=0.0))
    """Parameters of the comparison of points with depth; the tolerance of 0.1 m is Khronos' default."""
    _votes: EntryStates[deque[tuple[int, int]]] = field(init=False, repr=False, default_factory=EntryStates)
    """The last views' numbers of votes for presence and for absence."""

    def after_update(self, map_: ObjectMap, view: View, update: ObjectUpdate, time_s: float) -> tuple[int, ...]:
        """Count this view's votes; forget the entries that are voted absent."""
        self._votes.follow(update)
        gone = []
        for look in look_at_places(map_, view, update, self.evidence):
            evidence = look.evidence
            if evidence.num_not_hidden < self.min_votes:
                continue
            votes = self._votes.setdefault(look.entry_id, deque(maxlen=self.window))
            votes.append((evidence.num_supported, evidence.num_see_through))
            is_empty = evidence.num_see_through > evidence.num_supported and not look.is_detected
            if is_empty and self._is_voted_absent(votes):
                gone.append(look.entry_id)
                del self._votes[look.entry_id]
        return remove_all(map_, gone)

    def _is_voted_absent(self, votes: deque[tuple[int, int]]) -> bool:
        present = absent = 0
        for num, (for_presence, for_absence) in enumerate(reversed(votes), start=1):
            present, absent = present + for_presence, absent + for_absence
            if num >= self.min_looks and absent > self.max_absent_share * (present + absent):
                return True
        return False


@dataclass(slots=True)
class StatusWindow(ForgettingRule):
    """Forget an entry that was expected in a whole window of views, and in some more, but never detected.

    DualMap (Jiang et al., 2025): an object of the local map is *updating* while it was detected within the last 10
    keyframes; after that it is *pending* and is dropped after 5 more keyframes. DualMap counts all keyframes, since
    its local map is only what surrounds the robot; this rule counts the views that show the place of the entry, of
    which a detection is expected.

    DualMap itself forgets more: each high-mobility object that is stable and out of the window leaves the local map,
    moved or not, also where nothing changes. Its low-mobility objects move to an abstract map and stay forever; name
    their labels in `anchors` for this.
    """

    name: ClassVar[str] = "status-window"
    window: int = 10
    """Number of expected views after a detection in which the entry is *updating* (DualMap)."""
    max_pending: int = 5
    """Number of further expected views without a detection until the entry is dropped (DualMap)."""
    min_detections: int = 8
    """An anchor stays once it has this many detections, as *stable* objects of DualMap do."""
    anchors: tuple[str, ...] = ()
    """Labels of objects that hardly move."""
    min_points: int = 16
    """A view is expected to detect an entry if it shows at least this many of the compared points; ours."""
    min_shown: float = 0.5
    """It must also show at least this share of the points that are in view or hidden; ours."""
    min_px: float = 64.0
    """The object would also have to cover about this many pixels; ours."""
    evidence: EvidenceConfig = field(default_factory=EvidenceConfig)
    """Parameters of the comparison of points with depth."""
    _num_missed: EntryStates[int] = field(init=False, repr=False, default_factory=EntryStates)
    """Expected views since the last detection."""

    def after_update(self, map_: ObjectMap, view: View, update: ObjectUpdate, time_s: float) -> tuple[int, ...]:
        """Count the missing detections of this view; forget the entries that have been pending for long."""
        self._num_missed.follow(update)
        gone = []
        for look in look_at_places(map_, view, update, self.evidence):
            if look.is_detected:
                self._num_missed[look.entry_id] = 0
            elif self._is_expected(map_, look, view):
                missed = self._num_missed[look.entry_id] = self._num_missed.get(look.entry_id, 0) + 1
                if missed >= self.window + self.max_pending and not self._is_anchor(map_, look.entry_id):
                    gone.append(look.entry_id)
                    del self._num_missed[look.entry_id]
        return remove_all(map_, gone)

    def _is_expected(self, map_: ObjectMap, look: Look, view: View) -> bool:
        is_clear = look.is_clear(self.min_points, self.min_shown)
        return is_clear and expected_px(map_, look.entry_id, view) >= self.min_px

    def _is_anchor(self, map_: ObjectMap, entry_id: int) -> bool:
        entry = map_.entry(entry_id) if self.anchors else None
        return entry is not None and entry.label in self.anchors and entry.num_detections >= self.min_detections
