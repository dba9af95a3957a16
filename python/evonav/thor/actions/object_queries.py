"""Answer what is in the image, along a ray, or in a receptacle."""

import math

import numpy as np

from evonav.thor import objects
from evonav.thor.actions.motion import invalid_operation
from evonav.thor.actions.registry import ActionError, Vector3, action
from evonav.thor.actions.teleport import out_of_range
from evonav.thor.engine import Engine
from evonav.thor.geometry import Vec3, vector
from evonav.thor.surfaces import Hit, surfaces_of


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
        raise invalid_operation(f"target hit ({object_id}) at ({x:g}, {y:g}) is not currently Visible to Agent")
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
