"""Forgetting by a probability of presence."""

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
from evonav.memory.objects import ObjectMap, ObjectUpdate
from evonav.memory.presence import EvidenceConfig, Presence, PresenceConfig, judge_presence
from evonav.sensors.observation import View

DAY_S = 86400.0


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

    def after_update(self, map_: ObjectMap, view: View, update: ObjectUpdate, time_s: float) -> tuple[int, ...]:
        """Weigh the detections of this view, and those that are missing."""
        self._p.follow(update)
        for entry_id in detected_ids(update):
            p = self._p.get(entry_id, self.prior)
            self._p[entry_id] = self._posterior(p, self.detection_rate, self.false_positive_rate)
        gone = []
        for look in look_at_places(map_, view, update, self.evidence):
            if look.is_detected or not look.is_clear(self.min_points, self.min_shown):
                continue
            presence = judge_presence(look.evidence, is_detected=False, config=_PRESENCE)
            is_empty = presence is Presence.NO
            if not is_empty and (presence is Presence.UNKNOWN or self._is_small(map_, look.entry_id, view)):
                continue
            rate = self.detection_rate if is_empty else self.surface_detection_rate
            p = self._posterior(self._p.get(look.entry_id, self.prior), 1.0 - rate, 1.0 - self.false_positive_rate)
            self._p[look.entry_id] = p
            if p < self.min_p:
                gone.append(look.entry_id)
                del self._p[look.entry_id]
        return remove_all(map_, gone)

    def p_present(self, entry_id: int) -> float | None:
        """Return p; `None` for an entry that no view of this rule has shown."""
        return self._p.get(entry_id)

    def _is_small(self, map_: ObjectMap, entry_id: int, view: View) -> bool:
        return expected_px(map_, entry_id, view) < self.min_px

    def _posterior(self, p: float, if_present: float, if_absent: float) -> float:
        posterior = p * if_present / (p * if_present + (1.0 - p) * if_absent)
        return min(self.max_p, max(1.0 - self.max_p, posterior))


_PRESENCE = PresenceConfig()
