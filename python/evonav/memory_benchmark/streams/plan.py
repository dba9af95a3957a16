"""Define a stream's plan, from which its frames are rendered: the houses, and a pose, a time and a visit a frame.

A plan is small and is stored in evonav's cache folder under the hash of what decides it.
"""

import hashlib
import json
import lzma
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav._core import __version__
from evonav.errors import EvonavError
from evonav.house.procthor10k import cache_folder
from evonav.parallel.folders import write_atomically
from evonav.world.pose import Pose

PLAN_VERSION = 2
"""Part of every hash: it changes with the code that makes plans."""


@dataclass(frozen=True, slots=True)
class PlannedScene:
    """A house as it is for a part of the stream."""

    house_json: str
    offset_m: tuple[float, float] = (0.0, 0.0)
    """Place of the house's origin on the ground plane, `(x, z)`: S7 has houses side by side."""
    prefix: str = ""
    """Put before the ids of the house's objects, so that they differ from other houses' ids."""


@dataclass(frozen=True, slots=True)
class StreamPlan:
    """All frames of a stream, not rendered yet."""

    scenes: tuple[PlannedScene, ...]
    frame_scenes: NDArray[np.int64]
    """`(F,)` index of the scene of each frame."""
    visits: NDArray[np.int64]
    """`(F,)` 1-based number of the visit."""
    times_s: NDArray[np.float64]
    """`(F,)` time since the first frame."""
    poses: NDArray[np.float64]
    """`(F, 4)` x, z, yaw and horizon in the frame of the scene's house; metres and radians."""
    checkpoints: tuple[tuple[int, int], ...] = ()
    """Numbers of objects of S7, each with the index of the frame at which so many have been seen."""

    def pose(self, index: int) -> Pose:
        """Return the pose of a frame in the frame of its scene's house."""
        x_m, z_m, yaw_rad, horizon_rad = self.poses[index].tolist()
        return Pose(x_m, 0.0, z_m, yaw_rad, horizon_rad)

    def to_bytes(self) -> bytes:
        """Return the plan as compressed JSON."""
        values = {
            "scenes": [asdict(scene) for scene in self.scenes],
            **{name: getattr(self, name).tolist() for name in ("frame_scenes", "visits", "times_s", "poses")},
            "checkpoints": self.checkpoints,
        }
        return lzma.compress(json.dumps(values).encode(), preset=1)

    @staticmethod
    def from_bytes(data: bytes) -> "StreamPlan":
        """Read what `to_bytes` wrote.

        Raises:
            ValueError: It is no plan, or it is damaged.
        """
        try:
            values = json.loads(lzma.decompress(data))
            scenes = tuple(
                PlannedScene(one["house_json"], (one["offset_m"][0], one["offset_m"][1]), one["prefix"])
                for one in values["scenes"]
            )
            return StreamPlan(
                scenes,
                np.array(values["frame_scenes"], np.int64),
                np.array(values["visits"], np.int64),
                np.array(values["times_s"], np.float64),
                np.array(values["poses"], np.float64).reshape(-1, 4),
                tuple((number, frame) for number, frame in values["checkpoints"]),
            )
        except (lzma.LZMAError, KeyError, TypeError, IndexError) as error:
            raise ValueError(f"damaged plan: {error}") from error


def plan_folder() -> Path:
    """Return the folder of plans, `streams` in evonav's cache folder."""
    return cache_folder() / "streams"


def cached_plan(decides: Mapping[str, Any], make: Callable[[], StreamPlan]) -> StreamPlan:
    """Return the plan with this hash from the cache folder, or make it and store it there.

    A cache folder that cannot be written, and a damaged file, only cost time.

    Args:
        decides: Everything that decides the plan, as JSON.
    """
    text = json.dumps({"plan": PLAN_VERSION, "evonav": __version__, **decides}, sort_keys=True)
    path = plan_folder() / f"{hashlib.sha256(text.encode()).hexdigest()[:32]}.json.xz"
    with suppress(OSError, ValueError):
        return StreamPlan.from_bytes(path.read_bytes())
    plan = make()
    with suppress(OSError, EvonavError):
        write_atomically(path, plan.to_bytes())
    return plan
