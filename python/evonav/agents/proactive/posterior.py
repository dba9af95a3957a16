"""The posterior over where the target is now: at a remembered place, moved from one, or never seen."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav.agents.proactive.config import PRIORS, ProactiveConfig
from evonav.agents.proactive.presence import PresenceBelief
from evonav.agents.proactive.priors import room_ratios
from evonav.agents.proactive.rooms import NO_ROOM, box_slices
from evonav.agents.proactive.searched import SearchedCells
from evonav.decision.appearance.statistics import PER_100_M2, UNKNOWN_PER_100_M2, usual_size
from evonav.decision.candidates import ObjectCandidate
from evonav.decision.text.language import ParsedGoal, is_structure, similarity
from evonav.decision.text.matcher import Matcher
from evonav.memory.occupancy import UNKNOWN

FULL_KNOWN_SHARE = 0.5
"""Share of a coarse cell's map cells that must be unknown for it to count as unknown."""


@dataclass(frozen=True, slots=True)
class Posterior:
    """Weights of all places; they share one scale, and their sum is `total`."""

    entries: Mapping[int, float]
    """Weight of the stored place of each entry with the goal's name, by id."""
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

    @property
    def elsewhere(self) -> float:
        """Weight of all places without an entry of the goal's name."""
        return float(self.moved.sum() + self.unseen.sum())


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
    has_frontiers: bool


def posterior_of(
    goal: ParsedGoal,
    matcher: Matcher,
    around: Surroundings,
    presence: PresenceBelief,
    searched: SearchedCells,
    factors: Mapping[int, float],
    replaced: frozenset[int],
    config: ProactiveConfig,
) -> Posterior:
    """Return where the target may be.

    Args:
        goal: The parsed goal.
        matcher: Compares the goal with what is remembered.
        around: The memory.
        presence: Belief in each entry.
        searched: Probabilities that the views of this stage, and of all stages, missed the target.
        factors: Further factors of entries, such as of those whose identity was denied; 1 if not given.
        replaced: Entries whose objects were found at other places.
        config: The agent's parameters.
    """
    named = [one for one in around.remembered if matcher.names_goal(goal, one)]
    appearances = matcher.appearance_ratios(goal, named) if config.uses_text else [1.0] * len(named)
    fits = matcher.context_ratios(goal, named, around.remembered) if config.uses_text else [1.0] * len(named)
    size = usual_size(goal.noun)
    is_small = size is not None and size[0] < config.small_edge_m
    coarse = searched.coarse
    unknown = (coarse.taken(around.cells, UNKNOWN) == UNKNOWN).mean(axis=2) > FULL_KNOWN_SHARE
    rooms = np.asarray(coarse.taken(around.rooms, NO_ROOM).max(axis=2), np.int32)
    prior = _anchored(goal, around, searched, config)

    entries: dict[int, float] = {}
    by_room: dict[int, float] = {}
    for one, appearance, fit in zip(named, appearances, fits, strict=True):
        p_present = presence.p_present(one.entry_id)
        entries[one.entry_id] = appearance * fit * p_present * factors.get(one.entry_id, 1.0)
        if one.entry_id not in replaced:
            room = around.room_of.get(one.entry_id, NO_ROOM)
            by_room[room] = by_room.get(room, 0.0) + appearance * (1.0 - p_present)
    moved = _moved(by_room, rooms, ~unknown, prior, config) * searched.missed(is_small=is_small)

    unseen = np.zeros_like(prior)
    if around.has_frontiers or not unknown.all():
        density = PER_100_M2.get(goal.noun, UNKNOWN_PER_100_M2) / 100.0 * coarse.frame.cell_m**2
        unseen = density * prior * _room_factors(goal, matcher, around, rooms, config)
        unseen *= searched.ever_missed(is_small=is_small)
        if not around.has_frontiers:
            unseen[unknown] = 0.0  # nothing leads there
    total = math.fsum(entries.values()) + float(moved.sum()) + float(unseen.sum())
    return Posterior(entries, moved, unseen, unknown, total)


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


def _anchored(
    goal: ParsedGoal, around: Surroundings, searched: SearchedCells, config: ProactiveConfig
) -> NDArray[np.float64]:
    """Return `(R, C)`: 1, and more at what the text names, if it is remembered."""
    frame = searched.coarse.frame
    prior = np.ones((frame.rows, frame.cols))
    if not config.uses_anchors:
        return prior
    for relation in goal.relations:
        if relation.kind == "in" or is_structure(relation.noun):
            continue
        near = np.zeros_like(prior, np.bool_)
        for one in around.remembered:
            if similarity(relation.noun, one.label) >= 1.0:
                near[box_slices(one, frame, 0.0 if relation.kind == "on" else config.anchor_m)] = True
        prior[near] *= config.support_ratio if relation.kind == "on" else config.anchor_ratio
    return prior


def _room_factors(
    goal: ParsedGoal,
    matcher: Matcher,
    around: Surroundings,
    rooms: NDArray[np.int32],
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
    for room, kinds in signs.items():
        kind = max(sorted(set(kinds)), key=kinds.count)
        if goal.room is not None:
            factor = config.room_ratio if kind == goal.room else 1.0 / config.room_ratio
        else:
            factor = ratios.get(kind, 1.0)
        factors[rooms == room] = factor
    return factors
