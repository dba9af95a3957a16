"""Candidates of 3D-Mem's questions, and the choice among them."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from evonav.decision.candidates import ObjectCandidate, Pixels


@dataclass(frozen=True, slots=True)
class SnapshotCandidate:
    """A stored view, and those of its objects whose class passed the prefilter."""

    view_id: int
    objects: Sequence[ObjectCandidate]
    """The objects, at least one; their crops are from this view."""
    image: Pixels | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class SnapshotChoice:
    """An object of a snapshot, or, without a snapshot, a frontier, by the question's indices."""

    snapshot: int | None
    index: int
