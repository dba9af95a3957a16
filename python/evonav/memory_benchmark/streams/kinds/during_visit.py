"""Plan a visit during which things move (S9)."""

import math
from itertools import islice

import numpy as np

from evonav import _core
from evonav._core import House
from evonav.memory_benchmark.streams.evidence import MOVED_MIN_M
from evonav.memory_benchmark.streams.evolution import houses_of_visits
from evonav.memory_benchmark.streams.kinds.visits import Frames, walk_in
from evonav.memory_benchmark.streams.plan import PlannedScene, StreamPlan
from evonav.memory_benchmark.streams.spec import StreamSpec
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose

EARLIEST, LATEST = 0.4, 0.6
"""Part of the visit in which the change happens."""


def during_visit(spec: StreamSpec, house: House) -> StreamPlan:
    """Plan one visit of twice the usual length, with one change near its middle; the walk goes on from where it is.

    With an even seed, the change happens at the frame that shows most of it, and with an odd one where least of it is
    in view.

    Args:
        house: The house before the change.

    Raises:
        HouseError: The house does not change at any attempt.
    """
    before, after = houses_of_visits("S9", house, spec.seed, allow_unknown_assets=spec.allow_unknown_assets)
    num_frames = 2 * spec.frames_a_visit
    poses = list(islice(walk_in(spec, before, None, "before"), int(LATEST * num_frames) + 1))
    at = _moment(spec, before, after, poses, int(EARLIEST * num_frames))
    frames = Frames()
    frames.add(0, 1, poses[:at])
    frames.add(1, 1, islice(walk_in(spec, after, poses[at], "after"), num_frames - at))
    return frames.plan((PlannedScene(before), PlannedScene(after)))


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
