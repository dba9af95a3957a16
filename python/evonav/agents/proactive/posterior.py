"""Parts of the posterior over where the target is now: at a remembered place, moved from one, or never seen."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.agents.agent import PlaceBelief
from evonav.agents.grid import NO_GROUP, CoarseFrame, box_distance_m, box_slices
from evonav.agents.proactive.config import ProactiveConfig
from evonav.agents.proactive.sightings import FarSighting
from evonav.decision.candidates import ObjectCandidate
from evonav.decision.home_statistics import per_100_m2, room_ratios
from evonav.decision.text.language import ParsedGoal, canonical, is_structure, similarity
from evonav.decision.text.matcher import Matcher
from evonav.memory import Frontier
from evonav.points import Point2
from evonav.sensors.observation import MapFrame

MIN_MASK_SHARE = 0.001
"""Smallest share of an image that a mask covers if it counts as a detection: 3D-Mem's filter, which the paper keeps."""
LOOK_DOWN_RAD, DROP_M = math.radians(30.0), 0.8
"""Angle under which a small thing is seen, and its usual distance below the camera."""
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


def place_belief(posterior: Posterior, placed: Sequence[tuple[Point2, float]], frame: MapFrame) -> PlaceBelief:
    """Return the posterior as probabilities of squares of `SQUARE_CELLS` coarse cells, for records and pictures.

    Args:
        placed: Middles of the entries and sightings, and their weights.
        frame: Frame of the coarse cells.
    """
    weights = posterior.moved + posterior.unseen
    for place_m, weight in placed:
        weights[frame.cell_at(place_m)] += weight
    rows, cols = (-(-size // SQUARE_CELLS) for size in weights.shape)
    padded = np.zeros((rows * SQUARE_CELLS, cols * SQUARE_CELLS))
    padded[: weights.shape[0], : weights.shape[1]] = weights
    shares = padded.reshape(rows, SQUARE_CELLS, cols, SQUARE_CELLS).sum(axis=(1, 3))
    shares = np.floor(shares / max(float(shares.sum()), 1e-300) * 1e5) / 1e5
    half = 0.5 * (SQUARE_CELLS - 1)
    likely = np.argwhere(shares > 0.0).tolist()
    return PlaceBelief(
        cell_m=frame.cell_m * SQUARE_CELLS,
        centres_m=tuple(frame.centre_m(row * SQUARE_CELLS + half, col * SQUARE_CELLS + half) for row, col in likely),
        probabilities=tuple(float(shares[row, col]) for row, col in likely),
    )


@dataclass(frozen=True, slots=True)
class Surroundings:
    """The memory of the agent, for one decision."""

    coarse: CoarseFrame
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


def spread_moved(
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
        stay = config.prior.same_room if config.searches_rooms and room != NO_GROUP and sum_inside > 0.0 else 0.0
        if stay:
            moved += weight * stay / sum_inside * inside
        if sum_anywhere > 0.0:
            moved += weight * (1.0 - stay) / sum_anywhere * anywhere
    return moved


def room_factors(
    goal: ParsedGoal, matcher: Matcher, around: Surroundings, rooms: NDArray[np.int32], config: ProactiveConfig
) -> NDArray[np.float64]:
    """Return `(R, C)`: how much likelier the target is in a cell by the type of its room; 1 where that is unknown.

    Args:
        rooms: `(R, C)` room of each coarse cell.
    """
    factors = np.ones(rooms.shape)
    if not config.weighs_rooms:
        return factors
    ratios = room_ratios(goal.noun) if config.prior.knows_rooms else {}
    signs: dict[int, list[str]] = {}
    for one in around.remembered:
        kind = matcher.sign_of(one.label)
        room = around.room_of.get(one.entry_id, NO_GROUP)
        if kind is not None and room != NO_GROUP:
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
        numbers = numbers[numbers != NO_GROUP]
        room = int(np.bincount(numbers).argmax()) if numbers.size else NO_GROUP
        is_at_door = any(box_distance_m(door, frontier.position_m) <= AT_DOOR_M for door in doors)
        share = config.same_room_beyond_door if is_at_door else config.same_room_beyond
        factors[(around.owners == index) & around.unknown] = share * by_room.get(room, 1.0) + 1.0 - share
    return factors


@cache
def visible_range_m(noun: str) -> float:
    """Return the distance on the ground plane up to which a usual object of a type is large enough to be detected.

    Returns:
        Metres, for a camera with a field of view of 90 degrees; `inf` for a type without a known size.
    """
    sizes_m = np.array([size_m for _, category, size_m in _core.assets() if canonical(category) == noun])
    if len(sizes_m) == 0:
        return math.inf
    width_m, height_m, depth_m = np.median(sizes_m, axis=0).tolist()
    side_m2 = 0.5 * (width_m + depth_m) * height_m
    shown_m2 = side_m2 * math.cos(LOOK_DOWN_RAD) + width_m * depth_m * math.sin(LOOK_DOWN_RAD)
    range_m = math.sqrt(shown_m2 / (4.0 * MIN_MASK_SHARE))
    return math.sqrt(max(range_m**2 - DROP_M**2, 0.0))


def density_of(noun: str) -> float:
    """Return the usual number of objects of a type on a square metre."""
    return per_100_m2(noun) / 100.0


def prior_of(
    goal: ParsedGoal, around: Surroundings, sightings: Sequence[FarSighting], config: ProactiveConfig
) -> tuple[NDArray[np.float64], list[tuple[FarSighting, float]]]:
    """Return how many objects of the goal's type are to be expected at each place, weighted by how they fit the text.

    Args:
        sightings: Everything that was detected and is no entry.

    Returns:
        `(R, C)` expected numbers. Without a support in the text, they are the same in all cells. With one, most of
        their sum is shared equally by all supports of that type: those that are remembered or were seen from afar,
        and those that the unknown area should hold. And the supports that were seen from afar, each with its share.
    """
    frame, remembered, unknown = around.coarse.frame, around.remembered, around.unknown
    cell_m2 = frame.cell_m**2
    expected = np.full((frame.rows, frame.cols), density_of(goal.noun) * cell_m2)
    leads: list[tuple[FarSighting, float]] = []
    relations = [one for one in goal.relations if one.kind != "in" and not is_structure(one.noun)]
    if not config.uses_anchors:
        return expected, leads
    supports = [one.noun for one in relations if one.kind == "on"][:1]
    for noun in supports:
        known = [one for one in remembered if similarity(noun, one.label) >= 1.0]
        afar = [one for one in sightings if similarity(noun, one.label) >= 1.0]
        unseen_per_cell = density_of(noun) * cell_m2
        number = len(known) + len(afar) + unseen_per_cell * float(unknown.sum())
        share = config.on_support * float(expected.sum()) / max(number, config.min_supports)
        expected *= 1.0 - config.on_support
        expected[unknown] += share * unseen_per_cell
        for one in known:
            box = box_slices(one, frame, 0.0)
            expected[box] += share / max(1, expected[box].size)
        leads = [(one, share) for one in afar]
    for relation in relations:
        if relation.noun in supports:
            continue
        near = np.zeros(expected.shape, np.bool_)
        for one in remembered:
            if similarity(relation.noun, one.label) >= 1.0:
                near[box_slices(one, frame, config.anchor_m)] = True
        total = float(expected.sum())
        expected[near] *= config.anchor_ratio
        expected *= total / float(expected.sum())
    return expected, leads
