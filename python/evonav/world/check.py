"""Test an implementation of `Simulator` against its contract, as Gymnasium's environment checker does."""

import math

import numpy as np
from numpy.typing import NDArray

from evonav.errors import SimulationError
from evonav.world.camera import unproject
from evonav.world.pose import Pose
from evonav.world.simulator import Action, Frame, Simulator

KINDS = frozenset({"object", "wall", "floor", "ceiling", "door", "window"})
_TOLERANCE_M = 1e-3
_TOLERANCE_RAD = 2e-6
"""Tolerance for angles; simulators may round them to 1e-4 degrees (`Pose.canonical`)."""
_MAX_LOST_SHARE = 0.02
"""Share of reachable positions and free cells that may disagree: two grids pass through different narrow gaps."""
_BOX_SLACK_M = 0.05
"""Distance that a visible point may lie outside the box of the object that it is assigned to."""


def check_simulator(simulator: Simulator, house_json: str) -> None:
    """Test a simulator's contract in one house, which is loaded several times.

    Tests cover shapes, types and value ranges; that a failed action changes nothing; the conventions (yaw clockwise,
    horizon down, planar depth, instance ids), by unprojecting images into the objects' boxes; that the navigation
    queries agree with each other; and that the same calls give the same answers.

    Args:
        simulator: Simulator with or without a house.
        house_json: A ProcTHOR house in which the agent can move.

    Raises:
        SimulationError: The contract is broken; the message says where, with the values found.
    """
    start = simulator.reset(house_json)
    _check(simulator.pose == start, f"reset returned {start}, but pose is {simulator.pose}")
    _check_objects(simulator)
    _check_turns(simulator)
    reachable_m = _check_reachable(simulator)
    _check_teleport(simulator, reachable_m)
    _check_moves(simulator, reachable_m)
    _check_images(simulator, reachable_m)
    _check_paths(simulator, reachable_m)
    _check_occupancy(simulator, reachable_m)
    _check_reset(simulator, house_json, start)
    simulator.close()
    simulator.close()


def _check(is_met: bool, message: str) -> None:
    if not is_met:
        raise SimulationError(f"check_simulator: {message}")


def _check_objects(simulator: Simulator) -> None:
    objects = simulator.objects
    _check(len(objects) > 0, "objects is empty")
    _check(any(o.kind == "floor" for o in objects), "objects holds no floor")
    for index, body in enumerate(objects):
        place = f"objects[{index}] ({body.id})"
        _check(body.kind in KINDS, f"{place}: kind is {body.kind!r}, not one of {sorted(KINDS)}")
        numbers = (*body.centre_m, *body.size_m)
        _check(len(numbers) == 6 and all(map(math.isfinite, numbers)), f"{place}: box is not finite: {numbers}")
        _check(min(body.size_m) >= 0, f"{place}: size is negative: {body.size_m}")


def _check_turns(simulator: Simulator) -> None:
    before = simulator.pose
    for action, sign in ((Action.TURN_RIGHT, 1), (Action.TURN_LEFT, -1)):
        pose = simulator.pose
        _check(simulator.step(action), f"{action.value} failed; turning cannot collide")
        turned_rad = _angle(simulator.pose.yaw_rad - pose.yaw_rad)
        requested_rad = sign * math.radians(simulator.config.turn_deg)
        _check(
            abs(turned_rad - requested_rad) < _TOLERANCE_RAD,
            f"{action.value} turned by {turned_rad} rad, not {requested_rad}",
        )
        _check(simulator.pose.position_m == pose.position_m, f"{action.value} moved the agent")
    _check(abs(_angle(simulator.pose.yaw_rad - before.yaw_rad)) < _TOLERANCE_RAD, "TURN_LEFT does not undo TURN_RIGHT")
    _check(simulator.step(Action.STOP), "STOP failed")
    _check(abs(_angle(simulator.pose.yaw_rad - before.yaw_rad)) < _TOLERANCE_RAD, "STOP turned the agent")


def _check_reachable(simulator: Simulator) -> NDArray[np.float64]:
    reachable_m = simulator.reachable_positions()
    _check(
        reachable_m.dtype == np.float64 and reachable_m.ndim == 2 and reachable_m.shape[1] == 3,
        f"reachable_positions is {reachable_m.dtype} {reachable_m.shape}, not float64 (N, 3)",
    )
    _check(len(reachable_m) > 1, "fewer than two reachable positions: the agent cannot move in this house")
    pose = simulator.pose
    offsets = (reachable_m[:, [0, 2]] - [pose.x_m, pose.z_m]) / simulator.config.grid_m
    _check(
        bool(np.abs(offsets - offsets.round()).max() < 1e-3),
        "reachable_positions are not on a grid of grid_m through the agent",
    )
    _check(bool((np.abs(offsets).max(axis=1) < 1e-3).any()), "the agent's own position is not reachable")
    for position in reachable_m[:: max(1, len(reachable_m) // 50)]:
        _check(simulator.is_free(_triple(position)), f"{position} is reachable, but is_free is False")
    nearest = simulator.nearest_reachable_position((pose.x_m + 0.05, pose.y_m, pose.z_m + 0.02))
    _check(
        math.dist((nearest[0], nearest[2]), (pose.x_m, pose.z_m)) < _TOLERANCE_M,
        f"nearest_reachable_position 5 cm beside the agent is {nearest}, not the agent's own position",
    )
    return reachable_m


def _check_teleport(simulator: Simulator, reachable_m: NDArray[np.float64]) -> None:
    for position in reachable_m[:: max(1, len(reachable_m) // 10)]:
        pose = Pose(*_triple(position), yaw_rad=1.0, horizon_rad=0.2)
        _check(simulator.teleport(pose), f"teleport to the reachable {position} failed")
        _check(_is_close(simulator.pose, pose), f"teleport to {pose} ended at {simulator.pose}")
    before = simulator.pose
    outside_m = reachable_m.max(axis=0) + 100.0
    _check(not simulator.teleport(Pose(*_triple(outside_m), yaw_rad=0.0)), "teleport 100 m outside succeeded")
    _check(simulator.pose == before, "a failed teleport changed the pose")
    _check(not simulator.is_free(_triple(outside_m)), "a position 100 m outside is free")


def _check_moves(simulator: Simulator, reachable_m: NDArray[np.float64]) -> None:
    """Move forward until something blocks, from several places in several directions."""
    num_moved = num_blocked = 0
    for index, position in enumerate(reachable_m[:: max(1, len(reachable_m) // 8)]):
        simulator.teleport(Pose(*_triple(position), yaw_rad=index * math.pi / 4))
        for _ in range(200):
            before = simulator.pose
            if not simulator.step(Action.MOVE_FORWARD):
                _check(simulator.pose == before, "a failed MOVE_FORWARD changed the pose")
                num_blocked += 1
                break
            num_moved += 1
            step_m = simulator.config.move_m
            requested = (before.x_m + step_m * math.sin(before.yaw_rad), before.z_m + step_m * math.cos(before.yaw_rad))
            got = (simulator.pose.x_m, simulator.pose.z_m)
            _check(
                math.dist(requested, got) < _TOLERANCE_M, f"MOVE_FORWARD from {before} ended at {got}, not {requested}"
            )
            _check(simulator.pose.yaw_rad == before.yaw_rad, "MOVE_FORWARD turned the agent")
            _check(simulator.is_free(simulator.pose.position_m), f"MOVE_FORWARD ended at {got}, which is not free")
    _check(num_moved > 0, "no MOVE_FORWARD succeeded")
    _check(num_blocked > 0, "no MOVE_FORWARD was ever blocked: walls do not stop the agent")


def _check_images(simulator: Simulator, reachable_m: NDArray[np.float64]) -> None:
    num_points = num_outside = 0
    for index, position in enumerate(reachable_m[:: max(1, len(reachable_m) // 6)]):
        pose = Pose(*_triple(position), yaw_rad=index * 0.7, horizon_rad=math.radians(15.0))
        before = simulator.pose
        frame = simulator.render(pose)
        _check(simulator.pose == before, "render moved the agent")
        _check_frame(simulator, frame, pose)
        again = simulator.render(pose)
        _check(np.array_equal(frame.depth_m, again.depth_m), "render twice from one pose gave two depth images")
        bare = simulator.render(pose, rgb=False, instances=False)
        _check(bare.rgb is None and bare.instances is None, "render made images that were not requested")
        _check(np.array_equal(frame.depth_m, bare.depth_m), "depth depends on which other images are requested")
        outside, seen = _count_outside_boxes(simulator, frame)
        num_outside, num_points = num_outside + outside, num_points + seen
    _check(num_points > 0, "no image showed anything")
    _check(
        num_outside <= 0.02 * num_points,
        f"{num_outside} of {num_points} pixels unproject outside the box of the object that their instance id names: "
        "yaw, horizon, field of view, planar depth or the instance table is off",
    )


def _check_frame(simulator: Simulator, frame: Frame, pose: Pose) -> None:
    config = simulator.config
    shape = (config.height_px, config.width_px)
    for name, image, requested in (
        ("depth_m", frame.depth_m, (np.float32, shape)),
        ("rgb", frame.rgb, (np.uint8, (*shape, 3))),
        ("instances", frame.instances, (np.int32, shape)),
    ):
        _check(image is not None, f"render did not return the requested {name}")
        if image is not None:
            got, promised = f"{image.dtype} {image.shape}", f"{np.dtype(requested[0])} {requested[1]}"
            _check(got == promised, f"{name} is {got}, not {promised}")
    depth_m, instances = frame.depth_m, frame.instances
    _check(bool((depth_m > 0).all()), "depth holds values that are not positive (nothing there is inf)")
    if instances is not None:
        last = len(simulator.objects)
        _check(bool(((instances >= 0) & (instances <= last)).all()), f"instance ids are not all in 0..{last}")
        _check(bool(((instances == 0) == np.isinf(depth_m)).all()), "depth must be inf exactly where the instance is 0")
    intrinsics = frame.intrinsics
    _check((intrinsics.height_px, intrinsics.width_px) == shape, f"intrinsics are of another image: {intrinsics}")
    requested_rad = math.radians(config.vertical_fov_deg)
    _check(
        abs(intrinsics.vertical_fov_rad - requested_rad) < 1e-6, f"field of view is {intrinsics.vertical_fov_rad} rad"
    )
    camera = Pose(pose.x_m, config.camera_height_m, pose.z_m, pose.yaw_rad, pose.horizon_rad)
    _check(_is_close(frame.pose, camera, y=True), f"frame.pose is {frame.pose}, expected the camera's: {camera}")


def _count_outside_boxes(simulator: Simulator, frame: Frame) -> tuple[int, int]:
    """Count the pixels that unproject outside their instance's box, and all pixels."""
    if frame.instances is None:
        return 0, 0
    rows, cols = np.nonzero(frame.instances)
    points_m = unproject(frame.depth_m, frame.pose, frame.intrinsics)[rows, cols]
    indices = frame.instances[rows, cols] - 1
    centres_m = np.array([o.centre_m for o in simulator.objects])[indices]
    reach_m = np.array([o.size_m for o in simulator.objects])[indices] / 2 + _BOX_SLACK_M
    is_outside = (np.abs(points_m - centres_m) > reach_m).any(axis=1)
    return int(is_outside.sum()), len(indices)


def _check_paths(simulator: Simulator, reachable_m: NDArray[np.float64]) -> None:
    start = _triple(reachable_m[0])
    for target_m in reachable_m[:: max(1, len(reachable_m) // 5)]:
        target = _triple(target_m)
        path_m = simulator.shortest_path(start, target)
        place = f"shortest_path from {start} to {target}"
        _check(path_m.ndim == 2 and path_m.shape[1] == 3, f"{place} has shape {path_m.shape}, not (M, 3)")
        _check(len(path_m) > 0, f"{place} is empty, but both ends are reachable from each other")
        for end_m, requested in ((path_m[0], start), (path_m[-1], target)):
            off_m = math.dist(end_m[[0, 2]], (requested[0], requested[2]))
            _check(off_m < 0.1, f"{place} ends {off_m:.3f} m off")
        length_m = float(np.linalg.norm(np.diff(path_m[:, [0, 2]], axis=0), axis=1).sum())
        straight_m = math.dist((start[0], start[2]), (target[0], target[2]))
        _check(length_m > straight_m - 0.2, f"{place} is {length_m:.3f} m long, shorter than the straight line")
    outside = _triple(reachable_m.max(axis=0) + 100.0)
    path_m = simulator.shortest_path(start, outside)
    _check(path_m.shape == (0, 3), f"shortest_path to a place 100 m outside has shape {path_m.shape}, not (0, 3)")


def _check_occupancy(simulator: Simulator, reachable_m: NDArray[np.float64]) -> None:
    grid = simulator.occupancy()
    _check(grid.cells.dtype == np.uint8 and grid.cells.ndim == 2, f"occupancy is {grid.cells.dtype}, not 2D uint8")
    _check(bool((grid.cells <= 1).all()), "occupancy holds values other than 0 and 1")
    _check(grid.cell_m == simulator.config.occupancy_cell_m, f"occupancy cells are {grid.cell_m} m")
    cols = np.floor((reachable_m[:, 0] - grid.corner_m[0]) / grid.cell_m).astype(int)
    rows = np.floor((reachable_m[:, 2] - grid.corner_m[1]) / grid.cell_m).astype(int)
    is_on_grid = (rows >= 0) & (cols >= 0) & (rows < grid.cells.shape[0]) & (cols < grid.cells.shape[1])
    _check(bool(is_on_grid.all()), "reachable positions are off the occupancy grid")
    # A position is up to 0.7 cells from its cell's centre, and the centre may be blocked: accept a free neighbour.
    padded = np.pad(grid.cells, 1, constant_values=1)
    around = [padded[rows + row, cols + col] for row in range(3) for col in range(3)]
    num_blocked = int(np.min(around, axis=0).sum())
    _check(
        num_blocked <= _MAX_LOST_SHARE * len(rows),
        f"{num_blocked} of {len(rows)} reachable positions are on blocked cells, and those around them are blocked too",
    )
    free = np.argwhere(grid.cells == 0)
    centres_m = np.asarray(grid.corner_m) + (free[:: max(1, len(free) // 200), ::-1] + 0.5) * grid.cell_m
    num_lost = sum(not simulator.is_free((x_m, 0.0, z_m)) for x_m, z_m in centres_m.tolist())
    _check(
        num_lost <= _MAX_LOST_SHARE * len(centres_m),
        f"{num_lost} of {len(centres_m)} free cells have a centre where is_free is False",
    )
    _check(bool(grid.cells.any()), "no cell is blocked: the house has walls")


def _check_reset(simulator: Simulator, house_json: str, start: Pose) -> None:
    first = simulator.render(start, rgb=False)
    objects = tuple(simulator.objects)
    _check(simulator.reset(house_json) == start, "reset with the same house gave another start pose")
    _check(tuple(simulator.objects) == objects, "reset with the same house gave other objects")
    second = simulator.render(rgb=False)
    _check(np.array_equal(first.depth_m, second.depth_m), "the same house and pose gave another depth image")
    requested = Pose(start.x_m, start.y_m, start.z_m, start.yaw_rad + 0.5, 0.0)
    effective = simulator.reset(house_json, requested)
    _check(_is_close(effective, requested), f"reset at the free pose {requested} ended at {effective}")


def _triple(position_m: NDArray[np.float64]) -> tuple[float, float, float]:
    x_m, y_m, z_m = position_m.tolist()
    return (x_m, y_m, z_m)


def _angle(angle_rad: float) -> float:
    return math.remainder(angle_rad, math.tau)


def _is_close(a: Pose, b: Pose, *, y: bool = False) -> bool:
    """Return whether two poses agree; heights are compared only with `y`."""
    return (
        math.dist((a.x_m, a.z_m), (b.x_m, b.z_m)) < _TOLERANCE_M
        and (not y or abs(a.y_m - b.y_m) < _TOLERANCE_M)
        and abs(_angle(a.yaw_rad - b.yaw_rad)) < _TOLERANCE_RAD
        and abs(a.horizon_rad - b.horizon_rad) < _TOLERANCE_RAD
    )
