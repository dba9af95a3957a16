"""The posterior over where the target is now: at a remembered place, moved from one, or never seen."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.agents.agent import PlaceBelief
from evonav.agents.grid import NO_GROUP, CoarseFrame, box_distance_m
from evonav.agents.proactive.config import PRIORS, ProactiveConfig
from evonav.agents.proactive.places import prior_of, visible_range_m
from evonav.agents.proactive.presence import PresenceBelief
from evonav.agents.proactive.rooms import NO_ROOM
from evonav.agents.proactive.searched import SearchedCells
from evonav.agents.proactive.sightings import FarSighting
from evonav.decision.candidates import ObjectCandidate
from evonav.decision.home_statistics import room_ratios
from evonav.decision.text.language import ParsedGoal, canonical, similarity
from evonav.decision.text.matcher import Matcher
from evonav.memory import Frontier
from evonav.points import Point2

AT_DOOR_M = 0.75
"""Largest distance between a frontier and the box of a door that leads to what is behind it."""
SQUARE_CELLS = 3
"""Edge of a square of `place_belief`, in coarse cells."""
NAMED = 0.99
"""Similarity from which a label is the goal's name."""
SIGHTED = 0.9
"""Weight of a sighting: that of an entry about whose looks and surroundings nothing is known."""


@dataclass(frozen=True, slots=True)
class Posterior:
    """Weights of all places; they share one scale, and their sum is `total`."""

    entries: Mapping[int, float]
    """Weight of the stored place of each entry with the goal's name, by id."""
    sightings: Sequence[tuple[FarSighting, float]]
    """Detections without an entry that may be of the goal, or of what the goal is on, and the weight of each."""
    moved: NDArray[np.float64]
    """`(R, C)` weight of each coarse cell as the present place of a remembered object that is no longer at its own."""
    unseen: NDArray[np.float64]
    """`(R, C)` weight of each coarse cell as the place of an object that was never seen."""
    unknown: NDArray[np.bool_]
    """`(R, C)` coarse cells that the map does not know."""
    total: float

    def share(self, entry_id: int) -> float:
        """Return the probability that the target is at the stored place of an entry."""
        return self.entries.get(entry_id, 0.0) / self.total if self.total > 0.0 else 0.0

    def summary(self) -> dict[str, Any]:
        """Return the probabilities of the entries, of what moved and of what was never seen, for records."""
        total = self.total or 1.0
        return {
            "p_entries": {str(one): round(weight / total, 4) for one, weight in sorted(self.entries.items())},
            "p_moved": round(float(self.moved.sum()) / total, 4),
            "p_unseen": round(float(self.unseen.sum()) / total, 4),
        }

    @property
    def elsewhere(self) -> float:
        """Weight of all places without an entry of the goal's name."""
        return float(self.moved.sum() + self.unseen.sum()) + math.fsum(weight for _, weight in self.sightings)


def place_belief(posterior: Posterior, placed: Sequence[tuple[Point2, float]], coarse: CoarseFrame) -> PlaceBelief:
    """Return the posterior as probabilities of squares of `SQUARE_CELLS` coarse cells, for records and pictures.

    Args:
        placed: Middles of the entries and sightings, and their weights.
    """
    weights = posterior.moved + posterior.unseen
    for place_m, weight in placed:
        weights[coarse.frame.cell_at(place_m)] += weight
    rows, cols = (-(-size // SQUARE_CELLS) for size in weights.shape)
    padded = np.zeros((rows * SQUARE_CELLS, cols * SQUARE_CELLS))
    padded[: weights.shape[0], : weights.shape[1]] = weights
    shares = padded.reshape(rows, SQUARE_CELLS, cols, SQUARE_CELLS).sum(axis=(1, 3))
    shares = np.floor(shares / max(float(shares.sum()), 1e-300) * 1e5) / 1e5
    half = 0.5 * (SQUARE_CELLS - 1)
    likely = np.argwhere(shares > 0.0).tolist()
    return PlaceBelief(
        cell_m=coarse.frame.cell_m * SQUARE_CELLS,
        centres_m=tuple(
            coarse.frame.centre_m(row * SQUARE_CELLS + half, col * SQUARE_CELLS + half) for row, col in likely
        ),
        probabilities=tuple(float(shares[row, col]) for row, col in likely),
    )


@dataclass(frozen=True, slots=True)
class Surroundings:
    """The memory of the agent, for one decision."""

    cells: NDArray[np.uint8]
    """`(R, C)` of its map."""
    rooms: NDArray[np.int32]
    """`(R, C)` room of each cell of its map."""
    remembered: Sequence[ObjectCandidate]
    room_of: Mapping[int, int]
    """Room of each entry."""
    unknown: NDArray[np.bool_]
    """`(R, C)` coarse cells that the map does not know, and under nothing remembered: rays end at furniture's edge."""
    free: NDArray[np.bool_]
    """`(R, C)` coarse cells that are free in all of their area."""
    walls: NDArray[np.bool_]
    """`(R, C)` cells of its map that are blocked, and by nothing remembered."""
    frontiers: Sequence[Frontier]
    owners: NDArray[np.int32]
    """`(R, C)` index of the frontier behind which each coarse cell lies; `NO_GROUP` elsewhere."""


def posterior_of(
    goal: ParsedGoal,
    matcher: Matcher,
    around: Surroundings,
    presence: PresenceBelief,
    searched: SearchedCells,
    sightings: Sequence[FarSighting],
    factors: Mapping[int, float],
    replaced: frozenset[int],
    config: ProactiveConfig,
) -> Posterior:
    """Return where the target may be.

    Args:
        sightings: Everything that was detected and is no entry.
        searched: Probabilities that the views of this stage, and of all stages, missed the target.
        factors: Further factors of entries, such as of those whose identity was denied; 1 if not given.
        replaced: Entries whose objects were found at other places.
    """
    named = [one for one in around.remembered if matcher.names_goal(goal, one)]
    appearances = matcher.appearance_ratios(goal, named) if config.uses_text else [1.0] * len(named)
    fits = matcher.context_ratios(goal, named, around.remembered) if config.uses_text else [1.0] * len(named)
    range_m = visible_range_m(goal.noun)
    coarse = searched.coarse
    unknown = around.unknown
    rooms = np.asarray(coarse.taken(around.rooms, NO_ROOM).max(axis=0), np.int32)
    prior, leads = prior_of(goal, around.remembered, sightings, coarse, unknown, config)

    entries: dict[int, float] = {}
    by_room: dict[int, float] = {}
    for one, appearance, fit in zip(named, appearances, fits, strict=True):
        p_present = presence.p_present(one.entry_id)
        entries[one.entry_id] = appearance * fit * p_present * factors.get(one.entry_id, 1.0)
        if one.entry_id not in replaced:
            room = around.room_of.get(one.entry_id, NO_ROOM)
            by_room[room] = by_room.get(room, 0.0) + appearance * (1.0 - p_present)
    moved = _moved(by_room, rooms, ~unknown, prior, config) * searched.missed(range_m)

    room_factors = _room_factors(goal, matcher, around, rooms, unknown, config)
    rated = [
        (one, SIGHTED * coarse.value_at(room_factors, one.ground_m))
        for one in sightings
        if similarity(goal.noun, one.label) >= NAMED
    ]
    rated += [(one, share * coarse.value_at(room_factors, one.ground_m)) for one, share in leads]
    unseen = np.zeros_like(prior)
    if around.frontiers or not unknown.all():
        unseen = prior * room_factors * searched.ever_missed(range_m)
        unseen[unknown & (around.owners == NO_GROUP)] *= config.far_beyond
        if not around.frontiers:
            unseen[unknown] = 0.0  # nothing leads there
    total = math.fsum(entries.values()) + float(moved.sum()) + float(unseen.sum())
    total += math.fsum(weight for _, weight in rated)
    return Posterior(entries, rated, moved, unseen, unknown, total)


def _moved(
    by_room: Mapping[int, float],
    rooms: NDArray[np.int32],
    known: NDArray[np.bool_],
    prior: NDArray[np.float64],
    config: ProactiveConfig,
) -> NDArray[np.float64]:
    """Spread objects that moved over the known cells: most of them over those of their own room."""
    moved = np.zeros_like(prior)
    anywhere = prior * known
    sum_anywhere = float(anywhere.sum())
    for room, weight in by_room.items():
        inside = anywhere * (rooms == room)
        sum_inside = float(inside.sum())
        stay = PRIORS[config.prior].same_room if config.searches_rooms and room != NO_ROOM and sum_inside > 0.0 else 0.0
        if stay:
            moved += weight * stay / sum_inside * inside
        if sum_anywhere > 0.0:
            moved += weight * (1.0 - stay) / sum_anywhere * anywhere
    return moved


def _room_factors(
    goal: ParsedGoal,
    matcher: Matcher,
    around: Surroundings,
    rooms: NDArray[np.int32],
    unknown: NDArray[np.bool_],
    config: ProactiveConfig,
) -> NDArray[np.float64]:
    """Return `(R, C)`: how much likelier the target is in a cell by the type of its room; 1 where that is unknown."""
    factors = np.ones(rooms.shape)
    if not config.weighs_rooms:
        return factors
    ratios = room_ratios(goal.noun) if PRIORS[config.prior].knows_rooms else {}
    signs: dict[int, list[str]] = {}
    for one in around.remembered:
        kind = matcher.sign_of(one.label)
        room = around.room_of.get(one.entry_id, NO_ROOM)
        if kind is not None and room != NO_ROOM:
            signs.setdefault(room, []).append(kind)
    by_room: dict[int, float] = {}
    for room, kinds in signs.items():
        kind = max(sorted(set(kinds)), key=kinds.count)
        if goal.room is not None:
            factor = config.room_ratio if kind == goal.room else 1.0 / config.room_ratio
        else:
            factor = ratios.get(kind, 1.0)
        by_room[room] = factor
        factors[rooms == room] = factor
    doors = [one for one in around.remembered if canonical(one.label) == "doorway"]
    for index, frontier in enumerate(around.frontiers):
        numbers = around.rooms[frontier.cells[:, 0], frontier.cells[:, 1]]
        numbers = numbers[numbers != NO_ROOM]
        room = int(np.bincount(numbers).argmax()) if numbers.size else NO_ROOM
        is_at_door = any(box_distance_m(door, frontier.position_m) <= AT_DOOR_M for door in doors)
        share = config.same_room_beyond_door if is_at_door else config.same_room_beyond
        factors[(around.owners == index) & unknown] = share * by_room.get(room, 1.0) + 1.0 - share
    return factors
