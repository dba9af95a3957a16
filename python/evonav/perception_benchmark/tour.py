"""Choose a tour of a house: the same views for every perception, in the order of a walk."""

import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.world.pose import Pose
from evonav.world.simulator import Simulator

VIEWS_PER_PLACE = 6
"""Evenly around: 60 degrees apart, so that views of 90 degrees overlap, as an agent's do."""


def tour(case: EpisodeSpec, stage: int, simulator: Simulator, *, views_per_room: int, seed: int) -> list[list[Pose]]:
    """Return poses by place, from the task's start on, each next place the nearest of those left.

    Places of a room lie as far apart as they can, the first one drawn; so is the heading that a place begins with.

    Args:
        stage: 1-based; the simulator has its house.
        simulator: Simulator at the task's start.
        views_per_room: Largest number of views, rounded up to whole places.
        seed: Together with task and stage it decides what is drawn.
    """
    digest = hashlib.sha256(f"perception tour\0{seed}\0{case.task_id}\0{stage}".encode()).digest()
    generator = np.random.Generator(np.random.PCG64(int.from_bytes(digest[:8], "big")))
    house = case.parsed_house(stage)
    rooms: dict[str, list[tuple[float, float]]] = {}
    for x_m, _, z_m in simulator.reachable_positions().tolist():
        room = house.room_of(x_m, z_m)
        if room is not None:
            rooms.setdefault(room, []).append((x_m, z_m))
    num_places = -(-views_per_room // VIEWS_PER_PLACE)
    places = [place for room in sorted(rooms) for place in _spread(rooms[room], num_places, generator)]
    start = simulator.pose
    found = []
    for x_m, z_m in _walk(places, (start.x_m, start.z_m)):
        first_rad = generator.uniform(0.0, 2.0 * math.pi)
        turns = (2.0 * math.pi * i / VIEWS_PER_PLACE for i in range(VIEWS_PER_PLACE))
        found.append([replace(start, x_m=x_m, z_m=z_m, yaw_rad=(first_rad + turn) % (2.0 * math.pi)) for turn in turns])
    return found


def _spread(
    places: Sequence[tuple[float, float]], count: int, generator: np.random.Generator
) -> Iterator[tuple[float, float]]:
    """Choose some of the places, each as far from those before as any is."""
    points = np.array(places)
    chosen = int(generator.integers(len(points)))
    gaps_m = np.full(len(points), np.inf)
    for _ in range(min(count, len(points))):
        yield places[chosen]
        gaps_m = np.minimum(gaps_m, np.hypot(*(points - points[chosen]).T))
        chosen = int(gaps_m.argmax())


def _walk(places: Sequence[tuple[float, float]], start: tuple[float, float]) -> Iterator[tuple[float, float]]:
    left, here = list(places), start
    while left:
        here = min(left, key=lambda place: (math.dist(place, here), place))
        left.remove(here)
        yield here
