"""Match all entries of a memory with the objects of a house at once, by the definition of *stale*.

The definition is `evonav.evaluation.episode.staleness.matched_object`; this is its vectorised form, for a judge that
asks after every frame.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from evonav.evaluation.episode.staleness import STALE_MARGIN_M
from evonav.tasks.language import STRUCTURE_TYPES
from evonav.world.simulator import SceneObject

NONE = -1
"""Match of a stale entry."""
_BLOCK = 20_000
"""Entries that are matched at a time: a memory may answer a hundred thousand."""


class BodyBoxes:
    """The boxes of some bodies, by label."""

    def __init__(self, bodies: Sequence[SceneObject]) -> None:
        """Index the bodies; doors and windows are left out."""
        self.bodies = tuple(body for body in bodies if body.category not in STRUCTURE_TYPES)
        self.centres_m = np.array([body.centre_m for body in self.bodies], np.float64).reshape(-1, 3)
        self.half_sizes_m = np.array([body.size_m for body in self.bodies], np.float64).reshape(-1, 3) / 2.0
        by_label: dict[str, list[int]] = {}
        for index, body in enumerate(self.bodies):
            by_label.setdefault(body.category, []).append(index)
        self._of_label = {label: np.array(indices) for label, indices in by_label.items()}
        # A memory is asked frame by frame, and its labels seldom change in between.
        self._last_labels: tuple[str, ...] = ()
        self._last_pairs = self._pairs_of(())

    def __len__(self) -> int:
        """Return the number of bodies."""
        return len(self.bodies)

    def pairs(
        self, labels: Sequence[str], centres_m: NDArray[np.float64]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
        """Return all pairs of an entry and a body of its label, and their distance.

        Args:
            labels: `N` labels.
            centres_m: `(N, 3)`.

        Returns:
            `(P,)` indices of entries in ascending order, `(P,)` indices of bodies, and `(P,)` distances from the centre
            to the box, 0 inside.
        """
        if (names := tuple(labels)) != self._last_labels:
            self._last_labels, self._last_pairs = names, self._pairs_of(names)
        entries, bodies = self._last_pairs
        gaps_m = np.abs(centres_m[entries] - self.centres_m[bodies]) - self.half_sizes_m[bodies]
        gaps_m = np.maximum(gaps_m, 0.0)
        return entries, bodies, np.sqrt(np.einsum("ij,ij->i", gaps_m, gaps_m))

    def _pairs_of(self, labels: tuple[str, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        none = np.empty(0, np.intp)
        candidates = [self._of_label.get(label, none) for label in labels]
        sizes = np.fromiter(map(len, candidates), np.intp, len(candidates))
        return np.repeat(np.arange(len(candidates)), sizes), np.concatenate([none, *candidates])

    def match(
        self, labels: Sequence[str], centres_m: NDArray[np.float64]
    ) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Match entries with bodies.

        Args:
            labels: `N` labels.
            centres_m: `(N, 3)` centres.

        Returns:
            `(N,)` index of the body of each entry, `NONE` for a stale entry; and `(M,)` whether each body has an entry
            of its label within `STALE_MARGIN_M`, even if another body is nearer to that entry.
        """
        matches = np.full(len(labels), NONE, np.intp)
        is_covered = np.zeros(len(self), np.bool_)
        for start in range(0, len(labels), _BLOCK):
            block = slice(start, start + _BLOCK)
            entries, bodies, distances_m = self.pairs(labels[block], centres_m[block])
            is_near = distances_m <= STALE_MARGIN_M
            entries, bodies, distances_m = entries[is_near], bodies[is_near], distances_m[is_near]
            is_covered[bodies] = True
            offsets_m = centres_m[block][entries] - self.centres_m[bodies]
            order = np.lexsort((np.einsum("ij,ij->i", offsets_m, offsets_m), distances_m, entries))
            first = np.unique(entries[order], return_index=True)[1]
            matches[start + entries[order][first]] = bodies[order][first]
        return matches, is_covered
