"""Walk through a house: poses at the rate of a camera, along shortest paths, with a look around at every place."""

import hashlib
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from evonav._core import House
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose

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
