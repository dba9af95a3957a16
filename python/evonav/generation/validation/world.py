"""Check the physics, target, reference view and path of a stage in the simulator."""

import json
import math
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from evonav import _core
from evonav.generation.validation.changes import Found
from evonav.generation.validation.problems import ProblemKind
from evonav.house import House, HouseObject
from evonav.points import Point2, Point3
from evonav.tasks.manifest import Task
from evonav.tasks.oracle import DuringRecord, OracleStage
from evonav.tasks.parameters import GenerationParameters
from evonav.tasks.records import PoseRecord
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.simulator import Frame, SceneObject, SimulatorConfig

TOUCH_M = 0.0025
"""Largest depth of touching bodies; generation allows 2 mm and rounds positions to 0.1 mm."""
REST_M = 0.02
"""Largest height over its support at which an object rests; recorded objects hover by up to 50 mm."""
FLOOR_M = 0.05
"""Height of an object's bottom from which an object without support counts as hanging on a wall."""
SAME_M = 1e-6
REACH_M = 0.3
"""Largest distance of a house's own start from the nearest free place, where the path begins."""
PATH_STEP_M = 0.05
"""Distance between points of a path whose room is determined."""
FIELD_OF_VIEW_DEG = 90.0
HORIZON_DEG = 30.0


def check_physics(
    source: House, house: House, source_counts: Counter[str], *, allow_unknown_assets: bool
) -> Iterator[Found]:
    """Yield bodies that overlap, leave their room or have no support.

    Args:
        source: House of stage 1.
        source_counts: Counts of the flaws that the source house has, too, by kind; updated.
        allow_unknown_assets: The option with which the task was generated.
    """
    found = json.loads(
        _core.inspect_house(source, house, touch_m=TOUCH_M, rest_m=REST_M, allow_unknown_assets=allow_unknown_assets)
    )
    for one in found:
        kind: ProblemKind = one["kind"]
        if one["is_own"]:
            source_counts[kind] += 1
        else:
            yield kind, f"{one['id']} and {one['other_id']}: {1000.0 * one['amount_m']:.1f} mm"


def simulator_of(task: Task, *, allow_unknown_assets: bool) -> EmbeddedSimulator:
    """Return a simulator with the camera of reference images."""
    parameters = task.header.parameters
    side_px, style = parameters.reference_image_px, parameters.reference_style
    config = SimulatorConfig(width_px=side_px, height_px=side_px, vertical_fov_deg=FIELD_OF_VIEW_DEG, style=style)
    return EmbeddedSimulator(config, allow_unknown_assets=allow_unknown_assets)


def check_target(task: Task, house: House, simulator: EmbeddedSimulator, oracle: OracleStage) -> Iterator[Found]:
    """Check the target's record against the house.

    Scores count objects that may be goals, `same_category_ids` all objects.
    """
    target = oracle.target
    objects = {one.id: one for one in house.objects}
    bodies = {one.id: one for one in simulator.objects if one.kind == "object"}
    if target.id not in objects or target.id not in bodies:
        yield "target", f"{target.id} is not in the house"
        return
    entry, category = objects[target.id], bodies[target.id].category
    alike = [one.id for one in house.objects if one.id != target.id and bodies[one.id].category == category]
    rivals = [i for i in alike if task.header.parameters.goals_on_walls or not _hangs(objects[i], bodies[i])]
    in_room = [i for i in rivals if objects[i].room_id == entry.room_id]
    score = 2.0 if not rivals else 1.5 if not in_room else 1.0
    x_m, _, z_m = entry.position_m
    fields = {
        "category": (target.category, category),
        "room_id": (target.room_id, house.room_of(x_m, z_m)),
        "position_m": (target.position_m, entry.position_m),
        "support_id": (target.support_id, entry.parent_id),
        "same_category_ids": (sorted(target.same_category_ids), sorted(alike)),
        "score": (target.score, score),
    }
    for field, (recorded, found) in fields.items():
        if recorded != found:
            yield "target", f"{field} is {recorded}, in the house {found}"


def _hangs(entry: HouseObject, body: SceneObject) -> bool:
    return entry.parent_id is None and body.centre_m[1] - body.size_m[1] / 2.0 >= FLOOR_M


def check_reference(task: Task, stage: int, house: House, simulator: EmbeddedSimulator) -> Iterator[Found]:
    """Check the reference pose and the view from it; the simulator holds the stage's house."""
    oracle, pose = task.oracle(stage), task.oracle(stage).reference_pose
    parameters, room_id = task.header.parameters, oracle.target.room_id
    yield from _check_pose(pose, oracle.target.position_m, room_id, parameters, house, simulator)
    if not simulator.is_free(oracle.start_pose.position_m):
        yield "start_cut_off", "no path between the stage's start and the house's own, where simulators begin"
    frame = simulator.render(pose.pose())
    if frame.rgb is None or oracle.target.id not in (one.id for one in simulator.objects):
        return
    yield from _check_visible(frame, oracle.target.id, oracle.reference_visible_px, parameters, simulator)
    control = task.header.control
    if control is not None and stage <= len(control.shown_goals) and control.shown_goals[stage - 1] != stage:
        return  # the agent is shown the image of an earlier stage, which is compared with the files
    differing = int(np.count_nonzero((frame.rgb != task.reference_images[stage - 1]).any(axis=2)))
    if differing:
        yield "reference_image", f"{differing} pixels differ from the view there"


def check_moved_target(
    oracle: OracleStage,
    during: DuringRecord,
    parameters: GenerationParameters,
    house: House,
    simulator: EmbeddedSimulator,
) -> Iterator[Found]:
    """Check the target after a change during a stage, in the simulator of the changed house: it can still be found."""
    entry = next((one for one in house.objects if one.id == oracle.target.id), None)
    if entry is None:
        yield "target", f"{oracle.target.id} is no longer in the house after the change during the stage"
        return
    fields = {
        "target_position_m": (during.target_position_m, entry.position_m),
        "target_support_id": (during.target_support_id, entry.parent_id),
        "is_target_relocated": (during.is_target_relocated, oracle.target.id in during.evolution.relocated_ids),
    }
    for field, (recorded, found) in fields.items():
        if recorded != found:
            yield "target", f"during.{field} is {recorded}, in the house {found}"
    pose, (x_m, _, z_m) = during.reference_pose, entry.position_m
    yield from _check_pose(pose, during.target_position_m, house.room_of(x_m, z_m), parameters, house, simulator)
    frame = simulator.render(pose.pose(), rgb=False)
    yield from _check_visible(frame, oracle.target.id, during.reference_visible_px, parameters, simulator)
    if not simulator.is_free(oracle.reference_pose.position_m):
        yield "start_cut_off", "the change during the stage cuts off the reference pose, where the next stage starts"
    if not simulator.is_free(pose.position_m):
        yield "reference_pose", "the target can no longer be reached after the change during the stage"


def _check_pose(
    pose: PoseRecord,
    target_m: Point3,
    room_id: str | None,
    parameters: GenerationParameters,
    house: House,
    simulator: EmbeddedSimulator,
) -> Iterator[Found]:
    """Check that a pose is one from which a reference view of a target may be taken."""
    x_m, _, z_m = pose.position_m
    dx_m, dz_m = target_m[0] - x_m, target_m[2] - z_m
    distance_m = math.hypot(dx_m, dz_m)
    if not parameters.reference_min_m - SAME_M <= distance_m <= parameters.reference_max_m + SAME_M:
        yield "reference_pose", f"{distance_m:.4f} m from the target"
    off_deg = (math.degrees(math.atan2(dx_m, dz_m)) - pose.yaw_deg + 180.0) % 360.0 - 180.0
    if abs(off_deg) > 0.5 + SAME_M or pose.horizon_deg != HORIZON_DEG:
        yield "reference_pose", f"looks {off_deg:.2f} degrees past the target, horizon {pose.horizon_deg} degrees"
    if house.room_of(x_m, z_m) != room_id:
        yield "reference_pose", f"in room {house.room_of(x_m, z_m)}, the target in {room_id}"
    if not simulator.can_move((x_m, z_m), (x_m, z_m)):
        yield "reference_pose", "the agent does not fit there"


def _check_visible(
    frame: Frame, target_id: str, recorded_px: int, parameters: GenerationParameters, simulator: EmbeddedSimulator
) -> Iterator[Found]:
    """Check the number of the target's pixels in a view."""
    ids = [one.id if one.kind == "object" else None for one in simulator.objects]
    if frame.instances is None or target_id not in ids:
        return
    visible_px = int(np.count_nonzero(frame.instances == ids.index(target_id) + 1))
    if visible_px != recorded_px or visible_px < parameters.reference_min_visible_px:
        yield "visibility", f"{visible_px} pixels of the target, recorded {recorded_px}"


def check_path(oracle: OracleStage, simulator: EmbeddedSimulator) -> Iterator[Found]:
    """Check the reference path's ends and length, and that no path is shorter."""
    ends = (oracle.start_pose.position_m, oracle.reference_pose.position_m)
    corners = oracle.reference_path_m
    length_m = sum(math.dist(a, b) for a, b in pairwise(corners))
    recorded_m = oracle.reference_path_length_m
    if abs(length_m - recorded_m) > SAME_M:
        yield "path", f"corners are {length_m} m long, reference_path_length_m is {recorded_m}"
    for name, (x_m, _, z_m), corner in (("start", ends[0], corners[0]), ("end", ends[1], corners[-1])):
        if math.dist((x_m, z_m), corner) > (REACH_M if name == "start" else 2.0 * SAME_M):
            yield "path", f"its {name} is {math.dist((x_m, z_m), corner):.6f} m from the pose"
    found_m = float(simulator.path_lengths_m(ends[0], np.array([ends[1]]))[0])
    if not math.isfinite(found_m):
        yield "path", "there is no path from start to reference pose"
    elif abs(found_m - recorded_m) > 2.0 * SAME_M:
        yield "path", f"the shortest path is {found_m} m long, recorded {recorded_m}"


def rooms_reached(house: House, simulator: EmbeddedSimulator, start: PoseRecord) -> set[str]:
    """Return the rooms with a position that the agent can reach from a pose."""
    if not simulator.teleport(start.pose()):
        return set()
    positions = simulator.reachable_positions()
    return {room for x_m, _, z_m in positions.tolist() if (room := house.room_of(x_m, z_m)) is not None}


def check_state(task: Task, stage: int, house: House) -> Iterator[Found]:
    """Check the record of S and the start pose against all earlier stages."""
    oracle, earlier = task.oracle(stage), task.oracle_stages[: stage - 1]
    expected_pose = earlier[-1].reference_pose if earlier else task.header.start_pose
    if oracle.start_pose != expected_pose:
        yield "state", "start_pose is not the end of the stage before"
    first = task.oracle(1).start_pose.position_m
    visited = {house.room_of(first[0], first[2])}
    for before in earlier:
        visited |= {house.room_of(*point) for point in _points_along(before.reference_path_m)}
    transitions = task.evolutions_before(stage)[1:]
    changed = [one.room_id if one.outcome == "evolved" else None for one in transitions]
    start = oracle.start_pose.position_m
    state = oracle.state
    fields = {
        "visited_room_ids": (sorted(state.visited_room_ids), sorted(visited - {None}, key=str)),
        "changed_room_ids": (list(state.changed_room_ids), changed[-2:]),
        "goal_room_ids": (list(state.goal_room_ids), [before.target.room_id for before in earlier][-2:]),
        "transition_room_id": (state.transition_room_id, house.room_of(start[0], start[2])),
    }
    for field, (recorded, found) in fields.items():
        if recorded != found:
            yield "state", f"{field} is {recorded}, from the earlier stages {found}"


def _points_along(corners: tuple[Point2, ...]) -> Iterator[Point2]:
    for (ax, az), (bx, bz) in pairwise(corners):
        num_steps = max(1, math.ceil(math.dist((ax, az), (bx, bz)) / PATH_STEP_M))
        for step in range(num_steps + 1):
            t = step / num_steps
            yield ax + t * (bx - ax), az + t * (bz - az)
