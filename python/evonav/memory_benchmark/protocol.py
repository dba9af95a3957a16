"""Define the interface of a benchmarked memory, and its input: posed RGB-D frames with detections, no oracle data."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from numpy.typing import NDArray

from evonav.points import Point3
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

    def arrays(self) -> list[NDArray[Any]]:
        """Return the arrays that it has: depth, colours, masks, confidences, features."""
        found = self.view.detections
        every = (self.view.depth_m, self.view.rgb, found.masks, found.confidences, found.features)
        return [array for array in every if array is not None]

    def read_only(self) -> "MemoryFrame":
        """Make its arrays read-only, since all memories of a run are given the same ones; return the frame."""
        for array in self.arrays():
            array.flags.writeable = False
        return self


@dataclass(frozen=True, slots=True)
class MemoryEntry:
    """One object that a memory believes in."""

    entry_id: int
    """Number of the entry, the same as long as it stands for the same object."""
    label: str
    centre_m: Point3
    """Centre of its axis-aligned box, world frame."""
    size_m: Point3
    """Edges of the box."""
    confidence: float = 1.0
    """0 to 1."""
    p_present: float | None = None
    """Probability that the object is still there, 0 to 1; `None` for a memory that does not say."""
    first_seen_s: float | None = None
    """Time of the first frame that supports the entry."""
    last_seen_s: float | None = None
    """Time of the last one."""


@dataclass(frozen=True, slots=True)
class FoundPlace:
    """One answer to the question where something is."""

    position_m: Point3
    score: float
    """Larger is more certain; only the order counts."""


class Memory(Protocol):
    """A scene memory.

    It may also have `locate(text: str, k: int) -> Sequence[FoundPlace]`, which returns at most `k` places of what
    `text` names, the best first, and is timed; and `num_bytes() -> int`, the number of bytes that it holds.
    """

    def reset(self, info: StreamInfo) -> None:
        """Forget everything: a new stream begins."""

    def visit(self, time_s: float) -> None:
        """Begin a visit; time has passed, and things may have moved."""

    def observe(self, frame: MemoryFrame) -> None:
        """Integrate a frame; this is what is timed."""

    def entries(self) -> Sequence[MemoryEntry]:
        """Return all that the memory believes in now; this is not timed."""
