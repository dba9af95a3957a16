"""The probability that a remembered object is still at its place: hazard, evidence of depth, and evidence by room."""

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field

from evonav.agents.grid import NO_GROUP
from evonav.agents.proactive.config import ProactiveConfig
from evonav.memory.forgetting.rule import expected_px, look_at_places
from evonav.memory.objects import ObjectMap, ObjectUpdate
from evonav.memory.presence import DepthEvidence, EvidenceConfig, Presence, judge_presence
from evonav.sensors.observation import View

NUM_SECTORS = 6
"""Directions from which a place is looked at: looks within 60 degrees are not independent."""
DETECTION_RATE = 0.9
"""Probability that an object in view is detected; with the next three, as the rule `bayes` has them."""
SURFACE_DETECTION_RATE = 0.5
"""The same if the alternative is something else that is seen at the place."""
FALSE_POSITIVE_RATE = 0.05
"""Probability that something is taken for an object that is gone."""
MIN_PX = 64.0
"""Smallest number of pixels that an object would cover, if a missing detection on a surface is to count."""
MIN_POINTS, MIN_SHOWN = 16, 0.5
"""A look counts if it shows this many of an object's points, and this share of those that are not outside of it."""
NEW = 0.9
"""Belief in an object when it is first detected."""
JUDGED = math.log(5.0)
"""Evidence, as a logarithm of a likelihood ratio, from which an object counts as verified, or as contradicted."""
FALSE_CONTRADICTION, MISSED_MOVE = 0.02, 0.05
"""Probabilities that an object that stayed counts as contradicted, and that one that moved counts as verified."""
MIN_P = 1e-3
"""Smallest probability of a presence or an absence."""


@dataclass(slots=True)
class _Entry:
    before: float
    """Belief at the end of the last stage."""
    first_stage: int
    room: int | None = None
    """Room in which it was when the stage began; `None` for one that is new in this stage."""
    evidence: float = 0.0
    """Logarithm of the likelihood ratio of this stage's looks."""
    sectors: dict[bool, set[int]] = field(default_factory=lambda: {True: set(), False: set()})
    """Sectors of the looks that were counted, by whether they showed the object."""
    present: float = NEW


class PresenceBelief:
    """Keeps the belief in each entry."""

    def __init__(self, config: ProactiveConfig) -> None:
        self._config = config
        self._prior = config.prior
        self._entries: dict[int, _Entry] = {}
        self._change_prior: dict[int, float] = {}
        self.changed: dict[int, float] = {}
        """Probability that each room changed before this stage."""
        self._stage = 1

    def begin_stage(self, stage: int, room_of: Mapping[int, int], visited: frozenset[int], here: int) -> None:
        """Let things have moved.

        Args:
            room_of: Room of each entry; rooms are renumbered at each stage.
            visited: Rooms in which the agent was in the last stage.
            here: The agent's room, which does not change; `NO_GROUP` if it is in none.
        """
        self._stage = stage
        seemed_changed: dict[int, list[float]] = defaultdict(list)
        for entry_id, entry in self._entries.items():
            seemed_changed[room_of.get(entry_id, NO_GROUP)].append(self.changed.get(_or_none(entry.room), 0.0))
            entry.before, entry.evidence = entry.present, 0.0
            entry.room = room_of.get(entry_id, NO_GROUP)
            entry.sectors = {True: set(), False: set()}
        prior, weights = self._prior, {}
        for room, before in seemed_changed.items():
            weight = prior.visited_weight if room in visited else 1.0
            repeated = prior.repeated_weight if max(before) > 0.5 else 1.0
            weights[room] = 0.0 if room == here and room != NO_GROUP else weight * repeated
        total = math.fsum(weights.values())
        expected = prior.change if self._config.expects_change else 0.0
        self._change_prior = {room: expected * weight / total if total else 0.0 for room, weight in weights.items()}
        self.update()

    def see(self, map_: ObjectMap, view: View, update: ObjectUpdate) -> None:
        """Take in what a view shows at the places of all entries in it."""
        for gone, became in update.merged:
            state = self._entries.pop(gone, None)
            if state is not None:
                self._entries.setdefault(became, state)
        for entry_id in update.removed:
            self._entries.pop(entry_id, None)
        for entry_id in sorted({one for one in update.entry_ids if one is not None}):
            entry = self._entries.setdefault(entry_id, _Entry(NEW, self._stage))
            self._vote(map_, entry_id, entry, view, DETECTION_RATE / FALSE_POSITIVE_RATE)
        if not self._config.sees_through:
            return
        for look in look_at_places(map_, view, update, EvidenceConfig()):
            if not look.is_detected and look.is_clear(MIN_POINTS, MIN_SHOWN):
                self._miss(map_, look.entry_id, view, look.evidence)

    def see_nothing_on_arrival(self, map_: ObjectMap, entry_id: int, view: View, evidence: DepthEvidence) -> None:
        """Take in that the agent went to an entry and does not detect it; without depth's word, as on a surface."""
        if not self._miss(map_, entry_id, view, evidence) and entry_id in self._entries:
            ratio = (1.0 - SURFACE_DETECTION_RATE) / (1.0 - FALSE_POSITIVE_RATE)
            self._entries[entry_id].evidence += math.log(ratio)

    def _miss(self, map_: ObjectMap, entry_id: int, view: View, evidence: DepthEvidence) -> bool:
        """Count a look that does not detect an entry, if it says something; return whether it was counted."""
        entry = self._entries.get(entry_id)
        presence = judge_presence(evidence, is_detected=False)
        is_empty = presence is Presence.NO
        if entry is None or (
            not is_empty and (presence is Presence.UNKNOWN or expected_px(map_, entry_id, view) < MIN_PX)
        ):
            return False
        rate = DETECTION_RATE if is_empty else SURFACE_DETECTION_RATE
        return self._vote(map_, entry_id, entry, view, (1.0 - rate) / (1.0 - FALSE_POSITIVE_RATE))

    def _vote(self, map_: ObjectMap, entry_id: int, entry: _Entry, view: View, ratio: float) -> bool:
        """Count a look, once for each side from which the place is seen; return whether it counted."""
        known = map_.entry(entry_id)
        if known is None:
            return False
        sectors = entry.sectors[ratio > 1.0]
        sector = sector_of(view.pose.x_m - known.centre_m[0], view.pose.z_m - known.centre_m[2])
        if self._config.gates_sectors and sector in sectors:
            return False
        sectors.add(sector)
        entry.evidence += math.log(ratio)
        return True

    def update(self) -> None:
        """Compute the belief in all rooms and entries again, from all evidence of the stage."""
        ratios, moved = self._room_ratios()
        prior = self._change_prior
        none = 1.0 - math.fsum(prior.values())
        weighted = {room: share * ratios.get(room, 1.0) for room, share in prior.items()}
        if self._config.explains_away:  # one room changes at a time
            total = none + math.fsum(weighted.values())
            self.changed = {room: share / total for room, share in weighted.items()}
        else:
            self.changed = {room: share / (share + 1.0 - prior[room]) for room, share in weighted.items()}
        for entry in self._entries.values():
            hazard = 0.0
            if entry.room is not None:
                hazard = self.changed.get(entry.room, 0.0) * moved.get(entry.room, self._prior.mean_moved)
            prior_p = min(max(entry.before * (1.0 - hazard), MIN_P), 1.0 - MIN_P)
            log_odds = math.log(prior_p / (1.0 - prior_p)) + entry.evidence
            entry.present = min(max(1.0 / (1.0 + math.exp(-min(max(log_odds, -50.0), 50.0))), MIN_P), 1.0 - MIN_P)

    def _room_ratios(self) -> tuple[dict[int, float], dict[int, float]]:
        """Return the likelihood ratio of a change of each room, and the share of its objects that then moved."""
        if not self._config.uses_rooms:
            return {}, {}
        counts: dict[int, list[int]] = defaultdict(lambda: [0, 0])
        for entry in self._entries.values():
            if entry.room is not None and entry.before > 0.5 and abs(entry.evidence) > JUDGED:
                counts[entry.room][entry.evidence < 0.0] += 1
        ratios, moved_shares = {}, {}
        for room, (num_verified, num_contradicted) in counts.items():
            weights = []
            for mode, moved in zip(self._prior.modes, self._prior.moved, strict=True):
                seen_gone = moved * (1.0 - MISSED_MOVE) + (1.0 - moved) * FALSE_CONTRADICTION
                log_ratio = num_contradicted * math.log(seen_gone / FALSE_CONTRADICTION) + num_verified * math.log(
                    (1.0 - seen_gone) / (1.0 - FALSE_CONTRADICTION)
                )
                weights.append(mode * math.exp(min(log_ratio, 50.0)))
            ratios[room] = math.fsum(weights)
            shares = (weight * moved for weight, moved in zip(weights, self._prior.moved, strict=True))
            moved_shares[room] = math.fsum(shares) / max(ratios[room], 1e-300)
        return ratios, moved_shares

    def p_present(self, entry_id: int) -> float:
        """Return the probability that an entry's object is at its place."""
        entry = self._entries.get(entry_id)
        return NEW if entry is None else entry.present

    def is_verified(self, entry_id: int) -> bool:
        """Return whether this stage's looks show that an entry's object is at its place."""
        entry = self._entries.get(entry_id)
        return entry is not None and entry.evidence > JUDGED

    def first_stage(self, entry_id: int) -> int:
        """Return the stage in which an entry was first detected."""
        entry = self._entries.get(entry_id)
        return self._stage if entry is None else entry.first_stage


def sector_of(dx_m: float, dz_m: float) -> int:
    """Return the sector, 0 to 5, of a direction."""
    return int(math.atan2(dx_m, dz_m) % math.tau / math.tau * NUM_SECTORS) % NUM_SECTORS


def _or_none(room: int | None) -> int:
    return NO_GROUP - 1 if room is None else room
