"""Read an exported stream, with its truth if the oracle's file is there."""

import lzma
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np
from pydantic import ValidationError

from evonav.errors import StoreError
from evonav.memory_benchmark.protocol import MemoryFrame, StreamInfo, read_only
from evonav.memory_benchmark.streams.export import images
from evonav.memory_benchmark.streams.export.layouts import (
    FRAMES_FILE,
    ORACLE_FILE,
    STREAM_FILE,
    FrameLine,
    OracleHead,
    StreamFile,
    TruthLine,
)
from evonav.memory_benchmark.streams.rendered import NO_OCCUPANCY
from evonav.memory_benchmark.truth import FrameTruth, TrueChange
from evonav.records import Record, sentence_of
from evonav.sensors.observation import Detections, View
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics, SceneObject

R = TypeVar("R", bound=Record)


def read_exported(folder: Path, *, oracle: Path | None = None) -> "ExportedStream":
    """Return a stream that `export_stream` wrote; its images are read while it is read.

    Args:
        oracle: File of the truth. Default: `oracle.jsonl.xz` in the folder, if it is there.

    Raises:
        StoreError: A file is missing or damaged, or the truth is that of another stream.
    """
    return ExportedStream(folder, oracle)


class ExportedStream:
    """A `Stream` in files."""

    def __init__(self, folder: Path, oracle: Path | None = None) -> None:
        """Read all but the images; see `read_exported`."""
        self.folder = folder
        self.file = _record(StreamFile, folder / STREAM_FILE, _text_of(folder / STREAM_FILE))
        self._lines = read_frame_lines(folder)
        if len(self._lines) != self.file.num_frames:
            raise StoreError(f"{folder / FRAMES_FILE}: {len(self._lines)} lines, expected {self.file.num_frames}")
        oracle = oracle or folder / ORACLE_FILE
        self._oracle = oracle if oracle.exists() else None
        if self._head is not None and self._head.digest != self.file.digest:
            raise StoreError(f"{oracle}: the truth of another stream, {self._head.name}")

    @property
    def has_truth(self) -> bool:
        """True if the oracle's file is there; otherwise truth and changes are empty."""
        return self._oracle is not None

    @property
    def name(self) -> str:
        """The exported stream's name."""
        return self.file.name

    @property
    def kind(self) -> str:
        """The exported stream's kind."""
        return self.file.kind

    @property
    def house(self) -> str:
        """The house that intervals are resampled by."""
        return self.file.house

    @property
    def num_frames(self) -> int:
        """Number of frames."""
        return self.file.num_frames

    @property
    def info(self) -> StreamInfo:
        """The public facts that a memory is told."""
        camera = self.file.camera
        return StreamInfo(Intrinsics(camera.w, camera.h, camera.vertical_fov_rad), self.file.labels, self.file.rate_hz)

    @cached_property
    def _head(self) -> OracleHead | None:
        if self._oracle is None:
            return None
        return _record(OracleHead, self._oracle, next(_oracle_lines(self._oracle), ""))

    @property
    def changes(self) -> Sequence[TrueChange]:
        """All changes, in the order of time; none without the truth."""
        return () if self._head is None else tuple(one.change() for one in self._head.changes)

    def frames(self) -> Iterator[tuple[MemoryFrame, FrameTruth]]:
        """Read the stream, one frame at a time."""
        truths, intrinsics = self._truths(), self.info.intrinsics
        for line in self._lines:
            if line.pose is None:
                raise StoreError(f"{self.folder / FRAMES_FILE}: frame {line.index} has no `pose`")
            view = View(
                Pose(*line.pose),
                intrinsics,
                images.read_depth(self.folder / line.depth, self.file.depth_scale),
                read_detections(self.folder, line, (intrinsics.height_px, intrinsics.width_px)),
                NO_OCCUPANCY,
                None if line.rgb is None else images.read_rgb(self.folder / line.rgb),
            )
            truth = next(truths, None)
            if truth is None:
                raise StoreError(f"{self._oracle}: no truth of frame {line.index}")
            yield read_only(MemoryFrame(line.index, line.time_s, line.visit, view)), truth

    def _truths(self) -> Iterator[FrameTruth]:
        if self._oracle is None:
            for line in self._lines:
                yield no_truth(len(line.labels))
            return
        objects: tuple[SceneObject, ...] = ()
        lines = _oracle_lines(self._oracle)
        next(lines, None)
        for text in lines:
            truth = _record(TruthLine, self._oracle, text)
            if truth.objects is not None:
                objects = tuple(one.object() for one in truth.objects)
            yield FrameTruth(objects, truth.visible_px, truth.empty_px, truth.detected_ids)


def no_truth(num_detections: int) -> FrameTruth:
    """Return the truth of a frame of which nothing is known."""
    return FrameTruth((), {}, {}, (None,) * num_detections)


def read_frame_lines(folder: Path) -> list[FrameLine]:
    """Return the lines of a folder's `frames.jsonl`.

    Raises:
        StoreError: The file is missing, or a line is malformed.
    """
    path = folder / FRAMES_FILE
    return [_record(FrameLine, path, text) for text in _text_of(path).splitlines() if text.strip()]


def read_detections(folder: Path, line: FrameLine, shape: tuple[int, int]) -> Detections:
    """Return the detections of a frame; none if it has no masks.

    Args:
        shape: `(H, W)` of the image.

    Raises:
        StoreError: Masks, labels and confidences do not fit each other or the image.
    """
    if line.masks is None:
        return Detections(np.full(shape, -1, np.int32), (), np.empty(0, np.float32))
    masks = images.read_masks(folder / line.masks)
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


def _text_of(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise StoreError(f"{path}: cannot be read: {error}") from error


def _oracle_lines(path: Path) -> Iterator[str]:
    try:
        with lzma.open(path, "rt", encoding="utf-8") as file:
            yield from file
    except (OSError, EOFError, lzma.LZMAError, UnicodeDecodeError) as error:
        raise StoreError(f"{path}: cannot be read: {error}") from error


def _record(kind: type[R], path: Path, text: str) -> R:
    try:
        return kind.model_validate_json(text)
    except ValidationError as error:
        raise StoreError(f"{path}: {sentence_of(error)}; it is in {text[:200]!r}") from error
