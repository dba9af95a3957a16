"""The oracle part of a stream: what stands where, what changed when, and what each frame shows of it.

Only the judge reads this. No memory is given any of it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from evonav.memory_benchmark.protocol import MemoryFrame, StreamInfo
from evonav.world.simulator import SceneObject

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

    @property
    def name(self) -> str:
        """Its kind, house and seed, such as `S1/bundled-0012/0`."""

    @property
    def kind(self) -> str:
        """`S0` to `S9`."""

    @property
    def house(self) -> str:
        """The house that intervals are resampled by."""

    @property
    def info(self) -> StreamInfo:
        """The public facts, which a memory is told."""

    @property
    def changes(self) -> Sequence[TrueChange]:
        """All changes, in the order of time."""

    @property
    def has_truth(self) -> bool:
        """False if nothing is known of what stands where: then only speed and size are measured."""

    def frames(self) -> Iterator[tuple[MemoryFrame, FrameTruth]]:
        """Render the stream, one frame at a time."""
