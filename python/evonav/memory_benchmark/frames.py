"""Define the input of a benchmarked memory: posed RGB-D frames with detections. Nothing here is oracle data."""

from dataclasses import dataclass

from evonav.sensors.observation import View
from evonav.world.simulator import Intrinsics


@dataclass(frozen=True, slots=True)
class StreamInfo:
    """The facts that a memory learns before the first frame of a stream."""

    intrinsics: Intrinsics
    labels: tuple[str, ...]
    """All labels that detections may have."""
    rate_hz: float
    """Frames a second within a visit."""


@dataclass(frozen=True, slots=True)
class MemoryFrame:
    """One frame of a stream."""

    index: int
    """0-based number in the stream."""
    time_s: float
    """Time since the first frame; between two visits it jumps."""
    visit: int
    """1-based number of the visit: things move between visits, and in some streams during them."""
    view: View
    """Pose, depth, colours and detections."""


def read_only(frame: MemoryFrame) -> MemoryFrame:
    """Make the arrays of a frame read-only, since all memories of a run are given the same ones; return the frame."""
    found = frame.view.detections
    for array in (frame.view.depth_m, frame.view.rgb, found.masks, found.confidences, found.features):
        if array is not None:
            array.flags.writeable = False
    return frame
