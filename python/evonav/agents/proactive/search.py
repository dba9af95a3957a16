"""Choose the next place: where most of the posterior is found a metre."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evonav.agents.grid import NO_GROUP
from evonav.agents.proactive.config import ProactiveConfig
from evonav.agents.proactive.maps import shown_from
from evonav.agents.proactive.posterior import Posterior, Surroundings
from evonav.memory.occupancy import OccupancyMap
from evonav.points import Point2

SAME_PLACE_M = 0.75
"""Two rounds' options of one kind are the same if their places are this near: frontiers change with what is seen."""
UNREACHED = 1.5
"""Factor of the straight line to what no known floor leads to."""
Placed = Sequence[tuple[Point2, float]]
"""Places and their weights."""
ALIKE = 0.8
"""Share of the largest weight from which another one is as good."""
STOP_REACH_M, NUM_LIKELIEST = 1.8, 16
"""Distance within which an agent that stops has found the target, and number of places that are compared by it."""


@dataclass(frozen=True, slots=True)
class Option:
    """A place to go to."""

    kind: Literal["object", "frontier", "place", "sighting"]
    key: int
    """Id of an entry or a frontier, number of a coarse cell, or of a sighting."""
    position_m: Point2
    """Place to stand."""
    face_m: Point2
    gain: float
    """Weight of the posterior that is found there."""
    way_m: float = 0.0
    is_reached: bool = True
    """Whether known floor leads there."""


def frontier_gains(posterior: Posterior, around: Surroundings) -> dict[int, float]:
    """Return the weight of what was never seen behind each frontier, by id."""
    is_owned = around.owners != NO_GROUP
    counts = np.bincount(around.owners[is_owned], posterior.unseen[is_owned], minlength=len(around.frontiers))
    return {frontier.id: gain for frontier, gain in zip(around.frontiers, counts.tolist(), strict=True)}


def places_to_search(
    weights: NDArray[np.float64], around: Surroundings, radius_m: float, config: ProactiveConfig
) -> list[tuple[int, Point2, Point2, float]]:
    """Return the places on the floor from which most can be searched.

    Args:
        weights: `(R, C)` of the posterior, of the coarse cells that can be searched.
        radius_m: Distance within which a place shows the target.

    Returns:
        Number of the coarse cell, place to stand, middle of what is found there, and its weight.
    """
    coarse = around.coarse
    sums = np.where(around.free, window_sums(weights, max(1, round(0.8 * radius_m / coarse.frame.cell_m))), 0.0)
    found = []
    for row, col, _ in _peaks(sums, config.num_places, max(1, round(SAME_PLACE_M / coarse.frame.cell_m) - 1)):
        eye = coarse.frame.centre_m(row, col)
        rows, cols = shown_from(eye, coarse, around.walls, radius_m)
        gains = weights[rows, cols]
        gain = float(gains.sum())
        if gain > 0.0:
            x_m, z_m = coarse.frame.centre_m(float(gains @ rows) / gain, float(gains @ cols) / gain)
            found.append((row * coarse.frame.cols + col, eye, (x_m, z_m), gain))
    return found


def _peaks(sums: NDArray[np.float64], max_num: int, half: int) -> Iterator[tuple[int, int, float]]:
    """Yield row, column and value of the largest positive sums, none of them within `half` cells of one before."""
    for _ in range(max_num):
        row, col = divmod(int(sums.argmax()), sums.shape[1])
        largest = float(sums[row, col])
        if largest <= 0.0:
            return
        sums[max(0, row - half) : row + half + 1, max(0, col - half) : col + half + 1] = 0.0
        yield row, col, largest


def window_sums(weights: NDArray[np.float64], half: int) -> NDArray[np.float64]:
    """Return the `(R, C)` sums over the square of `2 * half + 1` cells around each cell."""
    padded = np.pad(weights, ((half + 1, half), (half + 1, half))).cumsum(axis=0).cumsum(axis=1)
    size = 2 * half + 1
    sums: NDArray[np.float64] = (
        padded[size:, size:] - padded[:-size, size:] - padded[size:, :-size] + padded[:-size, :-size]
    )
    return sums


def with_ways(occupancy: OccupancyMap, here_m: Point2, options: Sequence[Option]) -> list[Option]:
    """Return options with the lengths of their ways over known floor."""
    if not options:
        return []
    ways_m = occupancy.distances_m(here_m, np.array([one.position_m for one in options])).tolist()
    found = []
    for one, way_m in zip(options, ways_m, strict=True):
        is_reached = math.isfinite(way_m)
        length_m = way_m if is_reached else UNREACHED * math.dist(here_m, one.position_m)
        found.append(replace(one, way_m=length_m, is_reached=is_reached))
    return found


def best_option(
    options: Sequence[Option], last: Option | None, abandoned: Sequence[Option], config: ProactiveConfig
) -> Option | None:
    """Return the option with the largest gain a metre; the last one is kept unless another is clearly better.

    Args:
        abandoned: Options from which the agent turned away before it was there.
    """

    def rate(one: Option) -> float:
        bonus = 1.0 + config.keep if config.keeps_choice and is_same(one, last) else 1.0
        malus = config.abandoned ** sum(is_same(one, other) for other in abandoned) if config.keeps_choice else 1.0
        return one.gain / (one.way_m + config.near_m) * bonus * malus

    return max(options, key=lambda one: (rate(one), -one.way_m, -one.key), default=None)


def is_same(one: Option, last: Option | None) -> bool:
    """Return whether two rounds' options are the same place."""
    return last is not None and one.kind == last.kind and math.dist(one.position_m, last.position_m) <= SAME_PLACE_M


def places_before(centre_m: Point2, around: Surroundings, within_m: float) -> list[Point2]:
    """Return the free places within a distance of another that no wall hides from it."""
    rows, cols = shown_from(centre_m, around.coarse, around.walls, within_m)
    is_free = around.free[rows, cols]
    return [around.coarse.frame.centre_m(row, col) for row, col in zip(rows[is_free], cols[is_free], strict=True)]


def place_by(places: Sequence[Point2], placed: Placed, occupancy: OccupancyMap, here_m: Point2) -> Point2 | None:
    """Return the place with most of the posterior within reach, and of those about as good the nearest.

    Args:
        placed: Middles of the entries with the goal's name, and their weights.

    Returns:
        `(x, z)`; `None` if no known floor leads there.
    """
    if not places:
        return None
    shares = [covered(placed, place) for place in places]
    good = [place for place, share in zip(places, shares, strict=True) if share >= ALIKE * max(shares)]
    way_m, place = min(zip(occupancy.distances_m(here_m, np.array(good)).tolist(), good, strict=True))
    return place if math.isfinite(way_m) else None


def likeliest_places(posterior: Posterior, placed: Placed, around: Surroundings) -> list[Option]:
    """Return the places on the floor within whose reach most of the posterior is.

    Args:
        placed: Middles of entries and sightings, and their weights.
    """
    frame, weights = around.coarse.frame, posterior.moved + posterior.unseen
    for place_m, weight in placed:
        weights[frame.cell_at(place_m)] += weight
    half = max(1, round(STOP_REACH_M / math.sqrt(2.0) / frame.cell_m))
    sums = np.where(around.free, window_sums(weights, half), 0.0)
    found = []
    for row, col, gain in _peaks(sums, NUM_LIKELIEST, half):
        place = frame.centre_m(row, col)
        found.append(Option("place", row * frame.cols + col, place, place, gain))
    return found


def covered(placed: Placed, place_m: Point2) -> float:
    """Return the weight of what is within the reach of an agent that stops at a place."""
    return math.fsum(weight for centre_m, weight in placed if math.dist(centre_m, place_m) < STOP_REACH_M)


def best_entry(entries: Sequence[Option]) -> Option | None:
    """Return the nearest of the entries with about the largest weight."""
    top = max((one.gain for one in entries), default=0.0)
    good = [one for one in entries if one.gain >= ALIKE * top and one.gain > 0.0]
    return min(good, key=lambda one: (one.way_m, one.key), default=None)
