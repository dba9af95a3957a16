"""The reference memories: an object map with each forgetting rule, and a list in plain NumPy.

They are given frames alone, as every memory is; none knows the truth.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from evonav.memory import forgetting
from evonav.memory.objects import ObjectEntry, ObjectMap, ObjectMapConfig
from evonav.memory_benchmark.protocol import FoundPlace, MemoryEntry, MemoryFrame, StreamInfo
from evonav.points import Point3
from evonav.world.camera import unproject

SEEN_BYTES = 150
"""Approximate size of an entry with two numbers in a dictionary of Python."""


class ObjectMapMemory:
    """An `ObjectMap` with a forgetting rule, which alone decides what is forgotten."""

    def __init__(self, rule: str, *, min_detections: int = 1, **options: object) -> None:
        """Choose the rule.

        Args:
            rule: A key of `forgetting.RULES`.
            min_detections: Entries with fewer detections are dropped at the map's clean-up if the camera is far; 2 as
                in agents' maps, 1 for none.
            options: The rule's options.

        Raises:
            InvalidArgumentError: There is no such rule, or it has no such option.
        """
        self._make_rule = partial(forgetting.make, rule, **options)
        self.rule = self._make_rule()
        self.map = ObjectMap(ObjectMapConfig(min_detections=min_detections))
        self._seen_s: dict[int, tuple[float, float]] = {}
        """Times of the first and the last frame that supports each entry."""

    def reset(self, info: StreamInfo) -> None:
        """Begin with an empty map."""
        self.rule, self.map, self._seen_s = self._make_rule(), ObjectMap(self.map.config), {}

    def visit(self, time_s: float) -> None:
        """Begin a visit."""
        self._drop(self.rule.begin_visit(self.map, time_s))

    def observe(self, frame: MemoryFrame) -> None:
        """Merge the detections of a frame into the map, then forget."""
        update, time_s = self.map.update(frame.view), frame.time_s
        for gone, became in update.merged:
            first_s, last_s = self._seen_s.pop(gone, (time_s, time_s))
            other = self._seen_s.get(became, (first_s, last_s))
            self._seen_s[became] = (min(first_s, other[0]), max(last_s, other[1]))
        self._drop(update.removed)
        for entry_id in update.entry_ids:
            if entry_id is not None:
                self._seen_s[entry_id] = (self._seen_s.get(entry_id, (time_s,))[0], time_s)
        self._drop(self.rule.after_update(self.map, frame.view, update, time_s))

    def _drop(self, entry_ids: Sequence[int]) -> None:
        for entry_id in entry_ids:
            self._seen_s.pop(entry_id, None)

    def entries(self) -> list[MemoryEntry]:
        """Return the entries of the map."""
        return [
            MemoryEntry(
                entry_id=entry.id,
                label=entry.label,
                centre_m=entry.centre_m,
                size_m=entry.size_m,
                confidence=entry.confidence,
                p_present=self.rule.p_present(entry.id),
                first_seen_s=self._seen_s[entry.id][0],
                last_seen_s=self._seen_s[entry.id][1],
            )
            for entry in self.map.entries
        ]

    def locate(self, text: str, k: int) -> list[FoundPlace]:
        """Return the entries with this label, those most probably present first, of equals those seen last."""
        found = [entry for entry in self.map.entries if entry.label == text]
        ranked = sorted(found, key=lambda entry: (-self._score(entry), -self._seen_s[entry.id][1], entry.id))
        return [FoundPlace(entry.centre_m, self._score(entry)) for entry in ranked[:k]]

    def _score(self, entry: ObjectEntry) -> float:
        p = self.rule.p_present(entry.id)
        return entry.confidence if p is None else p

    def num_bytes(self) -> int:
        """Return the bytes of the map, and about those of the times."""
        return self.map.num_bytes() + SEEN_BYTES * len(self._seen_s)


class NumpyList:
    """A list of places by label: a detection joins the nearest entry of its label within 0.5 m.

    This is what one writes in an afternoon, in plain NumPy: no clouds, nothing is ever forgotten, and every detection
    is compared with every entry.
    """

    join_m = 0.5
    """Largest distance between the middles of a detection and of the entry that it joins."""

    def reset(self, info: StreamInfo) -> None:
        """Begin with an empty list."""
        self._labels: list[str] = []
        self._boxes_m: NDArray[np.float64] = np.zeros((0, 2, 3))
        """`(N, 2, 3)` smallest and largest corner of each entry's last detection."""
        self._confidences: list[float] = []
        self._seen_s: list[tuple[float, float]] = []

    def visit(self, time_s: float) -> None:
        """Change nothing: the list does not know of visits."""

    def observe(self, frame: MemoryFrame) -> None:
        """Compare each detection of a frame with all entries."""
        view, found = frame.view, frame.view.detections
        points_m = unproject(view.depth_m, view.pose, view.intrinsics)
        for index, label in enumerate(found.labels):
            is_point = (found.masks == index) & np.isfinite(view.depth_m) & (view.depth_m > 0.0)
            if is_point.any():
                own_m = points_m[is_point].T.copy()  # a row per axis, which NumPy reduces ten times as fast
                box_m = np.stack([own_m.min(axis=1), own_m.max(axis=1)])
                self._add(label, box_m, float(found.confidences[index]), frame.time_s)

    def _add(self, label: str, box_m: NDArray[np.float64], confidence: float, time_s: float) -> None:
        is_same = np.array([other == label for other in self._labels], bool)
        gaps_m = np.linalg.norm(self._boxes_m.mean(axis=1) - box_m.mean(axis=0), axis=1)
        gaps_m[~is_same] = np.inf
        if len(gaps_m) and gaps_m.min() <= self.join_m:
            index = int(gaps_m.argmin())
            self._boxes_m[index] = box_m
            self._confidences[index] = max(self._confidences[index], confidence)
            self._seen_s[index] = (self._seen_s[index][0], time_s)
        else:
            self._labels.append(label)
            self._boxes_m = np.concatenate([self._boxes_m, box_m[None]])
            self._confidences.append(confidence)
            self._seen_s.append((time_s, time_s))

    def entries(self) -> list[MemoryEntry]:
        """Return all places."""
        return [
            MemoryEntry(
                entry_id=index,
                label=label,
                centre_m=point_of(box_m.mean(axis=0)),
                size_m=point_of(box_m[1] - box_m[0]),
                confidence=self._confidences[index],
                first_seen_s=self._seen_s[index][0],
                last_seen_s=self._seen_s[index][1],
            )
            for index, (label, box_m) in enumerate(zip(self._labels, self._boxes_m, strict=True))
        ]

    def locate(self, text: str, k: int) -> list[FoundPlace]:
        """Return the places with this label, those seen last first."""
        found = [index for index, label in enumerate(self._labels) if label == text]
        found.sort(key=lambda index: (-self._seen_s[index][1], index))
        return [
            FoundPlace(point_of(self._boxes_m[index].mean(axis=0)), self._confidences[index]) for index in found[:k]
        ]

    def num_bytes(self) -> int:
        """Return the bytes of the boxes and labels, and about those of the numbers that go with them."""
        return self._boxes_m.nbytes + sum(map(len, self._labels)) + 2 * SEEN_BYTES * len(self._labels)


def point_of(values: NDArray[np.floating]) -> Point3:
    """Return the numbers of an array `(3,)`."""
    x, y, z = values.tolist()
    return x, y, z
