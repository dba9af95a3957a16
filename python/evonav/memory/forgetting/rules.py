"""The rules: some judge an entry by the present view alone, some delete points, others vote or weigh several looks."""

from collections import deque
from dataclasses import dataclass, field
from typing import ClassVar

from evonav.memory.forgetting.rule import (
    EntryStates,
    ForgettingRule,
    detected_ids,
    expected_px,
    look_at_places,
    remove_all,
)
from evonav.memory.objects import ObjectMap, ObjectUpdate, SeeThroughConfig
from evonav.memory.presence import EvidenceConfig, Presence, PresenceConfig, judge_presence
from evonav.sensors.observation import View

DAY_S = 86400.0


@dataclass(slots=True)
class Never(ForgettingRule):
    """Forget nothing: what Frontier-Update, 3D-Mem and ConceptGraphs do with their object entries."""

    name: ClassVar[str] = "never"

    def absent(self, map_: ObjectMap, view: View, update: ObjectUpdate) -> list[int]:
        """Name nothing."""
        return []


@dataclass(slots=True)
class Reset(ForgettingRule):
    """Forget everything at the beginning of each visit: Stage-Reset (EvoNav-Bench, Sec. C.4).

    So it forgets what has not changed, too, also in a house where nothing ever changes.
    """

    name: ClassVar[str] = "reset"

    def begin_visit(self, map_: ObjectMap, time_s: float) -> tuple[int, ...]:
        """Forget all entries; ids go on."""
        return remove_all(map_, [entry.id for entry in map_.entries])

    def absent(self, map_: ObjectMap, view: View, update: ObjectUpdate) -> list[int]:
        """Name nothing within a visit."""
        return []


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

    def absent(self, map_: ObjectMap, view: View, update: ObjectUpdate) -> list[int]:
        """Name the entries whose places are empty in this view."""
        return [
            look.entry_id
            for look in look_at_places(map_, view, update, self.evidence)
            if not look.is_detected
            and look.is_clear(self.min_points, self.min_shown)
            and look.evidence.num_see_through > look.evidence.num_supported
        ]


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

    def absent(self, map_: ObjectMap, view: View, update: ObjectUpdate) -> list[int]:
        """Name the entries that this view shows to be absent."""
        return [
            look.entry_id
            for look in look_at_places(map_, view, update, self.evidence)
            if judge_presence(look.evidence, is_detected=look.is_detected, config=self.presence) is Presence.NO
        ]


@dataclass(slots=True)
class SeeThrough(ForgettingRule):
    """Delete every point as soon as one later depth image sees through it: DynaMem (Liu et al., 2024).

    DynaMem deletes each stored point that projects into the image at a depth of 0.01 to 2.5 m, unless the image is
    nearer by more than 0.1 m, and then adds the points of the image. So a point on a surface is replaced by the same
    point. Here it stays, since only detections add points; a point before a surface goes if it is more than 0.1 m
    before it. DynaMem has no entries: here one goes when few of its points are left, which are those that lie within
    0.1 m of what stood behind the object.
    """

    name: ClassVar[str] = "see-through"
    max_left_share: float = 0.5
    """An entry goes when at most this share is left of the points that it had when it was last detected; ours."""
    points: SeeThroughConfig = field(default_factory=SeeThroughConfig)
    """Conditions under which a point is deleted."""
    _num_points: EntryStates[int] = field(init=False, repr=False, default_factory=EntryStates)
    """Number of points before the first deletion since an entry was last detected."""

    def absent(self, map_: ObjectMap, view: View, update: ObjectUpdate) -> list[int]:
        """Delete points; name the entries with too few of them left that this view did not detect."""
        self._num_points.follow(update)
        detected = frozenset(detected_ids(update))
        for entry_id in detected:
            self._num_points.pop(entry_id, None)
        gone = []
        for erosion in map_.remove_seen_through(view, self.points):
            num_points = erosion.num_left + erosion.num_removed
            if erosion.entry_id not in detected:
                num_points = self._num_points.setdefault(erosion.entry_id, num_points)
            is_left = erosion.entry_id in detected or erosion.num_left > self.max_left_share * num_points
            if erosion.num_left == 0 or not is_left:
                gone.append(erosion.entry_id)
                self._num_points.pop(erosion.entry_id, None)
        return gone


@dataclass(slots=True)
class ShareDeleted(SeeThrough):
    """Delete the points whose depth disagrees, and an entry when enough of it was deleted: DovSG (Yan et al., 2024).

    DovSG deletes a voxel if the image shows something more than 2 cm behind it, or more than 1 cm behind it in another
    colour; points have no colours here, so the second half is left out.
    """

    name: ClassVar[str] = "share-deleted"
    max_left_share: float = 0.5
    """An entry goes when at most this share is left of the points that it had when it was last detected."""
    points: SeeThroughConfig = field(default_factory=lambda: SeeThroughConfig(band_m=0.02, far_m=3.5))
    """Conditions under which a point is deleted."""


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

    def absent(self, map_: ObjectMap, view: View, update: ObjectUpdate) -> list[int]:
        """Count this view's votes; name the entries that are voted absent."""
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
        return gone

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

    def absent(self, map_: ObjectMap, view: View, update: ObjectUpdate) -> list[int]:
        """Count the missing detections of this view; name the entries that have been pending for long."""
        self._num_missed.follow(update)
        gone = []
        for look in look_at_places(map_, view, update, self.evidence):
            if look.is_detected:
                self._num_missed[look.entry_id] = 0
            elif (
                look.is_clear(self.min_points, self.min_shown) and expected_px(map_, look.entry_id, view) >= self.min_px
            ):
                missed = self._num_missed[look.entry_id] = self._num_missed.get(look.entry_id, 0) + 1
                if missed >= self.window + self.max_pending and not self._is_anchor(map_, look.entry_id):
                    gone.append(look.entry_id)
                    del self._num_missed[look.entry_id]
        return gone

    def _is_anchor(self, map_: ObjectMap, entry_id: int) -> bool:
        entry = map_.entry(entry_id) if self.anchors else None
        return entry is not None and entry.label in self.anchors and entry.num_detections >= self.min_detections


@dataclass(slots=True)
class Bayes(ForgettingRule):
    """Keep for each entry the probability that its object is still there, and forget it below a threshold.

    With detection rate d and false-positive rate f, a detection makes p into p d / (p d + (1 - p) f), and a view that
    shows the place without one into p (1 - d) / (p (1 - d) + (1 - p) (1 - f)): the soft negative evidence of
    EvolvingNav (2026), where hidden surface does not count. Between two visits p decays with time. All rates are ours.

    How much a missing detection says depends on what depth shows. Where the place is seen through, the object would be
    detected at the full rate. Where there is still a surface, the detector may have failed on it, or something else
    stands or lies there: `surface_detection_rate`. A view that shows less of the place says nothing.
    """

    name: ClassVar[str] = "bayes"
    detection_rate: float = 0.9
    """Probability that an object in view is detected, where the alternative is that nothing is there."""
    surface_detection_rate: float = 0.5
    """The same where a surface is seen at the place."""
    false_positive_rate: float = 0.05
    """Probability that an absent object is detected."""
    prior: float = 0.5
    """Probability before the first detection."""
    half_life_s: float | None = 30 * DAY_S
    """Time between two visits in which p halves; `None` for no decay."""
    min_p: float = 0.2
    """An entry is forgotten when a missing detection takes p below this."""
    max_p: float = 0.99
    """Largest value of p; 1 - `max_p` is the smallest. Without it, many detections would make an entry immortal."""
    min_points: int = 16
    """A view says something of an entry if it shows at least this many of the compared points."""
    min_shown: float = 0.5
    """It must also show at least this share of the points that are in view or hidden."""
    min_px: float = 64.0
    """Smallest number of pixels that the object would cover, if a missing detection on a surface is to count."""
    evidence: EvidenceConfig = field(default_factory=EvidenceConfig)
    """Parameters of the comparison of points with depth."""
    _p: EntryStates[float] = field(init=False, repr=False, default_factory=EntryStates)
    _visit_s: float | None = field(init=False, repr=False, default=None)
    """Time of the last visit's beginning."""

    def begin_visit(self, map_: ObjectMap, time_s: float) -> tuple[int, ...]:
        """Let all probabilities decay; time alone forgets nothing."""
        if self._visit_s is not None and self.half_life_s is not None:
            share = 0.5 ** (max(0.0, time_s - self._visit_s) / self.half_life_s)
            for entry_id, p in self._p.items():
                self._p[entry_id] = p * share
        self._visit_s = time_s
        return ()

    def absent(self, map_: ObjectMap, view: View, update: ObjectUpdate) -> list[int]:
        """Weigh the detections of this view, and those that are missing; name the entries that are improbable then."""
        self._p.follow(update)
        for entry_id in detected_ids(update):
            p = self._p.get(entry_id, self.prior)
            self._p[entry_id] = self._posterior(p, self.detection_rate, self.false_positive_rate)
        gone = []
        for look in look_at_places(map_, view, update, self.evidence):
            if look.is_detected or not look.is_clear(self.min_points, self.min_shown):
                continue
            presence = judge_presence(look.evidence, is_detected=False)
            if presence is Presence.UNKNOWN:
                continue
            if presence is Presence.YES and expected_px(map_, look.entry_id, view) < self.min_px:
                continue
            rate = self.detection_rate if presence is Presence.NO else self.surface_detection_rate
            p = self._posterior(self._p.get(look.entry_id, self.prior), 1.0 - rate, 1.0 - self.false_positive_rate)
            self._p[look.entry_id] = p
            if p < self.min_p:
                gone.append(look.entry_id)
                del self._p[look.entry_id]
        return gone

    def p_present(self, entry_id: int) -> float | None:
        """Return p; `None` for an entry that no view of this rule has shown."""
        return self._p.get(entry_id)

    def _posterior(self, p: float, if_present: float, if_absent: float) -> float:
        posterior = p * if_present / (p * if_present + (1.0 - p) * if_absent)
        return min(self.max_p, max(1.0 - self.max_p, posterior))
