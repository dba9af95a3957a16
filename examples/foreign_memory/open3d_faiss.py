"""A memory that knows evonav's files only: Open3D clouds and faiss, as ConceptGraphs and 3D-Mem make theirs.

    pip install faiss-cpu numpy open3d pillow
    evonav bench memory export out/streams --streams S1 --quick --no-colours --oracle out/truth
    python examples/foreign_memory/open3d_faiss.py out/streams/*
    evonav bench memory score out/streams --oracle out/truth --system open3d-faiss-files

It imports nothing of evonav, and gives the entries of the memory `open3d-faiss` (docs/memory-benchmark.md).
"""

import json
import math
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import faiss
import numpy as np
import open3d
from numpy.typing import NDArray
from PIL import Image

Array = NDArray[Any]
Json = dict[str, Any]

VOXEL_M, CLUSTER_M, OVERLAP_M, RANGE_M = 0.01, 0.1, 0.025, 3.5
MIN_POINTS, MAX_POINTS, CLUSTER_POINTS = 16, 5000, 10
MATCH_THRESHOLD, MERGE_OVERLAP, FRAMES_PER_CLEANUP, MIN_DETECTIONS = 1.2, 0.7, 12, 2


@dataclass
class Thing:
    """A remembered object."""

    number: int
    cloud: open3d.geometry.PointCloud
    labels: Counter[str]
    confidence: float
    first_s: float
    last_s: float
    num: int = 1

    @property
    def label(self) -> str:
        """The label of most detections."""
        return self.labels.most_common(1)[0][0]

    @property
    def points(self) -> Array:
        """`(N, 3)` float32."""
        return np.asarray(self.cloud.points, np.float32)

    def absorb(self, other: "Thing") -> None:
        """Take over what another one has."""
        self.cloud = (self.cloud + other.cloud).voxel_down_sample(VOXEL_M)
        self.labels += other.labels
        self.confidence = max(self.confidence, other.confidence)
        self.num += other.num
        self.first_s, self.last_s = min(self.first_s, other.first_s), max(self.last_s, other.last_s)


class Index:
    """The points of all things, each in an index of its own."""

    def __init__(self, things: list[Thing]) -> None:
        self.points = [thing.points for thing in things]
        self.indices = [faiss.IndexFlatL2(3) for _ in things]
        for index, points in zip(self.indices, self.points, strict=True):
            index.add(points)

    def overlap(self, query: Array, number: int) -> float:
        """Return the share of points that have a point of a thing within the overlap distance."""
        points = self.points[number]
        if (query.min(0) > points.max(0)).any() or (points.min(0) > query.max(0)).any():
            return 0.0
        return float((self.indices[number].search(query, 1)[0] < OVERLAP_M**2).mean())


def largest_cluster(cloud: open3d.geometry.PointCloud) -> open3d.geometry.PointCloud:
    """Return the largest cluster of DBSCAN; all if there is none."""
    labels = np.asarray(cloud.cluster_dbscan(eps=CLUSTER_M, min_points=CLUSTER_POINTS))
    if not (labels >= 0).any():
        return cloud
    return cloud.select_by_index(np.flatnonzero(labels == np.bincount(labels[labels >= 0]).argmax()))


def rotation_of(x: float, y: float, z: float, w: float) -> Array:
    """Return the `(3, 3)` matrix of a quaternion, from the camera to the world."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def is_far(cloud: open3d.geometry.PointCloud, camera_m: Array) -> bool:
    """Return whether a cloud is out of range on the ground plane; z is up in the files."""
    return math.dist(np.asarray(cloud.points)[:, :2].mean(0), camera_m[:2]) > RANGE_M


class Memory:
    """All things that were seen."""

    def __init__(self, camera: Json) -> None:
        self.camera, self.num_frames, self.num_things = camera, 0, 0
        self.things: list[Thing] = []

    def observe(self, frame: Json, depth: Array, masks: Array, camera_m: Array, rotation: Array) -> None:
        """Match all detections of a frame, then merge them into what is known."""
        found = self.detect(frame, depth / self.camera["scale"], masks, camera_m, rotation)
        index, known = Index(self.things), list(self.things)
        matches = [self.match(index, known, new) for new in found]
        for new, match in zip(found, matches, strict=True):
            if match is None:
                new.number, self.num_things = self.num_things, self.num_things + 1
                self.things.append(new)
            else:
                known[match].absorb(new)
        self.num_frames += 1
        if self.num_frames % FRAMES_PER_CLEANUP == 0:
            self.clean_up(camera_m)

    def detect(self, frame: Json, depth_m: Array, masks: Array, camera_m: Array, rotation: Array) -> list[Thing]:
        """Return a thing for each detection that has enough points and is in range."""
        found = []
        for number, label in enumerate(frame["labels"]):
            rows, cols = np.nonzero((masks == number + 1) & (depth_m > 0))
            step = math.ceil(len(rows) / MAX_POINTS) or 1
            rows, cols = rows[::step], cols[::step]
            if len(rows) < MIN_POINTS:
                continue
            z = depth_m[rows, cols]
            x = (cols - self.camera["cx"]) / self.camera["fx"] * z
            y = (rows - self.camera["cy"]) / self.camera["fy"] * z
            points = np.stack([x, y, z], axis=1) @ rotation.T + camera_m
            cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
            cloud = largest_cluster(cloud.voxel_down_sample(VOXEL_M))
            if not is_far(cloud, camera_m):
                time_s = frame["time_s"]
                found.append(Thing(-1, cloud, Counter([label]), frame["confidences"][number], time_s, time_s))
        return found

    def match(self, index: Index, known: list[Thing], new: Thing) -> int | None:
        """Return the number of the thing that a detection belongs to."""
        scores = [(index.overlap(new.points, i), thing.label == new.label) for i, thing in enumerate(known)]
        scores = [overlap + is_same if overlap else 0.0 for overlap, is_same in scores]
        best = int(np.argmax(scores)) if scores else 0
        return best if scores and scores[best] > MATCH_THRESHOLD else None

    def clean_up(self, camera_m: Array) -> None:
        """Clean all clouds, drop what was detected once and is far away, and merge what lies in something else."""
        for thing in self.things:
            thing.cloud = largest_cluster(thing.cloud)
        kept = [one for one in self.things if one.num >= MIN_DETECTIONS or not is_far(one.cloud, camera_m)]
        index, gone = Index(kept), set[int]()
        for small in sorted(range(len(kept)), key=lambda i: len(index.points[i])):
            for large, thing in enumerate(kept):
                if large in gone or large == small or thing.label != kept[small].label:
                    continue
                if index.overlap(index.points[small], large) > MERGE_OVERLAP:
                    thing.absorb(kept[small])
                    gone.add(small)
                    break
        self.things = [thing for i, thing in enumerate(kept) if i not in gone]

    def entries(self) -> list[Json]:
        """Return what is believed, in evonav's world: (x, y, z) of the files are x, z and y there."""
        found = []
        for thing in self.things:
            low, high = thing.points.min(0).astype(float), thing.points.max(0).astype(float)
            found.append(
                {
                    "entry_id": thing.number,
                    "label": thing.label,
                    "centre_m": ((low + high) / 2)[[0, 2, 1]].tolist(),
                    "size_m": (high - low)[[0, 2, 1]].tolist(),
                    "confidence": thing.confidence,
                    "first_seen_s": thing.first_s,
                    "last_seen_s": thing.last_s,
                }
            )
        return found


def run(folder: Path) -> None:
    """Read the frames of a stream, and write a line of `entries.jsonl` for each."""
    faiss.omp_set_num_threads(1)
    frames = [json.loads(line) for line in (folder / "frames.jsonl").read_text().splitlines()]
    poses = [line.split() for line in (folder / "groundtruth.txt").read_text().splitlines() if line[0] != "#"]
    memory = Memory(json.loads((folder / "cam_params.json").read_text())["camera"])
    with (folder / "entries.jsonl").open("w") as out:
        for frame, pose in zip(frames, poses, strict=True):
            _, *numbers = map(float, pose)
            depth = np.asarray(Image.open(folder / frame["depth"])).astype(float)
            masks = np.asarray(Image.open(folder / frame["masks"]))
            start_s = time.perf_counter()
            memory.observe(frame, depth, masks, np.array(numbers[:3]), rotation_of(*numbers[3:]))
            line = {"frame": frame["index"], "seconds": time.perf_counter() - start_s, "entries": memory.entries()}
            line["num_bytes"] = sum(24 * len(thing.cloud.points) + 100 for thing in memory.things)
            out.write(json.dumps(line) + "\n")


for name in sys.argv[1:]:
    run(Path(name))
