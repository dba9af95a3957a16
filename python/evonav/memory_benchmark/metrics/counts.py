"""Count what a memory removes, adds, moves, forgets and doubles, how sure it was of it, and where it finds things."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evonav.evaluation.episode.staleness import distance_to_box_m
from evonav.memory_benchmark.protocol import FoundPlace
from evonav.world.simulator import SceneObject

PlaceKey = tuple[str, int]
"""An object at one of its places: its id, and how often it had moved before."""


@dataclass(frozen=True, slots=True)
class BeliefSnapshot:
    """The state at the end of a visit, or before a change in the middle of one."""

    believed: frozenset[PlaceKey]
    """Places at which the memory has an entry."""
    present: frozenset[PlaceKey]
    """Places at which the objects stand."""
    seen: frozenset[PlaceKey]
    """Places at which the object was seen so far."""
    seen_empty: frozenset[PlaceKey]
    """Left places that were seen empty so far."""
    taken: frozenset[PlaceKey] = frozenset()
    """Left places at which another object of the label stands: entries there are no claims about the one that left."""


@dataclass(slots=True)
class ChangeCounts:
    """Claims of one sort: that something is gone, or that it has come."""

    hits: int = 0
    false_alarms: int = 0
    misses: int = 0


def change_counts(snapshots: Sequence[BeliefSnapshot]) -> tuple[ChangeCounts, ChangeCounts]:
    """Count changes that a memory claims truly, falsely and not at all, over all pairs of query time < robot time.

    Source: Khronos (Schmid et al., RSS 2024), `computeChangeMetrics` of its `object_evaluator.cpp`: an object has
    appeared or disappeared up to a query time, as the map of a robot time has it; the counts of both are added. Two
    things differ here. A memory of this benchmark answers what it believes now and keeps no record of what is gone,
    so what it believed at the query time is what it answered then. And objects are matched by the definition of
    *stale*, not by votes of surface points within 2 m.

    A claim is a place that the memory believed in at one of the two times only. A change that was not claimed is
    counted if there was evidence of it by the robot time.

    Returns:
        Counts of what is gone, and of what has come.
    """
    gone, come = ChangeCounts(), ChangeCounts()
    for query, robot in combinations(snapshots, 2):
        known = query.believed & query.present - robot.taken
        claimed_gone = known - robot.believed
        gone.hits += len(claimed_gone - robot.present)
        gone.false_alarms += len(claimed_gone & robot.present)
        gone.misses += len((known & robot.believed & robot.seen_empty) - robot.present)
        claimed_come = (robot.believed - query.believed) & robot.present
        come.hits += len(claimed_come - query.present)
        # What was never seen before the query time is a discovery, and no claim of a change.
        come.false_alarms += len(claimed_come & query.present & query.seen)
        come.misses += len(((robot.present - query.present) & robot.seen) - robot.believed)
    return gone, come


@dataclass(slots=True)
class UpdateCounts:
    """Counts of one stream; each change is judged at the end of the visit in which its evidence came."""

    removals: int = 0
    """Objects that left a place which the memory had an entry at, and which was then seen empty."""
    removals_done: int = 0
    """Those of them whose entry was gone."""
    additions: int = 0
    """Added objects that were seen."""
    additions_done: int = 0
    """Those of them with a right entry."""
    moves: int = 0
    """Moved objects that the memory had, and of which the old place was seen empty and the object at its new place."""
    moves_done: int = 0
    """Those of them with one entry at the new place, and none at the old one."""
    standing: int = 0
    """Objects with a right entry, times visits: an object counts for a visit if it had one in it, or just before it."""
    false_forgets: int = 0
    """Those of them whose right entry was lost in the visit, although the object stood where it stood."""
    false_forgets_at_end: int = 0
    """Those of the lost ones that had none at the end of the visit either."""
    entries: int = 0
    """Entries at the ends of all visits."""
    right_entries: int = 0
    """Those of them that are right."""
    seen: int = 0
    """Objects seen so far where they stand, at the ends of all visits."""
    seen_remembered: int = 0
    """Those of them with a right entry."""
    remembered: int = 0
    """Objects with a right entry, at the ends of all visits."""
    duplicates: int = 0
    """Right entries beyond an object's first, at the ends of all visits."""
    gone: ChangeCounts = field(default_factory=ChangeCounts)
    """Claims that something is gone, see `change_counts`."""
    come: ChangeCounts = field(default_factory=ChangeCounts)
    """Claims that something has come."""


NUM_BINS = 10
"""Bins of the calibration error, of equal width."""
LEAST_P = 1e-6
"""Probabilities are kept this far from 0 and 1 in the logarithmic score."""


@dataclass(slots=True)
class BeliefScore:
    """Sums over entries with a `p_present`, at the first and the last answer of each visit.

    An entry is right if it is matched with an object, by the definition of *stale*.
    """

    n: int = 0
    squared_error: float = 0.0
    """Sum of (p - right)^2; by `n`, the Brier score (Brier, Monthly Weather Review 1950)."""
    log_loss: float = 0.0
    """Sum of -log of the probability given to what is so; by `n`, the NLL in nats."""
    bins: list[list[float]] = field(default_factory=lambda: [[0.0, 0.0, 0.0] for _ in range(NUM_BINS)])
    """Entries, sum of their probabilities and right ones, by probability."""

    def take(self, p: NDArray[np.float64], is_right: NDArray[np.bool_]) -> None:
        """Add entries.

        Args:
            p: `(N,)` probabilities.
            is_right: `(N,)`.
        """
        right = is_right.astype(np.float64)
        self.n += len(p)
        self.squared_error += float(np.sum((p - right) ** 2))
        inside = np.clip(p, LEAST_P, 1.0 - LEAST_P)
        self.log_loss -= float(np.sum(np.where(right == 1.0, np.log(inside), np.log1p(-inside))))
        sums = np.array(self.bins)
        bins = np.minimum((p * NUM_BINS).astype(np.intp), NUM_BINS - 1)
        np.add.at(sums, bins, np.column_stack([np.ones(len(p)), p, right]))
        self.bins = sums.tolist()


def calibration_error(bins: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the expected calibration error: the mean distance of bin means from the share of right entries.

    Source: Naeini et al., AAAI 2015.

    Args:
        bins: `(..., NUM_BINS, 3)`, see `BeliefScore.bins`.

    Returns:
        `(...)`; NaN without entries.
    """
    total = bins[..., 0].sum(axis=-1)
    gap = np.abs(bins[..., 1] - bins[..., 2]).sum(axis=-1)
    error: NDArray[np.float64] = np.divide(gap, total, out=np.full_like(total, np.nan), where=total > 0)
    return error


HIT_M = 1.0
"""Distance from a place to an object's box up to which the place is a hit."""
NUM_PLACES = 5
"""Places that are asked for."""

QueryState = Literal["before", "after", "after_evidence"]
"""Whether an object of the label has changed so far, and whether there was evidence of all of these changes."""


@dataclass(slots=True)
class QueryCounts:
    """Counts of the questions of one state."""

    n: int = 0
    hits_at_1: int = 0
    hits_at_5: int = 0
    reciprocal_ranks: float = 0.0
    """Sum of 1 / rank of the first true place; 0 for an answer without one."""

    def take(self, objects: Sequence[SceneObject], places: Sequence[FoundPlace]) -> None:
        """Add the answer to a question.

        Args:
            objects: All that the question names, where it stands now.
            places: The answer, the best first.
        """
        ranks = (
            rank
            for rank, place in enumerate(places, start=1)
            if any(distance_to_box_m(place.position_m, body) <= HIT_M for body in objects)
        )
        self.n += 1
        if (rank := next(ranks, None)) is not None:
            self.hits_at_1 += rank == 1
            self.hits_at_5 += rank <= NUM_PLACES
            self.reciprocal_ranks += 1.0 / rank
