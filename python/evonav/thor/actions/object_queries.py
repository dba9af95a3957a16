"""Answer what is in the image, along a ray or in a receptacle, and from where an object can be used."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from evonav.thor import objects
from evonav.thor.actions import paths
from evonav.thor.actions.motion import invalid_operation, out_of_range
from evonav.thor.actions.registry import ActionError, Vector3, action
from evonav.thor.agent import AgentBody
from evonav.thor.engine import Engine
from evonav.thor.geometry import Vec3, ground_gap_m, vector
from evonav.thor.surfaces import Hit, surfaces_of

_HORIZONS_DEG = (-30.0, 0.0, 30.0, 60.0)
# Number of points along each side of the grid that samples a receptacle's surface.
_POINTS_A_SIDE = 20
_NO_LIMIT = 2**31 - 1
_MAX_TESTS = 100_000


def object_at(engine: Engine, x: float, y: float) -> tuple[str, Hit]:
    """Return the object at a point of the image.

    Args:
        engine: The engine whose agent looks.
        x: Distance from the left edge, in widths of the image.
        y: Distance from the top edge, in heights of the image.

    Returns:
        The object's id, and where the ray meets it.

    Raises:
        ActionError: The point is outside the image, or shows nothing that AI2-THOR lists.
    """
    if not (0 <= x <= 1 and 0 <= y <= 1):
        raise out_of_range("x/y must be in [0:1]")
    hit = surfaces_of(engine.scene).cast(*_ray(engine, x, y))
    found = objects.object_of_body(engine.scene, hit.body) if hit else None
    if hit is None or found is None:
        raise invalid_operation(f"no sim objects found at ({x:g},{y:g})")
    return found, hit


def target(
    engine: Engine,
    object_id: str | None,
    x: float | None = None,
    y: float | None = None,
    *,
    is_far_allowed: bool = False,
) -> objects.Record:
    """Return the record of an action's object, named by its id or by its place in the image.

    Raises:
        ActionError: The object does not exist, or is not visible unless `is_far_allowed`.
    """
    if object_id is None:
        if x is None or y is None:
            raise ActionError("objectId, or x and y, must be given")
        object_id, _ = object_at(engine, x, y)
    record = objects.record_of(engine.scene, object_id)
    if not is_far_allowed and object_id not in _visible(engine):
        raise ActionError("NullReferenceException: Target object not found within the specified visibility.")
    return record


@action("GetObjectInFrame")
def get_object_in_frame(engine: Engine, *, x: float, y: float, checkVisible: bool = False) -> str:
    """Return the id of the object at a point of the image: 0 to 1 from its upper left corner."""
    object_id, _ = object_at(engine, x, y)
    if checkVisible and object_id not in _visible(engine):
        raise invalid_operation(f"target hit ({object_id}) at ({x:g}, {y:g}) is not currently Visible to AgentBody")
    return object_id


@action("GetCoordinateFromRaycast")
def get_coordinate_from_raycast(engine: Engine, *, x: float, y: float) -> dict[str, float]:
    """Return where the ray through a point of the image ends; the origin if it meets nothing."""
    if not (0 <= x <= 1 and 0 <= y <= 1):
        raise out_of_range(f"x and y must be in [0:1] not (x={x:g}, y={y:g}).")
    hit = surfaces_of(engine.scene).cast(*_ray(engine, x, y))
    return vector(hit.point_m if hit else (0.0, 0.0, 0.0))


@action("GetObjectHitFromRaycast")
def get_object_hit_from_raycast(engine: Engine, *, origin: Vector3, destination: Vector3) -> str:
    """Return the id of the first object on the ray from one point through another."""
    return _object_hit(engine, origin, destination)[0]


@action("PerformRaycast")
def perform_raycast(engine: Engine, *, origin: Vector3, destination: Vector3) -> dict[str, object]:
    """Return the first object on the ray from one point through another, and where the ray meets it."""
    object_id, hit = _object_hit(engine, origin, destination)
    return {"objectId": object_id, "hitPoint": vector(hit.point_m), "hitDistance": hit.distance_m}


@action("GetVisibleObjects")
def get_visible_objects(
    engine: Engine, *, maxDistance: float | None = None, visibilityScheme: str | None = None
) -> list[str]:
    """Return the ids of visible objects, nearest to the camera first; both of AI2-THOR's schemes are the same here."""
    if visibilityScheme is not None and visibilityScheme.lower() not in ("collider", "distance"):
        raise ActionError(
            f"NotImplementedException: Visibility scheme {visibilityScheme} is not implemented. "
            "Must be 'distance' or 'collider'."
        )
    seen = _visible(engine, maxDistance)
    eye_m = engine.agent.camera.position_m
    near = [
        (math.dist(eye_m, record["position"].values()), record["objectId"])
        for record in objects.static_records(engine.scene)
        if record["objectId"] in seen
    ]
    return [object_id for _, object_id in sorted(near)]


@action("GetObjectMetadata")
def get_object_metadata(engine: Engine, *, objectIds: list[str]) -> list[objects.Record]:
    """Return the records of some objects; unknown ids are left out."""
    by_id = {
        record["objectId"]: {**record, "distance": distance_m, "visible": is_visible, "isInteractable": is_visible}
        for record, distance_m, is_visible in objects.views(engine)
    }
    return [by_id[object_id] for object_id in objectIds if object_id in by_id]


@action("Contains")
def contains(engine: Engine, *, objectId: str) -> list[str]:
    """Return the ids of the objects in or on a receptacle."""
    return list(objects.record_of(engine.scene, objectId)["receptacleObjectIds"] or ())


@action("WorldToViewportPoint")
def world_to_viewport_point(engine: Engine, *, position: Vector3) -> dict[str, float]:
    """Return a world point's place in the image, from its upper left corner, with its depth as z."""
    half_width, half_height = _half_extents(engine)
    offset_m = np.subtract((position.x, position.y, position.z), engine.agent.camera.position_m)
    right_m, up_m, ahead_m = (offset_m @ objects.camera_axes(engine.agent)).tolist()
    if ahead_m == 0:
        raise invalid_operation("Point not in viewport.")
    x, y = 0.5 + 0.5 * right_m / (ahead_m * half_width), 0.5 - 0.5 * up_m / (ahead_m * half_height)
    if not (0 <= x <= 1 and 0 <= y <= 1):
        raise invalid_operation("Point not in viewport.")
    return vector((x, y, ahead_m))


def _visible(engine: Engine, distance_m: float | None = None) -> set[str]:
    reach_m = engine.settings.visibilityDistance if distance_m is None else distance_m
    return objects.visible_ids(engine.scene, engine.agent, reach_m)


def _object_hit(engine: Engine, origin: Vector3, destination: Vector3) -> tuple[str, Hit]:
    start, end = (origin.x, origin.y, origin.z), (destination.x, destination.y, destination.z)
    way = f"Raycast from ({start[0]:g}, {start[1]:g}, {start[2]:g}) to ({end[0]:g}, {end[1]:g}, {end[2]:g})"
    direction = (end[0] - start[0], end[1] - start[1], end[2] - start[2])
    hit = surfaces_of(engine.scene).cast(start, direction) if any(direction) else None
    if hit is None:
        raise ActionError(f"{way} failed to hit any target object!")
    object_id = objects.object_of_body(engine.scene, hit.body)
    if object_id is None:
        raise ActionError(f"{way} hit object, but not a SimObject!")
    return object_id, hit


def _ray(engine: Engine, x: float, y: float) -> tuple[Vec3, Vec3]:
    half_width, half_height = _half_extents(engine)
    own = np.array([(2 * x - 1) * half_width, (1 - 2 * y) * half_height, 1.0])
    right, up, ahead = (objects.camera_axes(engine.agent) @ own).tolist()
    return engine.agent.camera.position_m, (right, up, ahead)


def _half_extents(engine: Engine) -> tuple[float, float]:
    """Return half the width and height of the image plane at distance 1."""
    intrinsics = engine.scene.simulator.intrinsics
    half_height = math.tan(0.5 * intrinsics.vertical_fov_rad)
    return half_height * intrinsics.width_px / intrinsics.height_px, half_height


@action("GetInteractablePoses")
def get_interactable_poses(
    engine: Engine,
    *,
    objectId: str,
    positions: list[Vector3] | None = None,
    rotations: list[float] | None = None,
    horizons: list[float] | None = None,
    standings: list[bool] | None = None,
    maxDistance: float | None = None,
    maxPoses: int = _NO_LIMIT,
) -> list[dict[str, float | bool]]:
    """Return poses, as `TeleportFull` takes them, from which an object is visible.

    Visibility is that of the metadata: any part of the object within the distance, not one of AI2-THOR's visibility
    points.
    """
    agent, settings, step_deg = engine.agent, engine.settings, engine.settings.rotateStepDegrees
    if rotations is not None and 360 % step_deg != 0:
        raise invalid_operation(
            f"360 % rotateStepDegrees (360 % {step_deg:g} != 0) must be 0, unless 'rotations: float[]' is overwritten."
        )
    if maxPoses <= 0:
        raise out_of_range("maxPoses must be > 0.")
    if maxDistance is not None and maxDistance <= 0:
        raise out_of_range("maxDistance must be >= 0 meters from the object.")
    record = objects.record_of(engine.scene, objectId)
    reach_m = settings.visibilityDistance if maxDistance is None else maxDistance
    up_deg, down_deg = agent.body.max_upward_deg, agent.body.max_downward_deg
    if horizons is not None and not all(-up_deg <= horizon <= down_deg for horizon in horizons):
        raise ActionError(f"ArgumentException: Each horizon must be in [{-up_deg:g}:{down_deg:g}]")
    if positions is None:
        positions = [Vector3(**position) for position in paths.get_reachable_positions(engine)]
    offset_deg = round(agent.yaw_deg % step_deg)
    yaws_deg = [offset_deg + i * step_deg for i in range(round(360 / step_deg))] if rotations is None else rotations
    chosen = (_HORIZONS_DEG if horizons is None else horizons, [False, True] if standings is None else standings)
    if not (positions and yaws_deg and chosen[0] and chosen[1]):
        raise invalid_operation("Every degree of freedom must have at least 1 valid value.")
    near = _near(record, positions, reach_m)
    num_tests = len(near) * len(yaws_deg) * len(chosen[0]) * len(chosen[1])
    if num_tests > _MAX_TESTS:
        raise invalid_operation(
            f"Too many poses to look from: gridSize {settings.gridSize:g} m gives {len(positions)} positions,"
            f" and {num_tests} poses near {objectId}, more than {_MAX_TESTS}."
        )
    poses: list[dict[str, float | bool]] = []
    for horizon_deg, is_standing, yaw_deg, at in product(*chosen, yaws_deg, near):
        there = replace(agent, horizon_deg=horizon_deg, is_standing=is_standing, yaw_deg=yaw_deg % 360.0)
        there.x_m, there.y_m, there.z_m = at.x, at.y, at.z
        if _may_frame(engine, there, record) and objectId in objects.visible_ids(engine.scene, there, reach_m):
            poses.append(at.model_dump() | {"rotation": yaw_deg, "standing": is_standing, "horizon": horizon_deg})
            if len(poses) >= maxPoses:
                break
    return poses


@action("PositionsFromWhichItemIsInteractable")
def positions_from_which_item_is_interactable(
    engine: Engine, *, objectId: str, horizon: float = 30.0, positions: list[Vector3] | None = None
) -> dict[str, list[float]]:
    """Return `GetInteractablePoses` in AI2-THOR's older form: one list for each coordinate, horizons in steps."""
    if horizon <= 0:
        raise out_of_range("horizon must be > 0.")
    up_deg, down_deg = engine.agent.body.max_upward_deg, engine.agent.body.max_downward_deg
    horizons = np.arange(-up_deg, down_deg + 1e-6, horizon).tolist()
    poses = get_interactable_poses(engine, objectId=objectId, positions=positions, horizons=horizons)
    return {key: [float(pose[key]) for pose in poses] for key in ("x", "y", "z", "rotation", "standing", "horizon")}


@action("GetSpawnCoordinatesAboveReceptacle")
def get_spawn_coordinates_above_receptacle(
    engine: Engine, *, objectId: str, anywhere: bool = False
) -> list[dict[str, float]]:
    """Return free points over the upper side of a receptacle, for `PlaceObjectAtPoint`.

    They are at the height of the receptacle's box; AI2-THOR uses its trigger box, which evonav does not know.
    """
    scene = engine.scene
    record = target(engine, objectId, is_far_allowed=anywhere)
    box, body = record["axisAlignedBoundingBox"], objects.table_of(scene).instances.get(objectId, 0) - 1
    spans = [
        box["center"][axis] + box["size"][axis] * ((np.arange(_POINTS_A_SIDE) + 0.5) / _POINTS_A_SIDE - 0.5)
        for axis in "xz"
    ]
    top_m = box["center"]["y"] + 0.5 * box["size"]["y"]
    surfaces, points = surfaces_of(scene), []
    for x_m in spans[0].tolist():
        for z_m in spans[1].tolist():
            hit = surfaces.cast((x_m, top_m + 1.0, z_m), (0.0, -1.0, 0.0))
            if hit is not None and hit.body == body and (anywhere or _is_reached(engine, (x_m, top_m, z_m), body)):
                points.append(vector((x_m, top_m, z_m)))
    return points


def _near(record: objects.Record, positions: Sequence[Vector3], reach_m: float) -> list[Vector3]:
    """Return the positions from which the object's box is within reach on the ground plane."""
    box = record["axisAlignedBoundingBox"]
    centre_m, size_m = (tuple(box[key].values()) for key in ("center", "size"))
    return [at for at in positions if ground_gap_m((at.x, at.z), centre_m, size_m) <= reach_m + 1e-6]


def _may_frame(engine: Engine, agent: AgentBody, record: objects.Record) -> bool:
    """Return whether the sphere around the object's box touches the cone around the image."""
    box, intrinsics = record["axisAlignedBoundingBox"], engine.scene.simulator.intrinsics
    radius_m = 0.5 * math.hypot(*box["size"].values()) + 1e-6
    to_box_m = [at - eye for at, eye in zip(box["center"].values(), agent.camera.position_m, strict=True)]
    distance_m = math.hypot(*to_box_m)
    if distance_m <= radius_m:
        return True
    half = math.tan(0.5 * intrinsics.vertical_fov_rad)
    cone_rad = math.atan(half * math.hypot(1.0, intrinsics.width_px / intrinsics.height_px))
    yaw_rad, down_rad = math.radians(agent.yaw_deg), math.radians(agent.horizon_deg)
    level = math.cos(down_rad)
    ahead = (math.sin(yaw_rad) * level, -math.sin(down_rad), math.cos(yaw_rad) * level)
    cosine = sum(a * b for a, b in zip(ahead, to_box_m, strict=True)) / distance_m
    return math.acos(max(-1.0, min(1.0, cosine))) <= cone_rad + math.asin(radius_m / distance_m)


def _is_reached(engine: Engine, point_m: Vec3, body: int) -> bool:
    """Return whether a point is in the image, within the visibility distance, and not occluded."""
    eye_m, intrinsics = engine.agent.camera.position_m, engine.scene.simulator.intrinsics
    right_m, up_m, ahead_m = (np.subtract(point_m, eye_m) @ objects.camera_axes(engine.agent)).tolist()
    half = math.tan(0.5 * intrinsics.vertical_fov_rad) * ahead_m
    is_framed = ahead_m > 0 and abs(up_m) < half and abs(right_m) < half * intrinsics.width_px / intrinsics.height_px
    is_near = math.hypot(point_m[0] - eye_m[0], point_m[2] - eye_m[2]) <= engine.settings.visibilityDistance
    return is_framed and is_near and engine.scene.simulator.is_visible(eye_m, point_m, (body + 1,))
