"""Count what a memory removes, adds, moves, forgets and doubles, and the changes that it claims."""

from collections.abc import Sequence
from dataclasses import dataclass, field
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


EVIDENCE_PX = 25
"""Pixels in one frame from which on it is evidence of an object that is detected in it, or of an empty place."""


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
