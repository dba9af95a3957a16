"""The digest of a stream: equal digests mean equal frames and equal truth, bit by bit."""

import hashlib
from dataclasses import astuple

import numpy as np
from numpy.typing import NDArray

from evonav.memory_benchmark.truth import Stream


def digest(stream: Stream) -> str:
    """Return the SHA-256 of all frames and all truth of a stream, as 64 hexadecimal digits."""
    hashed = hashlib.sha256()

    def add(*values: object) -> None:
        for value in values:
            hashed.update(f"{value!r}\0".encode())

    def add_array(array: NDArray[np.generic] | None) -> None:
        if array is not None:
            add(array.dtype.str, array.shape)
            hashed.update(np.ascontiguousarray(array).data)

    add(stream.name, stream.kind, stream.house, astuple(stream.info), *map(astuple, stream.changes))
    objects = None
    for frame, truth in stream.frames():
        view, detections = frame.view, frame.view.detections
        add(frame.index, frame.time_s, frame.visit, astuple(view.pose), detections.labels)
        for array in (view.depth_m, view.rgb, detections.masks, detections.confidences, detections.features):
            add_array(array)
        if truth.objects is not objects:
            objects = truth.objects
            add(*map(astuple, objects))
        add(dict(truth.visible_px), dict(truth.empty_px), tuple(truth.detected_ids))
    return hashed.hexdigest()
