"""Plan visits to the arrangements of a house, made by the generator of tasks, and the walks in them (S0 to S5, S9)."""

import hashlib
import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from evonav import _core
from evonav._core import House
from evonav.errors import HouseError
from evonav.generation.pipeline import TaskRejectedError, generate_task
from evonav.memory_benchmark.streams.evidence import MOVED_MIN_M
from evonav.memory_benchmark.streams.plan import HOURS_BETWEEN_VISITS, PlannedScene, StreamPlan
from evonav.memory_benchmark.streams.spec import Kind, StreamSpec
from evonav.tasks.parameters import Extensions, GenerationParameters, Occurrence, Schedule
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose

NUM_VISITS: dict[Kind, int] = {"S5": 10, "S9": 2}
"""Visits of the kinds that have not four; S9's two houses are one visit."""
NUM_ATTEMPTS = 8
"""Tries to make a stream whose house changes before every visit; then the one with the most changed visits is taken."""
EARLIEST, LATEST = 0.4, 0.6
"""Part of the visit in which the change of S9 happens."""
_COME_AND_GO = Occurrence(probability=1.0, max_count=4)
_MODES: dict[Kind, tuple[float, float, float]] = {
    "S1": (1.0, 0.0, 0.0),
    "S2": (0.0, 1.0, 0.0),
    "S3": (0.0, 0.0, 1.0),
    "S6": (1.0, 1.0, 0.0),
    "S9": (1.0, 1.0, 0.0),
}
"""Relative probabilities of `SALIENT_OBJECT`, `RETAIN_GROUP` and `FULL_SHUFFLE`: one alone above 0 is always drawn."""
_EXTENSIONS: dict[Kind, Extensions] = {
    "S4": Extensions(
        insertion=_COME_AND_GO,
        removal=_COME_AND_GO,
        doors=Occurrence(probability=1.0, max_count=2),
        openables=Occurrence(probability=1.0, max_count=3),
    ),
    "S5": Extensions(
        schedule=Schedule(num_persons=3, minutes_between_stages=round(60 * HOURS_BETWEEN_VISITS), tidiness=0.8)
    ),
    "S6": Extensions(insertion=_COME_AND_GO, removal=_COME_AND_GO),
    "S9": Extensions(insertion=_COME_AND_GO, removal=_COME_AND_GO),
}


def houses_of_visits(spec: StreamSpec, house: House) -> tuple[str, ...]:
    """Return the house of every visit as JSON (Algorithm 1); of S9, the house before and after the change.

    Raises:
        HouseError: The generator refuses the house at every attempt; says why.
    """
    kind = spec.walk_kind
    if kind not in _MODES and kind not in _EXTENSIONS:
        return (house.to_json(),)
    salient, group, shuffle = _MODES.get(kind, (1.0, 0.0, 0.0))
    parameters = GenerationParameters(
        num_stages=(NUM_VISITS.get(kind, 4),),
        evolve_probability=1.0 if kind in _MODES else 0.0,
        salient_object_probability=salient,
        retain_group_probability=group,
        full_shuffle_probability=shuffle,
        reference_image_px=64,
        reference_style="plain",
        reference_min_visible_px=1,
        extensions=_EXTENSIONS.get(kind, Extensions()),
    )
    houses_json: tuple[str, ...] = ()
    most_changed, refused = -1, ""
    for attempt in range(NUM_ATTEMPTS):
        try:
            task = generate_task(
                house,
                seed=spec.seed,
                config=parameters,
                allow_unknown_assets=spec.allow_unknown_assets,
                attempt=attempt,
            )
        except TaskRejectedError as error:
            refused = str(error)
            continue
        evolutions = [stage.evolution for stage in task.oracle_stages[1:]]
        num_changed = sum(bool(one.relocated_ids or one.additions or one.removals) for one in evolutions)
        if num_changed > most_changed:
            houses_json, most_changed = task.houses_json, num_changed
        # People are at home or not: days without changes belong to their schedule.
        if num_changed == len(evolutions) or (kind == "S5" and num_changed > 0):
            break
    if not houses_json:
        raise HouseError(f"house {house.name}: no stream of kind {kind}: {refused}")
    return houses_json


def visits(spec: StreamSpec, house: House) -> StreamPlan:
    """Plan one visit of each arrangement of the house; each begins where the last one ended, or near it.

    Args:
        house: The house before the changes.

    Raises:
        HouseError: The house does not change at any attempt.
    """
    houses = houses_of_visits(spec, house)
    plan, at = StreamPlan([PlannedScene(house_json) for house_json in houses], []), None
    for number, house_json in enumerate(houses):
        poses = list(islice(walk_in(spec, house_json, at, f"visit {number + 1}"), spec.frames_a_visit))
        plan.add(number, number + 1, poses)
        at = poses[-1]
    return plan


def during_visit(spec: StreamSpec, house: House) -> StreamPlan:
    """Plan one visit of twice the usual length, with one change near its middle; the walk goes on from where it is.

    With an even seed, the change happens at the frame that shows most of it, and with an odd one where least of it is
    in view.

    Args:
        house: The house before the change.

    Raises:
        HouseError: The house does not change at any attempt.
    """
    before, after = houses_of_visits(spec, house)
    num_frames = 2 * spec.frames_a_visit
    poses = list(islice(walk_in(spec, before, None, "before"), int(LATEST * num_frames) + 1))
    at = _moment(spec, before, after, poses, int(EARLIEST * num_frames))
    plan = StreamPlan([PlannedScene(before), PlannedScene(after)], [])
    plan.add(0, 1, poses[:at])
    plan.add(1, 1, islice(walk_in(spec, after, poses[at], "after"), num_frames - at))
    return plan


def _moment(spec: StreamSpec, before: str, after: str, poses: list[Pose], earliest: int) -> int:
    """Return the index of the pose at which the change happens; the agent must fit there afterwards."""
    simulators = [
        EmbeddedSimulator(spec.camera, allow_unknown_assets=spec.allow_unknown_assets) for _ in (before, after)
    ]
    positions_m = []
    for simulator, house_json in zip(simulators, (before, after), strict=True):
        simulator.reset(house_json)
        positions_m.append({item.id: item.position_m for item in House(house_json, name=spec.house).objects})
    there = [index for index in range(earliest, len(poses)) if simulators[1].is_free(poses[index].position_m)]
    if not there:
        return earliest
    shown_px = []
    for index in there:
        number = 0
        for simulator, own, other in zip(simulators, positions_m, reversed(positions_m), strict=True):
            frame = simulator.render(poses[index], rgb=False)
            assert frame.stored_instances is not None
            areas = _core.instance_areas(frame.stored_instances, len(simulator.objects))
            is_changed = [
                body.id in own and (body.id not in other or math.dist(own[body.id], other[body.id]) > MOVED_MIN_M)
                for body in simulator.objects
            ]
            number += int(areas[is_changed].sum())
        shown_px.append(number)
    choose = np.argmax if spec.seed % 2 == 0 else np.argmin
    return there[int(choose(shown_px))]


def walk_in(spec: StreamSpec, house_json: str, at: Pose | None, name: str) -> Iterator[Pose]:
    """Yield the poses of a walk without an end.

    Args:
        at: Pose to begin at, or near it; `None` for the house's own start.
        name: Name of the walk: every walk has draws of its own.
    """
    simulator = EmbeddedSimulator(spec.camera, allow_unknown_assets=spec.allow_unknown_assets)
    simulator.reset(house_json, at)
    generator = generator_of(spec.walk_kind, spec.house_name, spec.seed, name)
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
