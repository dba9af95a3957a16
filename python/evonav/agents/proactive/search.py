"""Choose the next place: where most of the posterior is found a metre."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evonav.agents.grid import NO_GROUP, CoarseFrame, box_slices
from evonav.agents.proactive.config import ProactiveConfig
from evonav.agents.proactive.posterior import Posterior, Surroundings
from evonav.decision.candidates import ObjectCandidate
from evonav.memory.occupancy import BLOCKED, UNKNOWN, OccupancyMap
from evonav.points import Point2
from evonav.sensors.observation import MapFrame

FULL_KNOWN_SHARE = 0.5
"""Share of a coarse cell's map cells that must be unknown for it to count as unknown."""
SAME_PLACE_M = 0.75
"""Two rounds' options of one kind are the same if their places are this near: frontiers change with what is seen."""
NUM_SIGHT_SAMPLES = 8
"""Number of places on a line of sight that must not be in a wall."""
BESIDE_M = 0.25
"""Distance from an object's box within which blocked cells are its own: the agent fits nowhere there."""
UNREACHED = 1.5
"""Factor of the straight line to what no known floor leads to."""


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
    way_m: float
    is_reached: bool = True
    """Whether known floor leads there."""


def unknown_cells(
    coarse: CoarseFrame, blocks: NDArray[np.generic], remembered: Sequence[ObjectCandidate]
) -> NDArray[np.bool_]:
    """Return the `(R, C)` coarse cells that are unknown in most of their area and under nothing remembered.

    Args:
        blocks: The map's cells, as `CoarseFrame.taken` returns them.
    """
    unknown: NDArray[np.bool_] = (blocks == UNKNOWN).mean(axis=0) > FULL_KNOWN_SHARE
    for one in remembered:
        unknown[box_slices(one, coarse.frame, 0.0)] = False
    return unknown


def frontier_gains(posterior: Posterior, around: Surroundings) -> dict[int, float]:
    """Return the weight of what was never seen behind each frontier, by id."""
    is_owned = around.owners != NO_GROUP
    counts = np.bincount(around.owners[is_owned], posterior.unseen[is_owned], minlength=len(around.frontiers))
    return {frontier.id: gain for frontier, gain in zip(around.frontiers, counts.tolist(), strict=True)}


def places_to_search(
    weights: NDArray[np.float64], coarse: CoarseFrame, around: Surroundings, radius_m: float, config: ProactiveConfig
) -> list[tuple[int, Point2, Point2, float]]:
    """Return the places on the floor from which most can be searched.

    Args:
        weights: `(R, C)` of the posterior, of the coarse cells that can be searched.
        radius_m: Distance within which a place shows the target.

    Returns:
        Number of the coarse cell, place to stand, middle of what is found there, and its weight.
    """
    sums = np.where(around.free, window_sums(weights, max(1, round(0.8 * radius_m / coarse.frame.cell_m))), 0.0)
    spacing = max(1, round(SAME_PLACE_M / coarse.frame.cell_m) - 1)
    found = []
    for _ in range(config.num_places):
        row, col = (int(one) for one in np.unravel_index(int(sums.argmax()), sums.shape))
        if sums[row, col] <= 0.0:
            break
        sums[max(0, row - spacing) : row + spacing + 1, max(0, col - spacing) : col + spacing + 1] = 0.0
        eye = coarse.frame.centre_m(row, col)
        rows, cols = shown_from(eye, coarse, around.walls, radius_m)
        gains = weights[rows, cols]
        gain = float(gains.sum())
        if gain > 0.0:
            x_m, z_m = coarse.frame.centre_m(float(gains @ rows) / gain, float(gains @ cols) / gain)
            found.append((row * coarse.frame.cols + col, eye, (x_m, z_m), gain))
    return found


def window_sums(weights: NDArray[np.float64], half: int) -> NDArray[np.float64]:
    """Return the `(R, C)` sums over the square of `2 * half + 1` cells around each cell."""
    padded = np.pad(weights, ((half + 1, half), (half + 1, half))).cumsum(axis=0).cumsum(axis=1)
    size = 2 * half + 1
    sums: NDArray[np.float64] = (
        padded[size:, size:] - padded[:-size, size:] - padded[size:, :-size] + padded[:-size, :-size]
    )
    return sums


def shown_from(
    place_m: Point2, coarse: CoarseFrame, walls: NDArray[np.bool_], radius_m: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rows and columns of the coarse cells within a distance of a place that no wall hides from it.

    Args:
        walls: `(R, C)` cells of the agent's map that are blocked, and by nothing remembered.
    """
    frame = coarse.frame
    reach = math.ceil(radius_m / frame.cell_m)
    at_row, at_col = ((place_m[axis] - frame.corner_m[axis]) / frame.cell_m - 0.5 for axis in (1, 0))
    low_row, low_col = max(0, round(at_row) - reach), max(0, round(at_col) - reach)
    dy = np.arange(low_row, min(frame.rows, round(at_row) + reach + 1)) - at_row
    dx = np.arange(low_col, min(frame.cols, round(at_col) + reach + 1)) - at_col
    rows, cols = np.nonzero(dy[:, None] ** 2 + dx**2 <= (radius_m / frame.cell_m) ** 2)
    rows, cols = rows + low_row, cols + low_col
    along = np.linspace(0.15, 0.85, NUM_SIGHT_SAMPLES)[:, None]
    fine_rows = ((at_row + along * (rows - at_row) + 0.5) * coarse.step).astype(np.int64)
    fine_cols = ((at_col + along * (cols - at_col) + 0.5) * coarse.step).astype(np.int64)
    np.clip(fine_rows, 0, walls.shape[0] - 1, out=fine_rows)
    np.clip(fine_cols, 0, walls.shape[1] - 1, out=fine_cols)
    is_clear = ~walls.ravel().take(fine_rows * walls.shape[1] + fine_cols).any(axis=0)
    return rows[is_clear], cols[is_clear]


def walls_of(cells: NDArray[np.uint8], frame: MapFrame, remembered: Sequence[ObjectCandidate]) -> NDArray[np.bool_]:
    """Return the `(R, C)` blocked cells of the map that are not under or beside anything remembered."""
    walls: NDArray[np.bool_] = cells == BLOCKED
    for one in remembered:
        walls[box_slices(one, frame, BESIDE_M)] = False
    return walls


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
