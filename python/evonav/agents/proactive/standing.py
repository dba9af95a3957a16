"""Choose where to stand: by an entry, or where the rounds end, with most of the posterior within reach."""

import math
from collections.abc import Sequence

import numpy as np

from evonav.agents.grid import CoarseFrame
from evonav.agents.proactive.posterior import Posterior, Surroundings
from evonav.agents.proactive.search import Option, shown_from, window_sums
from evonav.memory.occupancy import OccupancyMap
from evonav.points import Point2

Placed = Sequence[tuple[Point2, float]]
"""Places and their weights."""
ALIKE = 0.8
"""Share of the largest weight from which another one is as good."""
STOP_REACH_M, NUM_LIKELIEST = 1.8, 16
"""Distance within which an agent that stops has found the target, and number of places that are compared by it."""


def places_before(centre_m: Point2, coarse: CoarseFrame, around: Surroundings, within_m: float) -> list[Point2]:
    """Return the free places within a distance of another that no wall hides from it."""
    rows, cols = shown_from(centre_m, coarse, around.walls, within_m)
    is_free = around.free[rows, cols]
    return [coarse.frame.centre_m(row, col) for row, col in zip(rows[is_free], cols[is_free], strict=True)]


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


def likeliest_places(
    posterior: Posterior, placed: Sequence[tuple[Point2, float]], coarse: CoarseFrame, around: Surroundings
) -> list[Option]:
    """Return the places on the floor within whose reach most of the posterior is.

    Args:
        placed: Middles of entries and sightings, and their weights.
    """
    weights = posterior.moved + posterior.unseen
    for (x_m, z_m), weight in placed:
        row, col = coarse.frame.cell_at((x_m, z_m))
        weights[row, col] += weight
    half = max(1, round(STOP_REACH_M / math.sqrt(2.0) / coarse.frame.cell_m))
    sums = np.where(around.free, window_sums(weights, half), 0.0)
    found = []
    for _ in range(NUM_LIKELIEST):
        row, col = (int(one) for one in np.unravel_index(int(sums.argmax()), sums.shape))
        if sums[row, col] <= 0.0:
            break
        place = coarse.frame.centre_m(row, col)
        found.append(Option("place", row * coarse.frame.cols + col, place, place, float(sums[row, col]), 0.0))
        sums[max(0, row - half) : row + half + 1, max(0, col - half) : col + half + 1] = 0.0
    return found


def covered(placed: Sequence[tuple[Point2, float]], place_m: Point2) -> float:
    """Return the weight of what is within the reach of an agent that stops at a place."""
    return math.fsum(weight for centre_m, weight in placed if math.dist(centre_m, place_m) < STOP_REACH_M)


def best_entry(entries: Sequence[Option]) -> Option | None:
    """Return the nearest of the entries with about the largest weight."""
    top = max((one.gain for one in entries), default=0.0)
    good = [one for one in entries if one.gain >= ALIKE * top and one.gain > 0.0]
    return min(good, key=lambda one: (one.way_m, one.key), default=None)
