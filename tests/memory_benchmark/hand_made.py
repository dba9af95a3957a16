"""Streams and memories of a few lines, whose figures are known in advance."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from evonav.memory_benchmark.protocol import MemoryEntry, MemoryFrame, StreamInfo
from evonav.memory_benchmark.truth import FrameTruth, TrueChange
from evonav.sensors.observation import NO_OCCUPANCY, Detections, View
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics, SceneObject

INTRINSICS = Intrinsics(4, 4, 1.0)
RATE_HZ = 2.0
SIZE_M = (0.2, 0.2, 0.2)
INFO = StreamInfo(INTRINSICS, ("Mug", "Plate"), RATE_HZ)


def body(object_id: str, x_m: float, category: str = "Mug") -> SceneObject:
    return SceneObject(object_id, category, "object", (x_m, 1.0, 0.0), SIZE_M)


def entry(entry_id: int, x_m: float, label: str = "Mug", p: float | None = None) -> MemoryEntry:
    return MemoryEntry(entry_id, label, (x_m, 1.0, 0.0), SIZE_M, p_present=p)


def view(x_m: float = 0.0) -> View:
    detections = Detections(np.full((4, 4), -1, np.int32), (), np.zeros(0, np.float32))
    depth_m = np.full((4, 4), 2.0, np.float32)
    return View(Pose(x_m, 1.5, 0.0, 0.0), INTRINSICS, depth_m, detections, NO_OCCUPANCY)


@dataclass
class Shot:
    """One frame of a hand-made stream."""

    objects: Sequence[SceneObject]
    visit: int = 1
    visible: Mapping[str, int] = field(default_factory=dict)
    empty: Mapping[int, int] = field(default_factory=dict)
    detected: Sequence[str] | None = None
    """Default: all that is visible."""


@dataclass
class HandMade:
    """A stream of shots; the camera moves half a metre a frame, and an hour passes between visits."""

    shots: Sequence[Shot]
    changes: Sequence[TrueChange] = ()
    name: str = "S0/hand-made/0"
    kind: str = "S0"
    house: str = "hand-made"
    info: StreamInfo = INFO
    has_truth: bool = True

    def frames(self) -> Iterator[tuple[MemoryFrame, FrameTruth]]:
        time_s, last = 0.0, self.shots[0]
        for index, shot in enumerate(self.shots):
            if index:
                time_s += 1.0 / RATE_HZ if shot.visit == last.visit else 3600.0
            last = shot
            frame = MemoryFrame(index, time_s, shot.visit, view(0.5 * index))
            detected = tuple(shot.visible) if shot.detected is None else shot.detected
            yield frame, FrameTruth(shot.objects, shot.visible, shot.empty, detected)


class Scripted:
    """A memory whose answer after frame `i` is known."""

    def __init__(self, answer: Callable[[int], Sequence[MemoryEntry]]) -> None:
        self._answer = answer
        self._index = -1

    def reset(self, info: StreamInfo) -> None:
        self._index = -1

    def visit(self, time_s: float) -> None:
        pass

    def observe(self, frame: MemoryFrame) -> None:
        self._index = frame.index

    def entries(self) -> Sequence[MemoryEntry]:
        return self._answer(self._index)
