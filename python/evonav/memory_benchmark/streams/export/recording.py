"""Read a recorded RGB-D sequence of one's own, in TUM RGB-D's layout. It has no truth: speed and size are measured."""

import hashlib
import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from evonav.errors import StoreError
from evonav.memory_benchmark.protocol import MemoryFrame, StreamInfo
from evonav.memory_benchmark.streams.export.conversion import UpAxis, pose_of, rotation_of
from evonav.memory_benchmark.streams.export.layouts import (
    CAMERA_FILE,
    FRAMES_FILE,
    Camera,
    FrameLine,
    read_camera,
    read_frame_lines,
    text_of,
)
from evonav.memory_benchmark.streams.export.read import no_truth, view_of
from evonav.memory_benchmark.truth import FrameTruth, TrueChange
from evonav.sensors.observation import View
from evonav.world.simulator import Intrinsics

DEPTH_FILE, POSES_FILE, RGB_FILE = "depth.txt", "groundtruth.txt", "rgb.txt"
SAME_TIME_S = 0.02
"""Largest difference in time between an image and what belongs to it (TUM's `associate.py`)."""
VISIT_GAP_S = 60.0
"""Time without a frame after which a new visit begins."""

T = TypeVar("T", bound=np.generic)


class Recording:
    """A `Stream` of a recording; its images are read while it is read.

    `depth.txt` (time and file), `groundtruth.txt` (time, position, quaternion x y z w) and `cam_params.json` must be
    there, and every image that they name. `rgb.txt` and `frames.jsonl`, with masks and labels of detections, may be.
    Depth images without a pose within 0.02 s are left out.

    Cameras are made level, with the principal point in the middle: pixels are taken over from the nearest ones.
    """

    kind = "recording"
    has_truth = False
    changes: Sequence[TrueChange] = ()

    def __init__(self, folder: Path, up: UpAxis = "z") -> None:
        """Read all but the images.

        Args:
            up: The axis of the recording's right-handed world that points up. The floor is at height 0.

        Raises:
            StoreError: A file is missing or malformed, or no depth image has a pose.
        """
        self.folder, self.up = folder.resolve(), up
        self.house = self.folder.name  # a recording is a house of its own
        camera = self._camera = read_camera(folder)
        self._shots = _shots_of(folder, up)
        digest = hashlib.sha256(up.encode())
        for name in (CAMERA_FILE, POSES_FILE, DEPTH_FILE, RGB_FILE, FRAMES_FILE):
            digest.update((folder / name).read_bytes() if (folder / name).exists() else b"")
        self.name = f"{self.kind}/{self.house}/{digest.hexdigest()[:8]}"
        gaps_s = np.diff([line.time_s for line, _ in self._shots])
        rate_hz = 1.0 / float(np.median(gaps_s)) if len(gaps_s) else 1.0
        labels = sorted({label for line, _ in self._shots for label in line.labels})
        level = Intrinsics(camera.w, camera.h, 2.0 * math.atan(camera.h / 2.0 / camera.fx))
        self.info = StreamInfo(level, tuple(labels), rate_hz)

    @property
    def source(self) -> dict[str, str]:
        """The arguments that make it again, as JSON."""
        return {"folder": str(self.folder), "up": self.up}

    @property
    def num_frames(self) -> int:
        """Number of frames."""
        return len(self._shots)

    def frames(self) -> Iterator[tuple[MemoryFrame, FrameTruth]]:
        """Read the recording, one frame at a time."""
        intrinsics = self.info.intrinsics
        for line, roll_rad in self._shots:
            seen = view_of(self.folder, line, intrinsics, self._camera.scale)
            sources, found = _sources(self._camera, intrinsics, roll_rad), seen.detections
            view = View(
                seen.pose,
                intrinsics,
                _taken(seen.depth_m, sources, np.inf),
                replace(found, masks=_taken(found.masks, sources, -1)),
                seen.occupancy,
                None if seen.rgb is None else _taken(seen.rgb, sources, 0),
            )
            frame = MemoryFrame(line.index, line.time_s, line.visit, view)
            yield frame.read_only(), no_truth(len(found.labels))


def _sources(camera: Camera, intrinsics: Intrinsics, roll_rad: float) -> NDArray[np.int64]:
    """Return the `(H, W)` flat index of the recorded pixel for each pixel of the level camera; -1 where none is."""
    focal_px = intrinsics.focal_px
    across = (np.arange(camera.w) + 0.5 - camera.w / 2.0)[None, :] / focal_px
    down = (np.arange(camera.h) + 0.5 - camera.h / 2.0)[:, None] / focal_px
    # The recorded right side is turned up by the roll, so a level ray is turned the other way to find its pixel.
    cos, sin = math.cos(roll_rad), math.sin(roll_rad)
    cols = np.rint(camera.fx * (cos * across - sin * down) + camera.cx).astype(np.int64)
    rows = np.rint(camera.fy * (sin * across + cos * down) + camera.cy).astype(np.int64)
    is_inside = (cols >= 0) & (cols < camera.w) & (rows >= 0) & (rows < camera.h)
    return np.where(is_inside, rows * camera.w + cols, -1)


def _taken(image: NDArray[T], sources: NDArray[np.int64], missing: float) -> NDArray[T]:
    taken = image.reshape(sources.size, *image.shape[2:])[sources]
    taken[sources < 0] = missing
    return taken


def _shots_of(folder: Path, up: UpAxis) -> list[tuple[FrameLine, float]]:
    """Return all frames with the roll of the camera in each, in radians."""
    poses = _rows(folder / POSES_FILE, 7)
    pose_times_s = [time_s for time_s, _ in poses]
    colours = _rows(folder / RGB_FILE, 1) if (folder / RGB_FILE).exists() else []
    colour_times_s = [time_s for time_s, _ in colours]
    lines = {line.depth: line for line in read_frame_lines(folder)} if (folder / FRAMES_FILE).exists() else {}
    shots: list[tuple[FrameLine, float]] = []
    start_s, visit, last_s = None, 1, 0.0
    for time_s, (depth,) in _rows(folder / DEPTH_FILE, 1):
        at = _nearest(pose_times_s, time_s)
        if at is None:
            continue
        start_s = time_s if start_s is None else start_s
        visit += int(bool(shots) and time_s - start_s - last_s > VISIT_GAP_S)
        last_s = time_s - start_s
        pose, roll_rad = pose_of(_matrix(folder / POSES_FILE, poses[at][1]), up)
        colour = _nearest(colour_times_s, time_s)
        own = {
            "index": len(shots),
            "time_s": last_s,
            "visit": visit,
            "pose": (*pose.position_m, pose.yaw_rad, pose.horizon_rad),
            "rgb": None if colour is None else colours[colour][1][0],
        }
        line = (lines.get(depth) or FrameLine(depth=depth)).model_copy(update=own)
        for name in (depth, line.rgb, line.masks, line.features):
            if name is not None and not (folder / name).is_file():
                raise StoreError(f"{folder / name}: is missing; the recording names it at {time_s} s")
        shots.append((line, roll_rad))
    if not shots:
        raise StoreError(f"{folder}: no depth image has a pose within {SAME_TIME_S} s")
    return shots


def _rows(path: Path, num_columns: int) -> list[tuple[float, list[str]]]:
    """Return the rows of a list of TUM's, sorted by time."""
    rows = []
    for number, line in enumerate(text_of(path).splitlines(), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        time, *columns = line.replace(",", " ").split()
        try:
            time_s = float(time)
        except ValueError:
            time_s = math.nan
        if not math.isfinite(time_s) or len(columns) != num_columns:
            raise StoreError(f"{path}:{number}: `{line}`: expected a time and {num_columns} column(s)")
        rows.append((time_s, columns))
    return sorted(rows)


def _matrix(path: Path, columns: list[str]) -> NDArray[np.float64]:
    try:
        values = [float(value) for value in columns]
    except ValueError as error:
        raise StoreError(f"{path}: {error}") from error
    if not all(map(math.isfinite, values)) or not any(values[3:]):
        raise StoreError(f"{path}: `{' '.join(columns)}`: expected finite numbers, and a quaternion that is not 0")
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_of((values[3], values[4], values[5], values[6]))
    matrix[:3, 3] = values[:3]
    return matrix


def _nearest(times_s: Sequence[float], time_s: float) -> int | None:
    """Return the index of the nearest time, if it is near enough."""
    at = bisect_left(times_s, time_s)
    near = [index for index in (at - 1, at) if 0 <= index < len(times_s)]
    best = min(near, key=lambda index: abs(times_s[index] - time_s), default=None)
    return best if best is not None and abs(times_s[best] - time_s) <= SAME_TIME_S else None
