"""Score the probabilities that agents stated as stages began (defined in docs/metrics.md)."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from evonav.agents.agent import PlaceBelief
from evonav.evaluation.records.schema import BeliefRecord
from evonav.points import Point2, Point3

NUM_BINS = 10
"""Number of bins of the expected calibration error, all of the same width."""
MIN_P = 1e-4
"""Smallest probability in a logarithm: one certain mistake must not outweigh all other stages."""

_SLACK = 1e-6
"""More than the rounding errors of squared distances within a house, in square metres, and of sums."""


@dataclass(frozen=True, slots=True)
class PlaceScore:
    """A belief about places compared with the place of the target."""

    p_near: float
    """Probability of the squares whose middles are within the success radius of the target."""
    brier: float
    """Brier score of the squares and of all other places: from 0, for certainty that is right, to 2."""
    rank: int
    """Number of squares that are likelier than the target's own, plus 1; one more than all if it is in none."""
    top: float
    """Largest probability within the success radius of the middle of a square."""
    is_top_right: bool
    """Whether the target is within the success radius of that middle."""


@dataclass(frozen=True, slots=True)
class Calibration:
    """Scores of probabilities of which some came true."""

    n: int
    nll: float
    """Mean negative logarithm of the probability of what is true, in nats."""
    brier: float
    """Mean squared difference between probability and truth."""
    ece: float
    """Expected calibration error: mean gap between probability and share of truths, over `NUM_BINS` bins by size."""


def place_score(places: PlaceBelief, target_m: Point2, radius_m: float) -> PlaceScore:
    """Score a belief about places.

    Args:
        target_m: `(x, z)` of the target.
    """
    cells = list(zip(places.centres_m, places.probabilities, strict=True))
    p_near = math.fsum(p for centre_m, p in cells if math.dist(centre_m, target_m) < radius_m)
    half_m = places.cell_m / 2.0
    own = next((p for c, p in cells if max(abs(c[0] - target_m[0]), abs(c[1] - target_m[1])) <= half_m), None)
    rest = max(0.0, 1.0 - math.fsum(p for _, p in cells))
    squares = math.fsum(p * p for _, p in cells) + rest * rest
    brier = squares - 2.0 * (rest if own is None else own) + 1.0
    rank = 1 + (len(cells) if own is None else sum(p > own for _, p in cells))
    top, centre_m = max(
        ((_mass_within(cells, c, radius_m), c) for c in _likeliest(cells, radius_m)), default=(0.0, None)
    )
    is_right = centre_m is not None and math.dist(centre_m, target_m) < radius_m
    return PlaceScore(min(p_near, 1.0), brier, rank, min(top, 1.0), is_right)


def _mass_within(cells: Sequence[tuple[Point2, float]], centre_m: Point2, radius_m: float) -> float:
    return math.fsum(p for other_m, p in cells if math.dist(other_m, centre_m) < radius_m)


def _likeliest(cells: Sequence[tuple[Point2, float]], radius_m: float) -> list[Point2]:
    """Return the middles around which most probability may lie: all that rounding errors leave in question."""
    likely = [(centre_m, p) for centre_m, p in cells if p > 0.0]
    if not likely:
        return []
    centres_m, p = np.array([centre_m for centre_m, _ in likely]), np.array([p for _, p in likely])
    squares_m2 = (centres_m**2).sum(axis=1)
    least, most = np.empty(len(likely)), np.empty(len(likely))
    rows = max(1, 10**6 // len(likely))  # a few megabytes at a time
    for first in range(0, len(likely), rows):
        part = slice(first, first + rows)
        distances2_m2 = squares_m2[part, None] + squares_m2 - 2.0 * centres_m[part] @ centres_m.T
        least[part] = (distances2_m2 < radius_m**2 - _SLACK) @ p
        most[part] = (distances2_m2 < radius_m**2 + _SLACK) @ p
    return [likely[index][0] for index in np.flatnonzero(most > least.max() - _SLACK)]


def calibration(probabilities: Iterable[tuple[float, bool]]) -> Calibration | None:
    """Score probabilities, each with whether it came true; `None` without any."""
    pairs = list(probabilities)
    if not pairs:
        return None
    nll = math.fsum(-math.log(max(p if is_true else 1.0 - p, MIN_P)) for p, is_true in pairs)
    brier = math.fsum((p - is_true) ** 2 for p, is_true in pairs)
    bins: dict[int, list[tuple[float, bool]]] = {}
    for p, is_true in pairs:
        bins.setdefault(min(int(p * NUM_BINS), NUM_BINS - 1), []).append((p, is_true))
    gaps = (abs(math.fsum(p - is_true for p, is_true in part)) for part in bins.values())
    n = len(pairs)
    return Calibration(n, nll / n, brier / n, math.fsum(gaps) / n)


@dataclass(frozen=True, slots=True)
class BeliefSummary:
    """Scores of an agent's probabilities over all of its stages."""

    presence: Calibration | None
    """Scores of entries: whether their objects are still there."""
    num_placed: int
    """Stages with a belief about places; the next fields are means over them, and a median."""
    place_nll: float | None
    place_brier: float | None
    place_ece: float | None
    median_rank: float | None


def belief_summary(beliefs: Sequence[tuple[Point3, BeliefRecord]], radius_m: float) -> BeliefSummary:
    """Score an agent's probabilities over its stages, at a success radius.

    Args:
        beliefs: The target's position and the belief of each stage as which began the agent told one.
    """
    presence = calibration(pair for _, belief in beliefs for pair in belief.presence)
    scores = [place_score(b.places, (at[0], at[2]), radius_m) for at, b in beliefs if b.places is not None]
    n = len(scores)
    if n == 0:
        return BeliefSummary(presence, 0, None, None, None, None)
    tops = calibration((one.top, one.is_top_right) for one in scores)
    return BeliefSummary(
        presence,
        n,
        math.fsum(-math.log(max(one.p_near, MIN_P)) for one in scores) / n,
        math.fsum(one.brier for one in scores) / n,
        None if tops is None else tops.ece,
        median(one.rank for one in scores),
    )
