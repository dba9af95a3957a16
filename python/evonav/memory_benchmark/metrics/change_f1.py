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
class Snapshot:
    """The state at the end of a visit."""

    believed: frozenset[PlaceKey]
    """Places at which the memory has an entry."""
    present: frozenset[PlaceKey]
    """Places at which the objects stand."""
    seen: frozenset[PlaceKey]
    """Places at which the object was seen so far."""
    seen_empty: frozenset[PlaceKey]
    """Left places that were seen empty so far."""


def change_counts(snapshots: Sequence[Snapshot]) -> tuple[int, int, int]:
    """Count changes that a memory claims truly, falsely and not at all, over all pairs of query time < robot time.

    A claim is a place that the memory believed in at one of the two times only. A change that was not claimed is
    counted if there was evidence of it by the robot time.

    Returns:
        True positives, false positives and false negatives.
    """
    hits = false_alarms = misses = 0
    for query, robot in combinations(snapshots, 2):
        claimed_gone = (query.believed - robot.believed) & query.present
        hits += len(claimed_gone - robot.present)
        false_alarms += len(claimed_gone & robot.present)
        still_believed = query.believed & robot.believed & query.present
        misses += len((still_believed - robot.present) & robot.seen_empty)
        claimed_new = (robot.believed - query.believed) & robot.present
        hits += len(claimed_new - query.present)
        # What was never seen before the query time is a discovery, and no claim of a change.
        false_alarms += len(claimed_new & query.present & query.seen)
        misses += len(((robot.present - query.present) & robot.seen) - robot.believed)
    return hits, false_alarms, misses
