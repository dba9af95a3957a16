"""A memory made as ConceptGraphs and 3D-Mem make theirs: Open3D clouds, DBSCAN, and a flat faiss index an entry.

Sources: Gu et al., ICRA 2024; Yang et al., CVPR 2025. Steps and parameters are those of `evonav.memory.ObjectMap`;
docs/memory.md says where that differs from the original code. Nothing is ever forgotten but what a clean-up drops.
"""

import math
from collections import Counter
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.component import optional_module
from evonav.memory import ObjectMapConfig
from evonav.memory_benchmark.protocol import FoundPlace, MemoryEntry, MemoryFrame, StreamInfo
from evonav.memory_benchmark.references import point_of
from evonav.sensors.observation import View
from evonav.world.camera import camera_axes
from evonav.world.pose import Pose

INSTALL = "'evonav[bench]'"
Corners = tuple[NDArray[np.float32], NDArray[np.float32]]
NUMBER_BYTES = 100
"""Approximate size of the numbers of an entry."""


@dataclass
class Cloud:
    """An object: a detection's, or an entry's."""

    points: Any
    """`open3d.geometry.PointCloud`."""
    label: str
    confidence: float = 1.0
    box: Any = None
    """`open3d.geometry.OrientedBoundingBox`, which the originals keep and compute again with every change."""

    @property
    def points_m(self) -> NDArray[np.float32]:
        """`(N, 3)`."""
        return np.asarray(self.points.points, np.float32)


@dataclass
class _CloudEntry:
    """A remembered object."""

    entry_id: int
    cloud: Cloud
    labels: Counter[str]
    first_s: float
    last_s: float
    num: int = 1
    """Number of detections."""


def corners_of(points_m: NDArray[np.float32]) -> Corners:
    """Return the smallest and the largest corner of the box around points."""
    columns_m = points_m.T.copy()  # a row per axis, which NumPy reduces ten times as fast
    return columns_m.min(axis=1), columns_m.max(axis=1)


class _Matcher:
    """Compares detections with entries by a faiss index of each entry."""

    def __init__(self, clouds: list[Cloud], config: ObjectMapConfig) -> None:
        self.clouds, self.config = clouds, config
        self.points = [cloud.points_m for cloud in clouds]
        self.corners = [corners_of(points) for points in self.points]
        self.indices = [_faiss().IndexFlatL2(3) for _ in clouds]
        for index, points in zip(self.indices, self.points, strict=True):
            index.add(points)

    def overlap(self, query: NDArray[np.float32], corners: Corners, number: int) -> float:
        """Return the share of points that have a point of an entry within the overlap radius."""
        (low, high), (own_low, own_high) = corners, self.corners[number]
        if (low > own_high).any() or (own_low > high).any():
            return 0.0
        squares_m2, _ = self.indices[number].search(query, 1)
        return float((squares_m2 < self.config.overlap_radius_m**2).mean())

    def best(self, detection: Cloud) -> int | None:
        """Return the entry that a detection joins; `None` for a new one."""
        query, scores = detection.points_m, np.zeros(len(self.clouds))
        corners = corners_of(query)
        for number, cloud in enumerate(self.clouds):
            if overlap := self.overlap(query, corners, number):
                scores[number] = overlap + self.config.visual_weight * (detection.label == cloud.label)
        best = int(scores.argmax()) if len(scores) else 0
        return best if len(scores) and scores[best] > self.config.match_threshold else None


class Open3DFaissMemory:
    """The memory. It runs on one thread of faiss."""

    def __init__(self) -> None:
        """Load the libraries.

        Raises:
            StoreError: Open3D or faiss is not installed.
        """
        _open3d()
        _faiss().omp_set_num_threads(1)
        self.config = ObjectMapConfig()

    def reset(self, info: StreamInfo) -> None:
        """Forget everything."""
        self._entries: list[_CloudEntry] = []
        self._num_views = self._next_id = 0
        self.entry_ids: list[int | None] = []
        """Entry of each detection of the last frame; `None` where it was filtered out."""

    def visit(self, time_s: float) -> None:
        """Change nothing: the originals do not know of visits."""

    def observe(self, frame: MemoryFrame) -> None:
        """Match all detections of a frame, then merge them into their entries."""
        detections = detect(frame.view, self.config)
        matches = associate([entry.cloud for entry in self._entries], detections, self.config)
        self.entry_ids = []
        for detection, match in zip(detections, matches, strict=True):
            if detection is None:
                self.entry_ids.append(None)
                continue
            if match is None:
                labels = Counter([detection.label])
                self._entries.append(_CloudEntry(self._next_id, detection, labels, frame.time_s, frame.time_s))
                self._next_id += 1
                self.entry_ids.append(self._entries[-1].entry_id)
                continue
            entry = self._entries[match]
            entry.cloud = merged(entry.cloud, detection, self.config)
            entry.labels[detection.label] += 1
            entry.cloud.label = entry.labels.most_common(1)[0][0]
            entry.num, entry.last_s = entry.num + 1, frame.time_s
            self.entry_ids.append(entry.entry_id)
        self._num_views += 1
        if self._num_views % self.config.views_per_cleanup == 0:
            self._clean_up(frame.view.pose)

    def _clean_up(self, pose: Pose) -> None:
        """Clean all clouds, drop what was detected once and is far away, and merge entries that lie in each other."""
        remaining = []
        for entry in self._entries:
            entry.cloud.points = largest_cluster(entry.cloud.points, self.config)
            centre_m = entry.cloud.points_m.mean(axis=0)
            distance_m = math.hypot(centre_m[0] - pose.x_m, centre_m[2] - pose.z_m)
            if entry.num >= self.config.min_detections or distance_m <= self.config.max_distance_m:
                remaining.append(entry)
        self._entries = remaining
        matcher = _Matcher([entry.cloud for entry in remaining], self.config)
        gone: set[int] = set()
        for small in sorted(range(len(remaining)), key=lambda number: len(matcher.points[number])):
            for large in range(len(remaining)):
                if large in gone or large == small or remaining[large].cloud.label != remaining[small].cloud.label:
                    continue
                if matcher.overlap(matcher.points[small], matcher.corners[small], large) > self.config.merge_overlap:
                    self._absorb(remaining[large], remaining[small])
                    gone.add(small)
                    break
        self._entries = [entry for number, entry in enumerate(remaining) if number not in gone]

    def _absorb(self, entry: _CloudEntry, other: _CloudEntry) -> None:
        entry.cloud = merged(entry.cloud, other.cloud, self.config)
        entry.labels += other.labels
        entry.num += other.num
        entry.first_s, entry.last_s = min(entry.first_s, other.first_s), max(entry.last_s, other.last_s)

    def entries(self) -> list[MemoryEntry]:
        """Return all entries, with axis-aligned boxes."""
        found = []
        for entry in self._entries:
            low, high = corners_of(entry.cloud.points_m)
            found.append(
                MemoryEntry(
                    entry_id=entry.entry_id,
                    label=entry.cloud.label,
                    centre_m=point_of((low + high) / 2.0),
                    size_m=point_of(high - low),
                    confidence=entry.cloud.confidence,
                    first_seen_s=entry.first_s,
                    last_seen_s=entry.last_s,
                )
            )
        return found

    def locate(self, text: str, k: int) -> list[FoundPlace]:
        """Return the entries with this label, those seen last first."""
        found = [(one.last_seen_s or 0.0, one) for one in self.entries() if one.label == text]
        return [FoundPlace(one.centre_m, time_s) for time_s, one in sorted(found, key=lambda pair: -pair[0])[:k]]

    def num_bytes(self) -> int:
        """Return the bytes of the points, which Open3D keeps as three doubles, and about those of the numbers."""
        return sum(24 * len(entry.cloud.points.points) + NUMBER_BYTES for entry in self._entries)


def detect(view: View, config: ObjectMapConfig) -> list[Cloud | None]:
    """Turn the detections of a view into clouds; `None` where one has too few points or is too far away."""
    open3d, found = _open3d(), view.detections
    axes, camera_m, focal_px = camera_axes(view.pose), view.pose.position_m, view.intrinsics.focal_px
    height_px, width_px = view.depth_m.shape
    clouds: list[Cloud | None] = []
    for number, label in enumerate(found.labels):
        rows, cols = np.nonzero((found.masks == number) & np.isfinite(view.depth_m) & (view.depth_m > 0))
        step = math.ceil(len(rows) / config.max_points) or 1
        rows, cols = rows[::step], cols[::step]
        if len(rows) < config.min_points:
            clouds.append(None)
            continue
        depth_m = view.depth_m[rows, cols].astype(np.float64)
        right = (cols + 0.5 - width_px / 2) / focal_px * depth_m
        up = -(rows + 0.5 - height_px / 2) / focal_px * depth_m
        points_m = np.stack([right, up, depth_m], axis=1) @ axes + camera_m
        points = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points_m))
        points = largest_cluster(points.voxel_down_sample(config.voxel_m), config)
        centre_m = np.asarray(points.points).mean(axis=0)
        if math.hypot(centre_m[0] - view.pose.x_m, centre_m[2] - view.pose.z_m) > config.max_distance_m:
            clouds.append(None)
            continue
        clouds.append(Cloud(points, label, float(found.confidences[number]), _box(points)))
    return clouds


def associate(stored: list[Cloud], detections: list[Cloud | None], config: ObjectMapConfig) -> list[int | None]:
    """Return the index of the entry that each detection joins; `None` for a new one, or for one filtered out."""
    matcher = _Matcher(stored, config)
    return [None if detection is None else matcher.best(detection) for detection in detections]


def merged(entry: Cloud, detection: Cloud, config: ObjectMapConfig) -> Cloud:
    """Return the cloud of both, one point a voxel."""
    points = (entry.points + detection.points).voxel_down_sample(config.voxel_m)
    return Cloud(points, entry.label, max(entry.confidence, detection.confidence), _box(points))


def largest_cluster(points: Any, config: ObjectMapConfig) -> Any:  # noqa: ANN401 - clouds of Open3D
    """Return the points of DBSCAN's largest cluster; all if there is none."""
    labels = np.asarray(points.cluster_dbscan(eps=config.cluster_radius_m, min_points=config.cluster_min_points))
    if not (labels >= 0).any():
        return points
    return points.select_by_index(np.flatnonzero(labels == np.bincount(labels[labels >= 0]).argmax()))


def _box(points: Any) -> Any:  # noqa: ANN401 - of Open3D
    return points.get_oriented_bounding_box(robust=True) if len(points.points) >= 4 else None


@cache
def _open3d() -> Any:  # noqa: ANN401 - a module
    return optional_module("open3d", "the memory open3d-faiss needs Open3D", INSTALL)


@cache
def _faiss() -> Any:  # noqa: ANN401 - a module
    return optional_module("faiss", "the memory open3d-faiss needs faiss", INSTALL)
