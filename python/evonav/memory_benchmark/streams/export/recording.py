"""Read a recorded RGB-D sequence of one's own, in TUM RGB-D's layout. It has no truth: speed and size are measured."""

import hashlib
import json
import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat, ValidationError

from evonav.errors import StoreError
from evonav.memory_benchmark.protocol import MemoryFrame, StreamInfo, read_only
from evonav.memory_benchmark.streams.export import images
from evonav.memory_benchmark.streams.export.conversion import UpAxis, pose_of, rotation_of
from evonav.memory_benchmark.streams.export.layouts import FRAMES_FILE, LAYOUTS, FrameLine
from evonav.memory_benchmark.streams.export.read import no_truth, read_detections, read_frame_lines
from evonav.memory_benchmark.streams.rendered import NO_OCCUPANCY
from evonav.memory_benchmark.truth import FrameTruth, TrueChange
from evonav.records import Record
from evonav.sensors.observation import Detections, View
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics

CAMERA_FILE, DEPTH_FILE, POSES_FILE, RGB_FILE = "cam_params.json", "depth.txt", "groundtruth.txt", "rgb.txt"
SAME_TIME_S = 0.02
"""Largest difference in time between an image and what belongs to it (TUM's `associate.py`)."""
VISIT_GAP_S = 60.0
"""Time without a frame after which a new visit begins."""

T = TypeVar("T", bound=np.generic)


class _CameraFile(Record):
    """The camera of `cam_params.json`."""

    w: int
    h: int
    fx: PositiveFloat
    fy: PositiveFloat
    cx: float
    cy: float
    scale: PositiveFloat = LAYOUTS["tum"].depth_scale


@dataclass(frozen=True, slots=True)
class _Shot:
    """A frame's files and pose."""

    time_s: float
    visit: int
    pose: Pose
    roll_rad: float
    depth: str
    rgb: str | None
    line: FrameLine | None


def read_recording(folder: Path, *, up: UpAxis = "z") -> "Recording":
    """Return a recorded sequence as a stream; its images are read while it is read.

    `depth.txt` (time and file), `groundtruth.txt` (time, position, quaternion x y z w) and `cam_params.json` must be
    there, and every image that they name. `rgb.txt` and `frames.jsonl`, with masks and labels of detections, may be.
    Depth images without a pose within 0.02 s are left out.

    Cameras are made level, with the principal point in the middle: pixels are taken over from the nearest ones.

    Args:
        up: The axis of the recording's right-handed world that points up. The floor is at height 0.

    Raises:
        StoreError: A file is missing or malformed, or no depth image has a pose.
    """
    return Recording(folder, up)


@dataclass(frozen=True, slots=True)
class RecordingSpec:
    """All that a worker needs to read a recording."""

    name: str
    folder: str
    up: UpAxis

    def read(self) -> "Recording":
        """Read the recording; see `read_recording`."""
        return Recording(Path(self.folder), self.up)


class Recording:
    """A `Stream` of a recording."""

    kind = "recording"
    has_truth = False
    changes: Sequence[TrueChange] = ()

    def __init__(self, folder: Path, up: UpAxis = "z") -> None:
        """Read all but the images; see `read_recording`."""
        self.folder, self.up = folder, up
        self._camera = _camera_of(folder / CAMERA_FILE)
        self._shots = _shots_of(folder, up)

    @cached_property
    def name(self) -> str:
        """The folder's name, and a part of the digest of all of its files but the images."""
        digest = hashlib.sha256(self.up.encode())
        for name in (CAMERA_FILE, POSES_FILE, DEPTH_FILE, RGB_FILE, FRAMES_FILE):
            path = self.folder / name
            digest.update(path.read_bytes() if path.exists() else b"")
        return f"{self.kind}/{self.house}/{digest.hexdigest()[:8]}"

    @property
    def house(self) -> str:
        """The folder's name: a recording is a house of its own."""
        return self.folder.resolve().name

    @property
    def spec(self) -> RecordingSpec:
        """The description from which the recording is read again."""
        return RecordingSpec(self.name, str(self.folder.resolve()), self.up)

    @property
    def num_frames(self) -> int:
        """Number of frames."""
        return len(self._shots)

    @property
    def info(self) -> StreamInfo:
        """The camera after levelling, the labels of all detections, and the median rate."""
        camera = self._camera
        gaps_s = np.diff([shot.time_s for shot in self._shots])
        rate_hz = 1.0 / float(np.median(gaps_s)) if len(gaps_s) else 1.0
        labels = sorted({label for shot in self._shots if shot.line for label in shot.line.labels})
        fov_rad = 2.0 * math.atan(camera.h / 2.0 / camera.fx)
        return StreamInfo(Intrinsics(camera.w, camera.h, fov_rad), tuple(labels), rate_hz)

    def frames(self) -> Iterator[tuple[MemoryFrame, FrameTruth]]:
        """Read the recording, one frame at a time."""
        intrinsics, shape = self.info.intrinsics, (self._camera.h, self._camera.w)
        for index, shot in enumerate(self._shots):
            sources = _sources(self._camera, intrinsics, shot.roll_rad)
            depth_m = images.read_depth(self.folder / shot.depth, self._camera.scale)
            rgb = None if shot.rgb is None else images.read_rgb(self.folder / shot.rgb)
            found = Detections(np.full(shape, -1, np.int32), (), np.empty(0, np.float32))
            if shot.line is not None:
                found = read_detections(self.folder, shot.line, shape)
            for path, image in ((shot.depth, depth_m), (shot.rgb, rgb)):
                if image is not None and image.shape[:2] != shape:
                    raise StoreError(f"{self.folder / str(path)}: shape {image.shape[:2]}, expected {shape}")
            view = View(
                shot.pose,
                intrinsics,
                _taken(depth_m, sources, np.inf),
                Detections(_taken(found.masks, sources, -1), found.labels, found.confidences, found.features),
                NO_OCCUPANCY,
                None if rgb is None else _taken(rgb, sources, 0),
            )
            frame = MemoryFrame(index, shot.time_s, shot.visit, view)
            yield read_only(frame), no_truth(len(found.labels))


def _sources(camera: _CameraFile, intrinsics: Intrinsics, roll_rad: float) -> NDArray[np.int64]:
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


def _camera_of(path: Path) -> _CameraFile:
    try:
        camera = json.loads(path.read_text(encoding="utf-8"))["camera"]
        return _CameraFile.model_validate(camera)
    except (OSError, UnicodeDecodeError, ValueError, KeyError, TypeError, ValidationError) as error:
        expected = ', expected {"camera": {"w", "h", "fx", "fy", "cx", "cy", "scale"}}'
        raise StoreError(f"{path}: cannot be read{expected}: {error}") from error


def _shots_of(folder: Path, up: UpAxis) -> list[_Shot]:
    poses = _rows(folder / POSES_FILE, 7)
    pose_times_s = [time_s for time_s, _ in poses]
    colours = _rows(folder / RGB_FILE, 1) if (folder / RGB_FILE).exists() else []
    colour_times_s = [time_s for time_s, _ in colours]
    lines = {line.depth: line for line in read_frame_lines(folder)} if (folder / FRAMES_FILE).exists() else {}
    shots: list[_Shot] = []
    start_s = None
    for time_s, (depth,) in _rows(folder / DEPTH_FILE, 1):
        at = _nearest(pose_times_s, time_s)
        if at is None:
            continue
        start_s = time_s if start_s is None else start_s
        pose, roll_rad = pose_of(_matrix(folder / POSES_FILE, poses[at][1]), up)
        colour = _nearest(colour_times_s, time_s)
        line = lines.get(depth)
        visit = 1
        if shots:
            visit = shots[-1].visit + int(time_s - start_s - shots[-1].time_s > VISIT_GAP_S)
        rgb = None if colour is None else colours[colour][1][0]
        for name in (depth, rgb, None if line is None else line.masks, None if line is None else line.features):
            if name is not None and not (folder / name).is_file():
                raise StoreError(f"{folder / name}: is missing; the recording names it at {time_s} s")
        shots.append(_Shot(time_s - start_s, visit, pose, roll_rad, depth, rgb, line))
    if not shots:
        raise StoreError(f"{folder}: no depth image has a pose within {SAME_TIME_S} s")
    return shots


def _rows(path: Path, num_columns: int) -> list[tuple[float, list[str]]]:
    """Return the rows of a list of TUM's, sorted by time."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise StoreError(f"{path}: cannot be read: {error}") from error
    rows = []
    for number, line in enumerate(text.splitlines(), start=1):
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
