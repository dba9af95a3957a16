"""Plan one visit of each arrangement of a house (S0 to S5, and S8)."""

import hashlib
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np

from evonav._core import House
from evonav.memory_benchmark.streams.evolution import HOURS_BETWEEN_VISITS, houses_of_visits
from evonav.memory_benchmark.streams.plan import PlannedScene, StreamPlan
from evonav.memory_benchmark.streams.spec import RATE_HZ, Kind, StreamSpec
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


ACTIONS_A_FRAME = 2
"""Steps of 0.25 m, or turns of 15 degrees, between two frames: 1 m/s and 60 degrees a second at 2 Hz."""
_ARRIVED_M = 1e-6


def generator_of(*parts: object) -> np.random.Generator:
    """Return a random generator of its own for each list of names and numbers."""
    digest = hashlib.sha256("\0".join(map(str, ("memory stream", *parts))).encode()).digest()
    return np.random.Generator(np.random.PCG64(int.from_bytes(digest[:8], "big")))


def walk(simulator: EmbeddedSimulator, house: House, generator: np.random.Generator) -> Iterator[Pose]:
    """Yield the poses of a walk without an end, from the simulator's pose on, which comes first.

    In each round it goes to one place in every room, drawn from the reachable ones, to the nearest room first, and
    turns around once there.

    Args:
        simulator: The house, with the agent where the walk begins.
        house: The same house, for its rooms.
        generator: Draws the places, and to which side the agent turns.
    """
    config = simulator.config
    step_m, turn_rad = ACTIONS_A_FRAME * config.move_m, math.radians(ACTIONS_A_FRAME * config.turn_deg)
    rooms: dict[str, list[tuple[float, float, float]]] = {}
    for x_m, y_m, z_m in simulator.reachable_positions().tolist():
        rooms.setdefault(house.room_of(x_m, z_m) or "", []).append((x_m, y_m, z_m))
    at = simulator.pose
    yield at
    while True:
        left = {room: rooms[room][int(generator.integers(len(rooms[room])))] for room in sorted(rooms)}
        while left:
            lengths_m = simulator.path_lengths_m(at.position_m, np.array(list(left.values())))
            place = left.pop(list(left)[int(np.argmin(lengths_m))])
            for pose in _way(simulator, at, place, step_m, turn_rad):
                at = pose
                yield pose
            side = 1.0 if generator.random() < 0.5 else -1.0
            for _ in range(round(2.0 * math.pi / turn_rad)):
                at = replace(at, yaw_rad=at.yaw_rad + side * turn_rad).canonical()
                yield at


def _way(
    simulator: EmbeddedSimulator, start: Pose, place: tuple[float, float, float], step_m: float, turn_rad: float
) -> Iterator[Pose]:
    """Yield the poses of the shortest path to a place, which faces the way that it goes."""
    at = start
    for x_m, _, z_m in simulator.shortest_path(start.position_m, place).tolist():
        gap_m = math.dist((at.x_m, at.z_m), (x_m, z_m))
        if gap_m < _ARRIVED_M:
            continue
        heading_rad = math.atan2(x_m - at.x_m, z_m - at.z_m)
        # A remainder below one turn is taken along with the next step.
        while abs(rest_rad := math.remainder(heading_rad - at.yaw_rad, math.tau)) > turn_rad:
            at = replace(at, yaw_rad=at.yaw_rad + math.copysign(turn_rad, rest_rad)).canonical()
            yield at
        at = replace(at, yaw_rad=heading_rad).canonical()
        from_m, num_steps = (at.x_m, at.z_m), math.ceil(gap_m / step_m - _ARRIVED_M)
        for number in range(1, num_steps + 1):
            share = number / num_steps
            at = replace(at, x_m=from_m[0] + share * (x_m - from_m[0]), z_m=from_m[1] + share * (z_m - from_m[1]))
            yield at
