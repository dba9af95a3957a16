"""Plan one visit of each arrangement of a house (S0 to S5, and S8)."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from evonav._core import House
from evonav.memory_benchmark.streams.evolution import HOURS_BETWEEN_VISITS, houses_of_visits
from evonav.memory_benchmark.streams.plan import PlannedScene, StreamPlan
from evonav.memory_benchmark.streams.spec import RATE_HZ, Kind, StreamSpec
from evonav.memory_benchmark.streams.walk import generator_of, walk
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose

PAUSE_S = 3600.0 * HOURS_BETWEEN_VISITS
"""Time from the last frame of a visit to the first of the next."""


@dataclass(slots=True)
class Frames:
    """The frames of a plan while it is made."""

    scenes: list[int] = field(default_factory=list)
    visits: list[int] = field(default_factory=list)
    times_s: list[float] = field(default_factory=list)
    poses: list[tuple[float, float, float, float]] = field(default_factory=list)

    def add(self, scene: int, visit: int, poses: Iterable[Pose]) -> None:
        """Add frames of a scene, at the rate of the camera; a new visit comes after a pause."""
        for pose in poses:
            time_s = 0.0
            if self.times_s:
                time_s = self.times_s[-1] + (1.0 / RATE_HZ if self.visits[-1] == visit else PAUSE_S)
            self.scenes.append(scene)
            self.visits.append(visit)
            self.times_s.append(time_s)
            self.poses.append((pose.x_m, pose.z_m, pose.yaw_rad, pose.horizon_rad))

    def plan(self, scenes: Iterable[PlannedScene], checkpoints: tuple[tuple[int, int], ...] = ()) -> StreamPlan:
        """Return the plan of these frames."""
        return StreamPlan(
            tuple(scenes),
            np.array(self.scenes, np.int64),
            np.array(self.visits, np.int64),
            np.array(self.times_s, np.float64),
            np.array(self.poses, np.float64).reshape(-1, 4),
            checkpoints,
        )


def visits(spec: StreamSpec, house: House) -> StreamPlan:
    """Plan one visit of each arrangement of the house; each begins where the last one ended, or near it."""
    kind: Kind = "S2" if spec.kind == "S8" else spec.kind
    houses = houses_of_visits(kind, house, spec.seed, allow_unknown_assets=spec.allow_unknown_assets)
    frames, at = Frames(), None
    for number, house_json in enumerate(houses):
        poses = list(islice(walk_in(spec, house_json, at, f"visit {number + 1}"), spec.frames_a_visit))
        frames.add(number, number + 1, poses)
        at = poses[-1]
    return frames.plan(PlannedScene(house_json) for house_json in houses)


def walk_in(spec: StreamSpec, house_json: str, at: Pose | None, name: str) -> Iterator[Pose]:
    """Yield the poses of a walk without an end.

    Args:
        at: Pose to begin at, or near it; `None` for the house's own start.
        name: Name of the walk: every walk has draws of its own.
    """
    simulator = EmbeddedSimulator(spec.camera, allow_unknown_assets=spec.allow_unknown_assets)
    simulator.reset(house_json, at)
    kind = "S2" if spec.kind == "S8" else spec.kind
    generator = generator_of(kind, spec.house_name, spec.seed, name)
    yield from walk(simulator, House(house_json, name=spec.house), generator)
