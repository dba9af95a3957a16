"""Choose the next place: where most of the posterior is found a metre."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evonav.agents.proactive.config import ProactiveConfig
from evonav.agents.proactive.posterior import Posterior
from evonav.agents.proactive.rooms import NO_ROOM, grown
from evonav.agents.proactive.searched import CoarseFrame
from evonav.decision.candidates import Point2
from evonav.memory import Frontier
from evonav.memory.occupancy import BLOCKED, FREE, UNKNOWN, OccupancyMap

FRONTIER_REACH_M = 3.0
"""Number of steps over unknown cells, times their edge, up to which they count as behind a frontier."""
SAME_PLACE_M = 0.75
"""Two rounds' options of one kind are the same if their places are this near: frontiers change with what is seen."""
UNREACHED = 1.5
"""Factor of the straight line to what no known floor leads to."""


@dataclass(frozen=True, slots=True)
class Option:
    """A place to go to."""

    kind: Literal["object", "frontier", "place"]
    key: int
    """Id of an entry or a frontier, or number of a coarse cell."""
    position_m: Point2
    """Place to stand."""
    face_m: Point2
    gain: float
    """Weight of the posterior that is found there."""
    way_m: float
    is_reached: bool = True
    """Whether known floor leads there."""


def frontier_gains(
    posterior: Posterior, coarse: CoarseFrame, cells: NDArray[np.uint8], frontiers: Sequence[Frontier]
) -> dict[int, float]:
    """Return the weight of what may be seen from each frontier, by id.

    Args:
        posterior: Weights of the coarse cells.
        coarse: Their grid.
        cells: `(R, C)` of the agent's map.
        frontiers: The frontiers.

    Returns:
        The weight of the coarse cells of a frontier's region, and of the unknown ones beyond it that can be reached
        without crossing a blocked cell; each counts for the frontier from which it is reached first.
    """
    owners = np.full(posterior.unknown.shape, NO_ROOM, np.int32)
    for index, frontier in enumerate(frontiers):
        owners[frontier.cells[:, 0] // coarse.step, frontier.cells[:, 1] // coarse.step] = index
    is_open = posterior.unknown & (coarse.taken(cells, UNKNOWN) != BLOCKED).all(axis=2)
    owners = grown(owners, is_open, round(FRONTIER_REACH_M / coarse.frame.cell_m))
    is_owned = owners != NO_ROOM
    sums = np.bincount(owners[is_owned], posterior.unseen[is_owned], minlength=len(frontiers)).tolist()
    return {frontier.id: gain for frontier, gain in zip(frontiers, sums, strict=True)}


def places_to_search(
    posterior: Posterior,
    coarse: CoarseFrame,
    cells: NDArray[np.uint8],
    rooms: NDArray[np.int32],
    config: ProactiveConfig,
) -> list[tuple[int, Point2, Point2, float]]:
    """Return places on the floor from which cells of the same room can be searched.

    Args:
        posterior: Weights of the cells.
        coarse: The grid of the weights.
        cells: `(R, C)` of the agent's map.
        rooms: `(R, C)` room of each cell of the map.
        config: The agent's parameters.

    Returns:
        Number of the coarse cell, place to stand, middle of what is found there, and its weight.
    """
    is_free = (coarse.taken(cells, 0) == FREE).all(axis=2)
    rows, cols = np.nonzero(is_free)
    if len(rows) == 0:
        return []
    step = max(1, math.ceil(math.sqrt(len(rows) / config.num_places)))
    on_lattice = (rows % step == step // 2) & (cols % step == step // 2)
    rows, cols = (rows[on_lattice], cols[on_lattice]) if on_lattice.any() else (rows[:1], cols[:1])
    weights = np.where(posterior.unknown, 0.0, posterior.moved + posterior.unseen)
    room = np.asarray(coarse.taken(rooms, -1).max(axis=2))
    others = np.nonzero(weights > 0.0)
    centres_m = coarse.centres_m()
    eyes_m, seen_m = centres_m[rows, cols], centres_m[others]
    dx_m, dz_m = (seen_m[None, :, axis] - eyes_m[:, None, axis] for axis in (0, 1))
    shown = dx_m * dx_m + dz_m * dz_m <= config.search_radius_m**2
    shown &= (room[others][None] == room[rows, cols][:, None]) | (room[others][None] == NO_ROOM)
    gains = shown * weights[others][None]
    sums = gains.sum(axis=1)
    middles = np.einsum("es,sk->ek", gains, seen_m) / np.maximum(sums, 1e-300)[:, None]
    numbers = (rows * coarse.frame.cols + cols).tolist()
    return [
        (number, (eye[0], eye[1]), (middle[0], middle[1]), gain)
        for number, eye, middle, gain in zip(numbers, eyes_m.tolist(), middles.tolist(), sums.tolist(), strict=True)
        if gain > 0.0
    ]


def shown_from(place_m: Point2, coarse: CoarseFrame, rooms: NDArray[np.int32], radius_m: float) -> NDArray[np.bool_]:
    """Return the `(R, C)` coarse cells within a distance of a place that are in its room, or in none."""
    room = np.asarray(coarse.taken(rooms, NO_ROOM).max(axis=2))
    frame = coarse.frame
    row = min(max(int((place_m[1] - frame.corner_m[1]) / frame.cell_m), 0), frame.rows - 1)
    col = min(max(int((place_m[0] - frame.corner_m[0]) / frame.cell_m), 0), frame.cols - 1)
    gaps_m = np.hypot(*np.moveaxis(coarse.centres_m() - np.array(place_m), -1, 0))
    shown: NDArray[np.bool_] = (gaps_m <= radius_m) & ((room == room[row, col]) | (room == NO_ROOM))
    return shown


def with_ways(occupancy: OccupancyMap, here_m: Point2, options: Sequence[Option]) -> list[Option]:
    """Return options with the lengths of their ways over known floor."""
    if not options:
        return []
    ways_m = occupancy.distances_m(here_m, np.array([one.position_m for one in options])).tolist()
    found = []
    for one, way_m in zip(options, ways_m, strict=True):
        is_reached = math.isfinite(way_m)
        length_m = way_m if is_reached else UNREACHED * math.dist(here_m, one.position_m)
        found.append(Option(one.kind, one.key, one.position_m, one.face_m, one.gain, length_m, is_reached))
    return found


def best_option(
    options: Sequence[Option], last: Option | None, abandoned: Sequence[Option], config: ProactiveConfig
) -> Option | None:
    """Return the option with the largest gain a metre; the last one is kept unless another is clearly better.

    Args:
        options: The options.
        last: The last round's option.
        abandoned: Options from which the agent turned away before it was there.
        config: The agent's parameters.
    """

    def rate(one: Option) -> float:
        bonus = 1.0 + config.keep if config.keeps_choice and is_same(one, last) else 1.0
        malus = config.abandoned ** sum(is_same(one, other) for other in abandoned) if config.keeps_choice else 1.0
        return one.gain / (one.way_m + config.near_m) * bonus * malus

    return max(options, key=lambda one: (rate(one), -one.way_m, -one.key), default=None)


def is_same(one: Option, last: Option | None) -> bool:
    """Return whether two rounds' options are the same place."""
    return last is not None and one.kind == last.kind and math.dist(one.position_m, last.position_m) <= SAME_PLACE_M
