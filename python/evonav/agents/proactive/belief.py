"""All that Belief-Weighted Search remembers and believes, and the posterior that follows from it."""

import math

import numpy as np
from numpy.typing import NDArray

from evonav.agents.grid import box_slices, owners_of
from evonav.agents.navigator import Navigator
from evonav.agents.proactive.config import ProactiveConfig
from evonav.agents.proactive.posterior import NAMED, Posterior, Surroundings, posterior_of
from evonav.agents.proactive.presence import PresenceBelief
from evonav.agents.proactive.rooms import NO_ROOM, rooms_of
from evonav.agents.proactive.search import unknown_cells, walls_of
from evonav.agents.proactive.searched import SearchedCells
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
            here = _room_at(around.rooms, self._frame, self._path[-1]) if self._path else NO_ROOM
            self.presence.begin_stage(stage, around.room_of, visited, here)
        self._path = []

    def begin_round(self) -> None:
        """Begin a round, before its views are taken in."""
        self.sightings.round += 1

    def note_place(self, here_m: Point2) -> None:
        """Note where the agent is."""
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
            cells=cells,
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
        return posterior_of(
            self._goal,
            self._matcher,
            around,
            self.presence,
            self.searched,
            self.sightings.all,
            {self._navigator.views.resolve(entry_id): factor for entry_id, factor in self.factors.items()},
            self._replaced(around),
            self._config,
        )

    def _replaced(self, around: Surroundings) -> frozenset[int]:
        """Return the entries whose objects were found elsewhere: each newer namesake explains the least believed."""
        presence = self.presence
        named = [one.entry_id for one in around.remembered if self._matcher.names_goal(self._goal, one)]
        replaced: set[int] = set()
        for newer in sorted(named):
            gone = [
                older
                for older in named
                if presence.first_stage(older) < presence.first_stage(newer)
                and presence.p_present(older) < 0.5
                and older not in replaced
            ]
            if gone:
                replaced.add(min(gone, key=lambda one: (presence.p_present(one), one)))
        return frozenset(replaced)


def _room_at(rooms: NDArray[np.int32], frame: MapFrame, place_m: Point2) -> int:
    row = math.floor((place_m[1] - frame.corner_m[1]) / frame.cell_m)
    col = math.floor((place_m[0] - frame.corner_m[0]) / frame.cell_m)
    return int(rooms[row, col]) if 0 <= row < frame.rows and 0 <= col < frame.cols else NO_ROOM


def _room_by(rooms: NDArray[np.int32], frame: MapFrame, one: ObjectCandidate) -> int:
    """Return the room of most cells under and around an object."""
    numbers = rooms[box_slices(one, frame, FURNITURE_M)]
    numbers = numbers[numbers != NO_ROOM]
    return int(np.bincount(numbers).argmax()) if numbers.size else NO_ROOM
