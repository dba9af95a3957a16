"""Count what a memory removes, adds, moves, forgets and doubles, given evidence."""

from dataclasses import dataclass, field

from evonav.memory_benchmark.metrics.change_f1 import ChangeCounts

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
    """Claims that something is gone, see `change_f1`."""
    come: ChangeCounts = field(default_factory=ChangeCounts)
    """Claims that something has come."""
