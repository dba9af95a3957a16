"""Find paths: `GetReachablePositions`, `GetShortestPath*`, `ObjectNavExpertAction`.

Based on AI2-THOR's `BaseFPSAgentController`, whose messages these are. AI2-THOR searches its NavMesh; this engine
searches the exact free space of evonav's navigation.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from evonav.thor import objects
from evonav.thor.actions import motion
from evonav.thor.actions.registry import ActionError, Vector3, action, missing_arguments
from evonav.thor.agent import AgentBody
from evonav.thor.engine import Engine
from evonav.thor.geometry import Point, ground_gap_m, vector
from evonav.world.camera import project

_NAVMESH_Y_M = 0.01
"""Height of the corners of paths, as recorded (0.006 to 0.015 m over flat floors)."""
_SAMPLE_M = 0.2
"""Largest distance of a path's end from the free space."""
_ALLOWED_ERROR_M = 1e-4
"""Default for the largest distance that an end of a path may be moved without an error."""
_MAX_STEPS = 10_000
_MIN_GRID_M = 0.01
_MAX_POSITIONS = 250_000
"""Limit that is reached in a second or two; AI2-THOR's is `maxStepCount / gridSize**2`."""
_OFFSETS = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""Steps `(right, ahead)` on the grid, in AI2-THOR's order."""


@action("GetReachablePositions")
def get_reachable_positions(
    engine: Engine,
    *,
    maxStepCount: int | None = None,
    directionsRelativeAgent: bool = False,
    gridSize: float | None = None,
) -> list[dict[str, float]]:
    """Return the positions of the grid through the agent that it can reach in straight steps, nearest first."""
    grid_m = gridSize or engine.settings.gridSize
    if grid_m < _MIN_GRID_M:
        raise ActionError(f"GetReachablePositions: gridSize {grid_m:g} is less than {_MIN_GRID_M:g} m")
    limit = math.floor((_MAX_STEPS if maxStepCount is None else maxStepCount) / (grid_m * grid_m))
    y_m, positions = engine.agent.y_m, []
    for x_m, z_m in _walk(engine, engine.agent.point_m, grid_m, directionsRelativeAgent):
        positions.append(vector((x_m, y_m, z_m)))
        if len(positions) > limit:
            raise motion.invalid_operation("Too many steps taken in GetReachablePositions.")
        if len(positions) > _MAX_POSITIONS:
            size = f"gridSize {grid_m:g} m gives more than {_MAX_POSITIONS} positions"
            raise motion.invalid_operation(f"Too many steps taken in GetReachablePositions: {size}.")
    return positions


def _walk(engine: Engine, start_m: Point, grid_m: float, is_relative: bool = False) -> Iterator[Point]:
    """Yield the grid's points breadth first, beginning with the start, even where the agent does not fit.

    A point that cannot be reached from one neighbour may be reached from another. AI2-THOR's flood fill drops such
    points, which leaves holes that depend on the start.
    """
    can_move = engine.scene.simulator.can_move
    # Coordinates are multiples of the start's, so a point has the same ones on every path to it.
    if is_relative:
        sine, cosine = math.sin(engine.agent.yaw_rad) * grid_m, math.cos(engine.agent.yaw_rad) * grid_m
        (right_x, right_z), (ahead_x, ahead_z) = (cosine, -sine), (sine, cosine)
    else:
        (right_x, right_z), (ahead_x, ahead_z) = (grid_m, 0.0), (0.0, grid_m)
    queue, seen = [((0, 0), start_m)], {(0, 0)}
    for (right, ahead), point_m in queue:  # the loop appends to the queue
        yield point_m
        for step in _OFFSETS:
            cell = (right + step[0], ahead + step[1])
            if cell in seen:
                continue
            next_m = (
                start_m[0] + (cell[0] * right_x + cell[1] * ahead_x),
                start_m[1] + (cell[0] * right_z + cell[1] * ahead_z),
            )
            if can_move(point_m, next_m):
                seen.add(cell)
                queue.append((cell, next_m))


@action("GetShortestPathToPoint")
def get_shortest_path_to_point(
    engine: Engine,
    *,
    position: Vector3 | None = None,
    target: Vector3 | None = None,
    x: float | None = None,
    y: float = 0.0,
    z: float | None = None,
    allowedError: float = _ALLOWED_ERROR_M,
) -> dict[str, Any]:
    """Return the path from `position` (default: the agent) to `target`, or to `x, y, z` in the client helper's form."""
    if target is None:
        if x is None or z is None:
            raise missing_arguments("GetShortestPathToPoint", "target")
        target = Vector3(x=x, y=y, z=z)
    return _path_record(_path(engine, _start(engine, position), (target.x, target.z), allowedError))


@action("GetShortestPath")
def get_shortest_path(
    engine: Engine,
    *,
    objectId: str | None = None,
    objectType: str | None = None,
    position: Vector3 | None = None,
    rotation: Vector3 | None = None,
    allowedError: float = _ALLOWED_ERROR_M,
) -> dict[str, Any]:
    """Return the path to the first position of the grid from which an agent that looks at the object sees it.

    `rotation` has no effect: the grid is aligned with the world, and the camera turns to the object.
    """
    start_m = _start(engine, position)
    return _path_record(_path_to_object(engine, _object(engine, objectType, objectId), start_m, allowedError))


@action("VisualizePath")
def visualize_path(engine: Engine, *, positions: list[Vector3] | None = None, **_: object) -> None:
    """Do nothing: a path is not drawn into the agent's images."""
    if not positions:
        raise ActionError("ArgumentException: Path cannot be null or empty.")


@action("HideVisualizedPath")
def hide_visualized_path(engine: Engine, *, pathName: str = "PathVisualization") -> None:
    """Do nothing: no path was drawn."""


@action("ObjectTypeToObjectIds")
def object_type_to_object_ids(engine: Engine, *, objectType: str) -> list[str]:
    """Return the ids of all objects of a type; spaces and case do not matter."""
    wanted = objectType.replace(" ", "").lower()
    records = objects.static_records(engine.scene)
    return [record["objectId"] for record in records if record["objectType"].lower() == wanted]


@action("ObjectNavExpertAction")
def object_nav_expert_action(
    engine: Engine,
    *,
    objectId: str | None = None,
    objectType: str | None = None,
    position: Vector3 | None = None,
) -> str:
    """Return the next action towards a position, or towards an object until it is in the image."""
    here_m = engine.agent.point_m
    step_deg = engine.settings.rotateStepDegrees
    record = None
    if objectId or objectType:
        record = _object(engine, objectType, objectId)
        corners_m = _path_to_object(engine, record, here_m, _ALLOWED_ERROR_M)
    elif position is not None:
        corners_m = _path(engine, here_m, (position.x, position.z), _ALLOWED_ERROR_M)
    else:
        raise missing_arguments("ObjectNavExpertAction", "position")
    num_turns = round(360.0 / step_deg)
    if abs(num_turns - 360.0 / step_deg) > 1e-5:
        raise ActionError("Invalid rotate step degrees for agent, must divide 360 without a remainder.")
    turns = range(-(num_turns // 2), num_turns // 2 + (1 if num_turns % 2 == 0 else 0) + 1)
    if len(corners_m) <= 1 or math.dist(corners_m[0], corners_m[-1]) < 1e-6:
        return _look_action(engine, turns, step_deg, record)
    return _walk_action(engine, turns, step_deg, corners_m[1])


def _look_action(engine: Engine, turns: range, step_deg: float, record: dict[str, Any] | None) -> str:
    """Return the first action of the fewest turns and looks that bring the object into the image."""
    agent = engine.agent
    if record is None or _is_framed(engine, agent, record):
        raise ActionError("")  # AI2-THOR's answer when nothing is left to do.
    level = int(agent.horizon_deg / 30.0)
    ways = [
        (abs(turn) + abs(look - level), turn, look - level)
        for turn in turns
        for look in range(-1, 3)
        if _is_framed(engine, replace(agent, yaw_deg=agent.yaw_deg + turn * step_deg, horizon_deg=30.0 * look), record)
    ]
    _, turn, look = min(ways, key=lambda way: way[0], default=(0, 0, 0))
    if turn:
        return "RotateLeft" if turn < 0 else "RotateRight"
    if look:
        return "LookUp" if look < 0 else "LookDown"
    raise ActionError("Object doesn't seem visible from any rotation/horizon.")


def _is_framed(engine: Engine, agent: AgentBody, record: dict[str, Any]) -> bool:
    """Return whether a corner or the centre of an object's box is in the image, occluded or not."""
    box, intrinsics = record["axisAlignedBoundingBox"], engine.scene.simulator.intrinsics
    points_m = np.array([list(box["center"].values()), *box["cornerPoints"]], dtype=np.float64)
    col, row, _ = project(points_m, agent.camera, intrinsics).T
    is_inside = (col > 0) & (col < intrinsics.width_px) & (row > 0) & (row < intrinsics.height_px)
    return bool(is_inside.any())


def _walk_action(engine: Engine, turns: range, step_deg: float, corner_m: Point) -> str:
    """Return the turn to the heading whose step ends nearest to the corner, by rows and columns, or that step."""
    agent, step_m = engine.agent, engine.settings.gridSize
    best, best_turn = math.inf, 0
    for turn in turns:
        yaw_rad = math.radians(agent.yaw_deg + turn * step_deg)
        to_m = (agent.x_m + step_m * math.sin(yaw_rad), agent.z_m + step_m * math.cos(yaw_rad))
        if not engine.scene.simulator.can_move(agent.point_m, to_m):
            continue
        x_m, z_m = motion.snapped(engine, to_m)
        left_m = abs(corner_m[0] - x_m) + abs(corner_m[1] - z_m)
        if left_m + 1e-6 < best:
            best, best_turn = left_m, turn
    if best == math.inf:
        raise ActionError("Can't seem to move in any direction. Error messages: ")
    if best_turn:
        return "RotateLeft" if best_turn < 0 else "RotateRight"
    return "MoveAhead"


def _start(engine: Engine, position: Vector3 | None) -> Point:
    return engine.agent.point_m if position is None else (position.x, position.z)


def _object(engine: Engine, object_type: str | None, object_id: str | None) -> dict[str, Any]:
    """Return the record of the object with an id, or of the only one of a type."""
    if object_type and not object_id:
        ids = object_type_to_object_ids(engine, objectType=object_type)
        if not ids:
            raise ActionError(f"ArgumentException: Object type {object_type} was not found in the scene.")
        if len(ids) > 1:
            message = f"Multiple objects of type {object_type} were found in the scene, cannot disambiguate."
            raise ActionError(f"ArgumentException: {message}")
        object_id = ids[0]
    record = objects.table_of(engine.scene).by_id.get(object_id or "")
    if record is None:
        raise ActionError(f"ArgumentException: Cannot find sim object with id {object_id or ''}")
    return record


def _path_to_object(engine: Engine, record: dict[str, Any], start_m: Point, allowed_error_m: float) -> list[Point]:
    """Return the path to the first position of the grid, breadth first, from which the object can be seen."""
    settings, object_id = engine.settings, record["objectId"]
    box, reach_m = record["axisAlignedBoundingBox"], settings.visibilityDistance
    centre_m, size_m = (tuple(box[key].values()) for key in ("center", "size"))
    for point_m in _walk(engine, start_m, settings.gridSize):
        if ground_gap_m(point_m, centre_m, size_m) <= reach_m and object_id in objects.visible_ids(
            engine.scene, _looking_at(engine.agent, point_m, record["position"]), reach_m
        ):
            return _path(engine, start_m, point_m, allowed_error_m)
    camera = engine.scene.simulator.config
    raise motion.invalid_operation(
        f"Target object {object_id} is not visible on navigation path given current agent parameters:"
        f" maxVisibleDistance ({reach_m:g}), gridSize ({settings.gridSize:g}),"
        f" fieldOfView ({camera.vertical_fov_deg:g}), camera width ({camera.width_px}),"
        f" camera height ({camera.height_px})"
    )


def _looking_at(agent: AgentBody, point_m: Point, target: dict[str, float]) -> AgentBody:
    """Return the agent at a point with its camera on a target."""
    right_m, ahead_m = target["x"] - point_m[0], target["z"] - point_m[1]
    down_m = agent.camera_height_m - target["y"]
    return replace(
        agent,
        x_m=point_m[0],
        z_m=point_m[1],
        yaw_deg=math.degrees(math.atan2(right_m, ahead_m)),
        horizon_deg=math.degrees(math.atan2(down_m, math.hypot(right_m, ahead_m))),
    )


def _path(engine: Engine, start_m: Point, target_m: Point, allowed_error_m: float) -> list[Point]:
    """Return the corners of the shortest path, its ends moved to the free space."""
    ends_m = [
        _sampled(engine, point_m, allowed_error_m, name) for point_m, name in ((start_m, "start"), (target_m, "target"))
    ]
    offsets_m = [math.dist(requested_m, end_m) for requested_m, end_m in zip((start_m, target_m), ends_m, strict=True)]
    if min(offsets_m) > allowed_error_m:
        requested, found = ([_vector(point_m, 3) for point_m in points_m] for points_m in ((start_m, target_m), ends_m))
        raise motion.invalid_operation(
            "Closest point on NavMesh was too far from the agent: "
            f" (startPosition={requested[0]}, closest navmesh position {found[0]}) and"
            f" (targetPosition={requested[1]}, closest navmesh position {found[1]})."
        )
    corners_m = _corners(engine, ends_m[0], ends_m[1])
    if not corners_m:
        raise motion.invalid_operation(
            f"Could not find path between {_vector(ends_m[0], 3)} and {_vector(ends_m[1], 3)} using the NavMesh."
        )
    return corners_m


def _sampled(engine: Engine, point_m: Point, allowed_error_m: float, name: str) -> Point:
    """Return the free point nearest to an end of a path."""
    found = _corners(engine, point_m, point_m)
    if not found or math.dist(found[0], point_m) > max(_SAMPLE_M, allowed_error_m):
        raise motion.invalid_operation(f"No point on NavMesh near {name}Position {_vector(point_m, 2)}.")
    return found[0]


def _corners(engine: Engine, start_m: Point, target_m: Point) -> list[Point]:
    (start_x, start_z), (target_x, target_z) = start_m, target_m
    path_m = engine.scene.simulator.shortest_path((start_x, 0.0, start_z), (target_x, 0.0, target_z))
    return [(x_m, z_m) for x_m, _, z_m in path_m.tolist()]


def _vector(point_m: Point, digits: int) -> str:
    return motion.vector_text((point_m[0], _NAVMESH_Y_M, point_m[1]), digits)


def _path_record(corners_m: list[Point]) -> dict[str, Any]:
    """Return a path as AI2-THOR's formatter writes a NavMeshPath."""
    return {"corners": [vector((x_m, _NAVMESH_Y_M, z_m)) for x_m, z_m in corners_m], "status": "PathComplete"}
