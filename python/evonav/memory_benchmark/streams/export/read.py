"""Read an exported stream, with its truth if the oracle's file is there."""

import lzma
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from evonav.errors import StoreError
from evonav.memory_benchmark.protocol import MemoryFrame
from evonav.memory_benchmark.streams.export.layouts import (
    FRAMES_FILE,
    ORACLE_FILE,
    STREAM_FILE,
    FrameLine,
    OracleHead,
    StreamFile,
    TruthLine,
    read_frame_lines,
    record_of,
    text_of,
)
from evonav.memory_benchmark.truth import FrameTruth, TrueChange
from evonav.sensors.observation import NO_OCCUPANCY, Detections, View
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics, SceneObject


class ExportedStream:
    """A `Stream` that `export_stream` wrote; its images are read while it is read."""

    def __init__(self, folder: Path, oracle: Path | None = None) -> None:
        """Read all but the images.

        Args:
            oracle: File of the truth, without which truth and changes are empty. Default: `oracle.jsonl.xz`.

        Raises:
            StoreError: A file is missing or damaged, or the truth is that of another stream.
        """
        self.folder = folder
        self.file = record_of(StreamFile, folder / STREAM_FILE, text_of(folder / STREAM_FILE))
        self.name, self.kind, self.house, self.info = self.file.name, self.file.kind, self.file.house, self.file.info
        self._lines = read_frame_lines(folder)
        if len(self._lines) != self.file.num_frames:
            raise StoreError(f"{folder / FRAMES_FILE}: {len(self._lines)} lines, expected {self.file.num_frames}")
        self._oracle = oracle or folder / ORACLE_FILE
        self.has_truth = self._oracle.exists()
        self.changes: Sequence[TrueChange] = ()
        if self.has_truth:
            head = record_of(OracleHead, self._oracle, next(self._oracle_lines(), ""))
            if head.digest != self.file.digest:
                raise StoreError(f"{self._oracle}: the truth of another stream, {head.name}")
            self.changes = head.changes

    def frames(self) -> Iterator[tuple[MemoryFrame, FrameTruth]]:
        """Read the stream, one frame at a time."""
        truths = self._truths()
        for line in self._lines:
            view = view_of(self.folder, line, self.info.intrinsics, self.file.depth_scale)
            truth = next(truths, None)
            if truth is None:
                raise StoreError(f"{self._oracle}: no truth of frame {line.index}")
            yield MemoryFrame(line.index, line.time_s, line.visit, view).read_only(), truth

    def _truths(self) -> Iterator[FrameTruth]:
        if not self.has_truth:
            yield from (no_truth(len(line.labels)) for line in self._lines)
            return
        objects: tuple[SceneObject, ...] = ()
        lines = self._oracle_lines()
        next(lines, None)
        for text in lines:
            truth = record_of(TruthLine, self._oracle, text)
            objects = objects if truth.objects is None else truth.objects
            yield FrameTruth(objects, truth.visible_px, truth.empty_px, truth.detected_ids)

    def _oracle_lines(self) -> Iterator[str]:
        try:
            with lzma.open(self._oracle, "rt", encoding="utf-8") as file:
                yield from file
        except (OSError, EOFError, lzma.LZMAError, UnicodeDecodeError) as error:
            raise StoreError(f"{self._oracle}: cannot be read: {error}") from error


def no_truth(num_detections: int) -> FrameTruth:
    """Return the truth of a frame of which nothing is known."""
    return FrameTruth((), {}, {}, (None,) * num_detections)


def view_of(folder: Path, line: FrameLine, intrinsics: Intrinsics, depth_scale: float) -> View:
    """Read the images of a frame.

    Raises:
        StoreError: An image cannot be read or has another shape, the pose is missing, or masks, labels and confidences
            do not fit each other.
    """
    if line.pose is None:
        raise StoreError(f"{folder / FRAMES_FILE}: frame {line.index} has no `pose`")
    shape = (intrinsics.height_px, intrinsics.width_px)
    depth = _image(folder / line.depth)
    if depth.ndim != 2:
        raise StoreError(f"{folder / line.depth}: a depth image of {depth.shape[-1]} channels, expected 1")
    metres = depth.astype(np.float64) / depth_scale
    depth_m = np.where(metres == 0.0, np.inf, metres).astype(np.float32)
    rgb = None if line.rgb is None else np.ascontiguousarray(_image(folder / line.rgb, "RGB").astype(np.uint8))
    for name, image in ((line.depth, depth_m), (line.rgb, rgb)):
        if image is not None and image.shape[:2] != shape:
            raise StoreError(f"{folder / str(name)}: shape {image.shape[:2]}, expected {shape}")
    found = _detections(folder, line, shape)
    return View(Pose(*line.pose), intrinsics, depth_m, found, NO_OCCUPANCY, rgb)


def _detections(folder: Path, line: FrameLine, shape: tuple[int, int]) -> Detections:
    """Return the detections of a frame; none if it has no masks."""
    if line.masks is None:
        return Detections(np.full(shape, -1, np.int32), (), np.empty(0, np.float32))
    masks = np.ascontiguousarray(_image(folder / line.masks).astype(np.int32) - 1)
    confidences = line.confidences or (1.0,) * len(line.labels)
    if masks.shape != shape or len(confidences) != len(line.labels) or int(masks.max()) >= len(line.labels):
        raise StoreError(
            f"{folder / line.masks}: masks of shape {masks.shape} with {int(masks.max()) + 1} detections, "
            f"{len(line.labels)} labels and {len(confidences)} confidences, for an image of shape {shape}"
        )
    features = None
    if line.features is not None:
        try:
            features = np.load(folder / line.features, allow_pickle=False)
        except (OSError, ValueError) as error:
            raise StoreError(f"{folder / line.features}: cannot be read: {error}") from error
    return Detections(masks, line.labels, np.array(confidences, np.float32), features)


def _image(path: Path, mode: str | None = None) -> NDArray[np.generic]:
    try:
        with Image.open(path) as image:
            return np.asarray(image if mode is None else image.convert(mode))
    except (OSError, UnidentifiedImageError) as error:
        raise StoreError(f"{path}: cannot be read as an image: {error}") from error
