"""DualMap's abstract map: furniture as anchors, each with the labels and features of what lay on it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evonav.agents.relatedness import Feature
from evonav.decision.candidates import ObjectCandidate
from evonav.memory.objects import ObjectEntry
from evonav.points import Point3

CONTENT_M = 0.1
"""Edge of the cube by which contents are described: their places are not remembered."""


@dataclass(frozen=True, slots=True)
class AnchorConfig:
    """DualMap's constants."""

    min_overlap: float = 0.8
    """Two anchors are the same if their footprints share this part of either one."""
    min_on: float = 0.8
    """A thing lies on another if this share of its footprint is over it..."""
    below_m: float = 0.1
    """...and the other's main plane is at most this far below its bottom..."""
    above_m: float = 0.2
    """...and at most this far above it."""
    plane_bin_m: float = 0.02
    """Height of the bins of which the fullest one is the main plane."""


@dataclass(frozen=True, slots=True)
class Content:
    """A thing that lay on an anchor, as the anchor remembers it."""

    entry_id: int
    """Id of the entry that it was."""
    label: str
    feature: Feature | None


@dataclass(frozen=True, slots=True)
class FurnitureAnchor:
    """A piece of furniture that stays in memory."""

    entry_id: int
    """Id of the entry that it was first."""
    label: str
    feature: Feature | None
    centre_m: Point3
    size_m: Point3
    plane_m: float
    """Height of its main plane."""
    contents: tuple[Content, ...] = ()

    def candidate(self, content: Content | None = None) -> ObjectCandidate:
        """Return the anchor, or one of its contents on the middle of it, as questions describe them."""
        if content is None:
            return ObjectCandidate(self.entry_id, self.label, self.centre_m, self.size_m, 1)
        centre_m = (self.centre_m[0], self.plane_m + CONTENT_M / 2, self.centre_m[2])
        return ObjectCandidate(content.entry_id, content.label, centre_m, (CONTENT_M,) * 3, 1)


class AbstractMap:
    """All anchors. None is ever removed, and no content either."""

    def __init__(self, config: AnchorConfig | None = None) -> None:
        self.config = config or AnchorConfig()
        self.anchors: dict[int, FurnitureAnchor] = {}
        """Anchors by id."""

    def add(self, entry: ObjectEntry, points_m: NDArray[np.float32]) -> None:
        """Add an entry of a piece of furniture, with its `(N, 3)` points, as an anchor without contents.

        If it overlaps an anchor of the same label, it is that one, which keeps its contents.
        """
        same = (one for one in self.anchors.values() if one.label == entry.label and self._overlaps(one, entry))
        known = next(same, None)
        plane_m = main_plane_m(points_m, self.config.plane_bin_m)
        anchor = FurnitureAnchor(entry.id, entry.label, entry.feature, entry.centre_m, entry.size_m, plane_m)
        if known is not None:
            anchor = replace(anchor, entry_id=known.entry_id, contents=known.contents)
        self.anchors[anchor.entry_id] = anchor

    def put(self, entry: ObjectEntry) -> bool:
        """Add an entry to the contents of the anchors that it lies on; return whether there is one."""
        below = [one for one in self.anchors.values() if self.lies_on(entry, one)]
        for anchor in below:
            self._put(anchor.entry_id, Content(entry.id, entry.label, entry.feature))
        return bool(below)

    def lies_on(self, upper: ObjectEntry, lower: FurnitureAnchor) -> bool:
        """Return whether an entry lies on an anchor, by their boxes and its main plane."""
        config, bottom_m = self.config, upper.centre_m[1] - upper.size_m[1] / 2
        is_level = bottom_m - config.below_m <= lower.plane_m <= bottom_m + config.above_m
        return is_level and _shared_m2(upper, lower) >= config.min_on * _footprint_m2(upper)

    def _put(self, anchor_id: int, content: Content) -> None:
        """Add a content; one with the same label takes its place."""
        anchor = self.anchors[anchor_id]
        others = tuple(one for one in anchor.contents if one.label != content.label)
        self.anchors[anchor_id] = replace(anchor, contents=(*others, content))

    def _overlaps(self, anchor: FurnitureAnchor, entry: ObjectEntry) -> bool:
        smaller_m2 = min(_footprint_m2(anchor), _footprint_m2(entry))
        return _shared_m2(anchor, entry) > self.config.min_overlap * smaller_m2


def main_plane_m(points_m: NDArray[np.float32], bin_m: float) -> float:
    """Return the height at which most of `(N, 3)` points lie, of equals the lowest: the middle of that bin."""
    bins = np.floor(points_m[:, 1].astype(np.float64) / bin_m).astype(np.int64)
    levels, counts = np.unique(bins, return_counts=True)
    return (float(levels[counts.argmax()]) + 0.5) * bin_m


def _footprint_m2(one: ObjectEntry | FurnitureAnchor) -> float:
    return one.size_m[0] * one.size_m[2]


def _shared_m2(one: ObjectEntry | FurnitureAnchor, other: ObjectEntry | FurnitureAnchor) -> float:
    """Return the area that two boxes share on the ground plane."""
    sides_m = []
    for axis in (0, 2):
        low_m = max(thing.centre_m[axis] - thing.size_m[axis] / 2 for thing in (one, other))
        high_m = min(thing.centre_m[axis] + thing.size_m[axis] / 2 for thing in (one, other))
        sides_m.append(max(0.0, high_m - low_m))
    return sides_m[0] * sides_m[1]
