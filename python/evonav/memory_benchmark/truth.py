"""The oracle part of a stream: what stands where, what changed when, and what each frame shows of it.

Only the judge reads this. No memory is given any of it.
"""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass
from typing import Literal, Protocol

import numpy as np

from evonav.memory_benchmark.protocol import MemoryFrame, StreamInfo
from evonav.world.simulator import SceneObject

EVIDENCE_PX = 25
"""Pixels in one frame from which on it is evidence of an object that is detected in it, or of an empty place."""

ChangeKind = Literal["moved", "removed", "added"]


@dataclass(frozen=True, slots=True)
class TrueChange:
    """One object that moved, vanished or appeared."""

    object_id: str
    label: str
    kind: ChangeKind
    frame: int
    """Index of the first frame at which the change is true."""
    before: SceneObject | None
    """The object at its old place; `None` if it was added."""
    after: SceneObject | None
    """The object at its new place; `None` if it was removed."""


@dataclass(frozen=True, slots=True)
class FrameTruth:
    """The truth of one frame."""

    objects: Sequence[SceneObject]
    """All that stands in the house while the frame is taken; the same sequence as long as nothing changes."""
    visible_px: Mapping[str, int]
    """Pixels of each object in the image, by its id, as far as `EVIDENCE_RANGE_M` on the ground plane."""
    empty_px: Mapping[int, int]
    """Pixels that look through the place which an object has left, by the index of the change, within that range.

    Such a pixel's ray meets the object's old box, and the depth image shows something behind it.
    """
    detected_ids: Sequence[str | None]
    """Object of each detection; `None` for a false one."""


class Stream(Protocol):
    """One stream: the same frames whenever it is read."""

    name: str
    """Its kind, house and seed, such as `S1/bundled-0012/0`."""
    kind: str
    """`S0` to `S9`, or `recording`."""
    house: str
    """The house that intervals are resampled by."""
    info: StreamInfo
    """The public facts, which a memory is told."""
    changes: Sequence[TrueChange]
    """All changes, in the order of time."""
    has_truth: bool
    """False if nothing is known of what stands where: then only speed and size are measured."""

    def frames(self) -> Iterator[tuple[MemoryFrame, FrameTruth]]:
        """Render or read the stream, one frame at a time."""


class Digest:
    """Hashes a stream while it is read: equal digests mean equal frames and equal truth, bit by bit."""

    def __init__(self, stream: Stream) -> None:
        """Begin with what is known before the first frame."""
        self._hash = hashlib.sha256()
        self._objects: object = None
        self._add(stream.name, stream.kind, stream.house, astuple(stream.info), *map(astuple, stream.changes))

    def add(self, frame: MemoryFrame, truth: FrameTruth) -> None:
        """Add the next frame, all its arrays and its truth."""
        self._add(frame.index, frame.time_s, frame.visit, astuple(frame.view.pose), frame.view.detections.labels)
        for array in frame.arrays():
            self._add(array.dtype.str, array.shape)
            self._hash.update(np.ascontiguousarray(array).data)
        if truth.objects is not self._objects:
            self._objects = truth.objects
            self._add(*map(astuple, truth.objects))
        self._add(dict(truth.visible_px), dict(truth.empty_px), tuple(truth.detected_ids))

    def hexdigest(self) -> str:
        """Return the SHA-256 of what was added, 64 hexadecimal digits."""
        return self._hash.hexdigest()

    def _add(self, *values: object) -> None:
        for value in values:
            self._hash.update(f"{value!r}\0".encode())
