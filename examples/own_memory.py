"""A whole scene memory of one's own: a list of boxes, which forgets nothing.

    evonav bench memory --memory ./examples/own_memory.py:OwnMemory

A memory has these four methods. It may also have `locate(text, k)` and `num_bytes()` (docs/memory-benchmark.md).
"""

import math
from dataclasses import replace

from evonav.memory_benchmark.protocol import MemoryEntry, MemoryFrame, StreamInfo
from evonav.world.camera import unproject


class OwnMemory:
    """Takes the box around each detection; a detection near an entry of its label is that entry, seen again."""

    def reset(self, info: StreamInfo) -> None:
        """A new stream: forget everything."""
        self.remembered: list[MemoryEntry] = []

    def visit(self, time_s: float) -> None:
        """A new visit: things may have moved, and this memory does not care."""

    def observe(self, frame: MemoryFrame) -> None:
        """One frame."""
        found = frame.view.detections
        points_m = unproject(frame.view.depth_m, frame.view.pose, frame.view.intrinsics).reshape(-1, 3)
        for number, label in enumerate(found.labels):
            own_m = points_m[(found.masks == number).ravel()]
            low, high = own_m.min(axis=0), own_m.max(axis=0)
            (x, y, z), (width, height, depth) = ((low + high) / 2).tolist(), (high - low).tolist()
            new = MemoryEntry(len(self.remembered), label, (x, y, z), (width, height, depth))
            near = [e for e in self.remembered if e.label == label and math.dist(e.centre_m, new.centre_m) < 0.5]
            if near:
                self.remembered[near[0].entry_id] = replace(new, entry_id=near[0].entry_id)
            else:
                self.remembered.append(new)

    def entries(self) -> list[MemoryEntry]:
        """All that is believed now."""
        return self.remembered
