"""All that Belief-Weighted Search remembers and believes, and the posterior that follows from it."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from evonav.agents.grid import NO_GROUP, box_slices, owners_of
from evonav.agents.navigator import Navigator
from evonav.agents.proactive.config import ProactiveConfig
from evonav.agents.proactive.maps import SearchedCells, rooms_of, unknown_cells, walls_of
from evonav.agents.proactive.posterior import (
    NAMED,
    SIGHTED,
    Posterior,
    Surroundings,
    prior_of,
    room_factors,
    spread_moved,
    visible_range_m,
)
from evonav.agents.proactive.presence import PresenceBelief
from evonav.agents.proactive.sightings import Sightings
from evonav.decision.candidates import ObjectCandidate
from evonav.decision.text.language import ParsedGoal, similarity
from evonav.decision.text.matcher import Matcher
from evonav.memory.occupancy import BLOCKED, FREE, UNKNOWN
from evonav.points import Point2
from evonav.sensors.observation import MapFrame

FRONTIER_REACH_M = 4.0
"""Distance over unknown cells up to which they count as behind a frontier."""
FURNITURE_M = 0.3
"""Distance from an object's box within which its room is looked up."""


class TargetBelief:
    """Keeps entries with their presence, searched cells and sightings over all stages."""

    def __init__(self, navigator: Navigator, frame: MapFrame, matcher: Matcher, config: ProactiveConfig) -> None:
        """Begin in a new house, and watch what the navigator sees."""
        self._navigator, self._frame, self._matcher, self._config = navigator, frame, matcher, config
        self.presence = PresenceBelief(config)
        self.searched = SearchedCells(frame, config)
        self.sightings = Sightings()
        navigator.observers.append(self.presence.see)
        navigator.observers.append(self.sightings.see)
        navigator.observers.append(lambda objects, view, update: self.searched.see(view))
        self.factors: dict[int, float] = {}
        """Factors of entries that were denied, or that the agent left, in this stage; 1 if not given."""
        self._path: list[Point2] = []
        """Places of the agent in this stage."""

    def begin_stage(self, goal: ParsedGoal, stage: int) -> None:
        """Take a new goal, and let things have moved."""
        self._goal = goal
        self.factors = {}
        self.sightings.begin_stage(stage)
        self.searched.begin_stage()
        self._navigator.explorer.offer_again()
        if stage > 1:
            around = self.surroundings()
            visited = frozenset(_room_at(around.rooms, self._frame, place) for place in self._path)
            here = _room_at(around.rooms, self._frame, self._path[-1]) if self._path else NO_GROUP
            self.presence.begin_stage(stage, around.room_of, visited, here)
        self._path = []

    def begin_round(self, here_m: Point2) -> None:
        """Begin a round at the agent's place, before the round's views are taken in."""
        self.sightings.round += 1
        self._path.append(here_m)

    def surroundings(self) -> Surroundings:
        """Return the memory as it is now."""
        navigator, frame, coarse = self._navigator, self._frame, self.searched.coarse
        remembered = [
            navigator.candidate(entry, with_looks=similarity(self._goal.noun, entry.label) >= NAMED)
            for entry in navigator.objects.entries
        ]
        cells, frontiers = navigator.explorer.map.cells, navigator.explorer.frontiers
        rooms = rooms_of(cells, frame, remembered)
        blocks = coarse.taken(cells, UNKNOWN)
        unknown = unknown_cells(coarse, blocks, remembered)
        return Surroundings(
            coarse=coarse,
            rooms=rooms,
            remembered=remembered,
            room_of={one.entry_id: _room_by(rooms, frame, one) for one in remembered},
            unknown=unknown,
            free=(blocks == FREE).all(axis=0),
            walls=walls_of(cells, frame, remembered),
            frontiers=frontiers,
            owners=owners_of(frontiers, unknown & (blocks != BLOCKED).all(axis=0), coarse, FRONTIER_REACH_M),
        )

    def posterior(self, around: Surroundings) -> Posterior:
        """Return where the target may be."""
        goal, matcher, config, sightings = self._goal, self._matcher, self._config, self.sightings.all
        named = [one for one in around.remembered if matcher.names_goal(goal, one)]
        appearances = matcher.appearance_ratios(goal, named) if config.uses_text else [1.0] * len(named)
        fits = matcher.context_ratios(goal, named, around.remembered) if config.uses_text else [1.0] * len(named)
        range_m, coarse, unknown = visible_range_m(goal.noun), around.coarse, around.unknown
        rooms = np.asarray(coarse.taken(around.rooms, NO_GROUP).max(axis=0), np.int32)
        prior, leads = prior_of(goal, around, sightings, config)
        factors = {self._navigator.views.resolve(entry_id): factor for entry_id, factor in self.factors.items()}
        replaced = self._replaced(named)

        entries: dict[int, float] = {}
        by_room: dict[int, float] = {}
        for one, appearance, fit in zip(named, appearances, fits, strict=True):
            p_present = self.presence.p_present(one.entry_id)
            entries[one.entry_id] = appearance * fit * p_present * factors.get(one.entry_id, 1.0)
            if one.entry_id not in replaced:
                room = around.room_of.get(one.entry_id, NO_GROUP)
                by_room[room] = by_room.get(room, 0.0) + appearance * (1.0 - p_present)
        moved = spread_moved(by_room, rooms, ~unknown, prior, config) * self.searched.missed(range_m)

        likelier = room_factors(goal, matcher, around, rooms, config)
        rated = [
            (one, SIGHTED * coarse.value_at(likelier, one.ground_m))
            for one in sightings
            if similarity(goal.noun, one.label) >= NAMED
        ]
        rated += [(one, share * coarse.value_at(likelier, one.ground_m)) for one, share in leads]
        unseen = np.zeros_like(prior)
        if around.frontiers or not unknown.all():
            unseen = prior * likelier * self.searched.ever_missed(range_m)
            unseen[unknown & (around.owners == NO_GROUP)] *= config.far_beyond
            if not around.frontiers:
                unseen[unknown] = 0.0  # nothing leads there
        total = math.fsum(entries.values()) + float(moved.sum()) + float(unseen.sum())
        total += math.fsum(weight for _, weight in rated)
        return Posterior(entries, rated, moved, unseen, total)

    def _replaced(self, named: Sequence[ObjectCandidate]) -> set[int]:
        """Return the entries whose objects were found elsewhere: each newer namesake explains the least believed."""
        presence, ids = self.presence, [one.entry_id for one in named]
        replaced: set[int] = set()
        for newer in sorted(ids):
            gone = [
                older
                for older in ids
                if presence.first_stage(older) < presence.first_stage(newer)
                and presence.p_present(older) < 0.5
                and older not in replaced
            ]
            if gone:
                replaced.add(min(gone, key=lambda one: (presence.p_present(one), one)))
        return replaced


def _room_at(rooms: NDArray[np.int32], frame: MapFrame, place_m: Point2) -> int:
    row = math.floor((place_m[1] - frame.corner_m[1]) / frame.cell_m)
    col = math.floor((place_m[0] - frame.corner_m[0]) / frame.cell_m)
    return int(rooms[row, col]) if 0 <= row < frame.rows and 0 <= col < frame.cols else NO_GROUP


def _room_by(rooms: NDArray[np.int32], frame: MapFrame, one: ObjectCandidate) -> int:
    """Return the room of most cells under and around an object."""
    numbers = rooms[box_slices(one, frame, FURNITURE_M)]
    numbers = numbers[numbers != NO_GROUP]
    return int(np.bincount(numbers).argmax()) if numbers.size else NO_GROUP
