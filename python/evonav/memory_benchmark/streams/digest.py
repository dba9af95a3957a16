"""The digest of a stream: equal digests mean equal frames and equal truth, bit by bit."""

import hashlib
from dataclasses import astuple

import numpy as np

from evonav.memory_benchmark.protocol import MemoryFrame
from evonav.memory_benchmark.truth import FrameTruth, Stream


class Digest:
    """Hashes a stream while it is read."""

    def __init__(self, stream: Stream) -> None:
        """Begin with what is known before the first frame."""
        self._hash = hashlib.sha256()
        self._objects: object = None
        self._add(stream.name, stream.kind, stream.house, astuple(stream.info), *map(astuple, stream.changes))

    def add(self, frame: MemoryFrame, truth: FrameTruth) -> None:
        """Add the next frame, all its arrays and its truth."""
        view, detections = frame.view, frame.view.detections
        self._add(frame.index, frame.time_s, frame.visit, astuple(view.pose), detections.labels)
        for array in (view.depth_m, view.rgb, detections.masks, detections.confidences, detections.features):
            if array is not None:
                self._add(array.dtype.str, array.shape)
                self._hash.update(np.ascontiguousarray(array).data)
        if truth.objects is not self._objects:
            self._objects = truth.objects
            self._add(*map(astuple, truth.objects))
        self._add(dict(truth.visible_px), dict(truth.empty_px), tuple(truth.detected_ids))

    def hexdigest(self) -> str:
        """Return the digest of what was added, 64 hexadecimal digits."""
        return self._hash.hexdigest()

    def _add(self, *values: object) -> None:
        for value in values:
            self._hash.update(f"{value!r}\0".encode())


def digest(stream: Stream) -> str:
    """Return the SHA-256 of all frames and all truth of a stream, 64 hexadecimal digits."""
    hashed = Digest(stream)
    for frame, truth in stream.frames():
        hashed.add(frame, truth)
    return hashed.hexdigest()
