"""Define a stream's plan, from which its frames are rendered: the houses, and a pose, a time and a visit a frame.

A plan is small and is stored in evonav's cache folder under the hash of what decides it.
"""

import hashlib
import json
import lzma
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from pydantic import TypeAdapter

from evonav._core import __version__
from evonav.errors import EvonavError
from evonav.house.procthor10k import cache_folder
from evonav.memory_benchmark.streams.spec import RATE_HZ
from evonav.parallel.folders import write_atomically
from evonav.world.pose import Pose

PLAN_VERSION = 3
"""Part of every hash: it changes with the code that makes plans."""
HOURS_BETWEEN_VISITS = 4.0
PAUSE_S = 3600.0 * HOURS_BETWEEN_VISITS
"""Time from the last frame of a visit to the first of the next."""


@dataclass(frozen=True, slots=True)
class PlannedScene:
    """A house as it is for a part of the stream."""

    house_json: str
    offset_m: tuple[float, float] = (0.0, 0.0)
    """Place of the house's origin on the ground plane, `(x, z)`: S7 has houses side by side."""
    prefix: str = ""
    """Put before the ids of the house's objects, so that they differ from other houses' ids."""


@dataclass(frozen=True, slots=True)
class PlannedFrame:
    """A frame that is not rendered yet."""

    scene: int
    """Index of its scene."""
    visit: int
    """1-based number of the visit."""
    time_s: float
    """Time since the first frame."""
    pose: Pose
    """Pose in the frame of the scene's house, of height 0."""


@dataclass(frozen=True, slots=True)
class StreamPlan:
    """All frames of a stream."""

    scenes: list[PlannedScene]
    frames: list[PlannedFrame]

    def add(self, scene: int, visit: int, poses: Iterable[Pose]) -> None:
        """Add frames of a scene, at the rate of the camera; a new visit comes after a pause."""
        for pose in poses:
            time_s = 0.0
            if self.frames:
                last = self.frames[-1]
                time_s = last.time_s + (1.0 / RATE_HZ if last.visit == visit else PAUSE_S)
            self.frames.append(PlannedFrame(scene, visit, time_s, replace(pose, y_m=0.0)))


_PLAN = TypeAdapter(StreamPlan)


def cached_plan(decides: Mapping[str, Any], make: Callable[[], StreamPlan]) -> StreamPlan:
    """Return the plan with this hash from the cache folder, or make it and store it there.

    A cache folder that cannot be written, and a damaged file, only cost time.

    Args:
        decides: Everything that decides the plan, as JSON.
    """
    text = json.dumps({"plan": PLAN_VERSION, "evonav": __version__, **decides}, sort_keys=True)
    path = cache_folder() / "streams" / f"{hashlib.sha256(text.encode()).hexdigest()[:32]}.json.xz"
    with suppress(OSError, EOFError, ValueError, lzma.LZMAError):
        return _PLAN.validate_json(lzma.decompress(path.read_bytes()))
    plan = make()
    with suppress(OSError, EvonavError):
        write_atomically(path, lzma.compress(_PLAN.dump_json(plan), preset=1))
    return plan
