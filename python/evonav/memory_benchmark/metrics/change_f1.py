"""Change F1 on robot time x query time.

Source: Khronos (Schmid et al., RSS 2024), `computeChangeMetrics` of its `object_evaluator.cpp`: an object has appeared
or disappeared up to a query time, as the map of a robot time tells it; the counts of both are added. Two things differ
here. A memory of this benchmark answers what it believes now and keeps no record of what is gone, so what it believed
at the query time is what it answered then. And objects are matched by the definition of *stale*, not by votes of
surface points within 2 m.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

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
