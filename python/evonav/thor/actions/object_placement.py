"""Actions that move, remove and restore objects.

There is no physics: what is put somewhere stays, what loses its support falls straight down onto what is under its
outline, and furniture takes along what stands on it.
"""

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from evonav.thor import edits, objects
from evonav.thor.actions.registry import ActionError, Vector3, action, brief
from evonav.thor.actions.teleport import out_of_range
from evonav.thor.engine import Engine
from evonav.thor.scene import Scene
from evonav.thor.surfaces import fresh_surfaces

# AI2-THOR places things this much over a surface, and lets them fall.
_CLEARANCE_M = 0.005
# What only touches is not in the way.
_TOUCH_M = 0.001


class ObjectPose(BaseModel):
    """Where an object shall be: its pivot, as records give it."""

    objectName: str = ""
    position: Vector3 = Field(default_factory=Vector3)
    rotation: Vector3 = Field(default_factory=Vector3)


@action("SetObjectPoses")
def set_object_poses(
    engine: Engine,
    *,
    objectPoses: list[ObjectPose],
    placeStationary: bool = True,
    **unused: Any,  # noqa: ANN401
) -> None:
    """Sets the poses of all that can be moved; what can be moved and is not named goes.

    An object that is named again is copied. With `placeStationary=False` things fall to what is under them.
    """
    if not objectPoses:
        raise ActionError("objectPoses must have at least one pose")
    scene, mistake = engine.scene, ""
    edits.settle(scene)
    movable = {
        record["name"]: record["objectId"]
        for record in objects.static_records(scene)
        if record["pickupable"] or record["moveable"]
    }
    types = {record["objectId"]: record["objectType"] for record in objects.static_records(scene)}
    with edits.edited(scene) as house:
        holders = edits.holders_of(house)
        loose = {object_id: edits.detach(holders, object_id) for object_id in _outermost_last(house, movable.values())}
        placed: list[str] = []
        for index, pose in enumerate(objectPoses):
            object_id = movable.get(pose.objectName)
            if object_id is None:
                mistake = f"No Pickupable or Moveable object of name {pose.objectName} found in scene."
                continue
            entry = loose[object_id]
            # What cannot be moved stays behind when what it stands on goes.
            house["objects"] += entry.pop("children", None) or []
            if object_id in placed:
                entry = copy.deepcopy(entry)
                entry["name"], entry["id"] = f"{pose.objectName}_copy_{index}", f"{object_id}_copy_{index}"
            _put_pivot(entry, types[object_id], pose.position, pose.rotation)
            house["objects"].append(entry)
            scene.disabled.pop(entry["id"], None)
            placed.append(entry["id"])
        for object_id, entry in loose.items():
            if object_id not in placed:
                house["objects"] += entry.pop("children", None) or []
                scene.disabled[object_id] = entry
    if not placeStationary:
        edits.drop(scene, placed)
    edits.relate(scene, placed)
    if mistake:
        raise ActionError(mistake)


@action("PlaceObjectAtPoint")
def place_object_at_point(
    engine: Engine,
    *,
    objectId: str,
    position: Vector3 | None = None,
    positions: list[Vector3] | None = None,
    rotation: Vector3 | None = None,
    forceKinematic: bool = False,
) -> None:
    """Puts an object on the surface under a point, if there is room; of several points at the first where there is."""
    scene = engine.scene
    if not _is_listed(scene, objectId):
        raise ActionError(f"Cannot find object with id {brief(objectId)}.")
    points = [position] if position is not None else positions or []
    if not points:
        raise ActionError("PlaceObjectAtPoint needs a position")
    for point in points[:-1]:
        try:
            return _place_at(scene, objectId, point, rotation, forceKinematic)
        except ActionError:
            continue
    return _place_at(scene, objectId, points[-1], rotation, forceKinematic)


@action("TeleportObject")
def teleport_object(
    engine: Engine,
    *,
    objectId: str,
    position: Vector3,
    rotation: Vector3 | None = None,
    forceAction: bool = False,
    forceKinematic: bool = False,
    **unused: Any,  # noqa: ANN401
) -> None:
    """Sets an object's pose; from there it falls, unless `forceKinematic`. It may not touch another, unless forced."""
    scene = engine.scene
    record = objects.record_of(scene, objectId)
    edits.settle(scene)
    entry = edits.entry_of(scene, objectId)
    turn = rotation or Vector3(**record["rotation"])
    with edits.edited(scene):
        _put_pivot(entry, record["objectType"], position, turn)
        if not forceAction:
            axes = objects.rotation_of(entry["rotation"])
            struck = (
                fresh_surfaces(scene)
                .without(_bodies_of(scene, entry))
                .bodies_in_box(edits.centre_of(entry), 0.5 * objects.own_size_m(scene, entry) - _TOUCH_M, axes)
            )
            if struck:
                raise ActionError(f"{scene.simulator.objects[struck[0]].id} is in the way.")
    if not forceKinematic:
        edits.drop(scene, [part["id"] for part, _ in objects.placed_objects({"objects": [entry]})])
    edits.relate(scene, [objectId])


@action("DisableObject")
def disable_object(engine: Engine, *, objectId: str) -> None:
    """Takes an object out of the scene until `EnableObject`; what stood on it falls."""
    if not _is_listed(engine.scene, objectId):
        raise ActionError("")  # AI2-THOR says no more.
    _remove(engine.scene, [objectId])


@action("RemoveFromScene")
def remove_from_scene(engine: Engine, *, objectId: str | None = None, objectIds: list[str] | None = None) -> None:
    """Takes objects out of the scene; what stood on them falls."""
    chosen = objectIds if objectIds is not None else [objectId] if objectId is not None else []
    if not chosen:
        raise ActionError("objectIds must not be empty!")
    _remove(engine.scene, chosen)


@action("DisableAllObjectsOfType", "DisableObjectsOfType")
def disable_objects_of_type(engine: Engine, *, objectType: str = "", objectId: str = "") -> None:
    """Takes all objects of a type out of the scene."""
    chosen = objectType or objectId
    _remove(engine.scene, [r["objectId"] for r in objects.static_records(engine.scene) if r["objectType"] == chosen])


@action("EnableObject")
def enable_object(engine: Engine, *, objectId: str) -> None:
    """Puts a disabled object back where it was; does nothing to one that is there."""
    scene = engine.scene
    if objectId not in scene.disabled:
        if not _is_listed(scene, objectId):
            raise ActionError("")  # AI2-THOR says no more.
        return
    with edits.edited(scene) as house:
        entry = scene.disabled.pop(objectId)
        entry["kinematic"] = True
        house["objects"].append(entry)
    edits.relate(scene, [objectId])


@action("MakeAllObjectsMoveable", "MakeAllObjectsStationary")
def change_physics(engine: Engine) -> None:
    """Nothing to do where everything is at rest."""


def _is_listed(scene: Scene, object_id: str) -> bool:
    return any(record["objectId"] == object_id for record in objects.static_records(scene))


def _put_pivot(entry: dict[str, Any], object_type: str, position: Vector3, rotation: Vector3) -> None:
    turn = {"x": rotation.x, "y": rotation.y, "z": rotation.z}
    offset_m = objects.rotation_of(turn) @ edits.facts(entry, object_type).pivot_m
    edits.put(entry, np.subtract((position.x, position.y, position.z), offset_m).tolist(), turn)


def _outermost_last(house: dict[str, Any], object_ids: Any) -> list[str]:  # noqa: ANN401
    """Children before their parents, so that each can be taken alone."""
    chosen = set(object_ids)
    return [entry["id"] for entry, _ in objects.placed_objects(house) if entry["id"] in chosen][::-1]


def _place_at(scene: Scene, object_id: str, point: Vector3, rotation: Vector3 | None, is_kinematic: bool) -> None:
    edits.settle(scene)
    entry = edits.entry_of(scene, object_id)
    turn = {"x": rotation.x, "y": rotation.y, "z": rotation.z} if rotation else entry["rotation"]
    size_m = objects.own_size_m(scene, entry)
    axes = objects.rotation_of(turn)
    reach_m = 0.5 * np.abs(axes) @ size_m
    low, high = objects.bounds_m(scene)
    if not all(lo <= value <= hi for lo, value, hi in zip(low, (point.x, point.y, point.z), high, strict=True)):
        raise out_of_range(f"Position coordinate ({_text(point)}) is not within scene bounds ({low}, {high})")
    surfaces = fresh_surfaces(scene)
    surfaces = surfaces.without(_bodies_of(scene, entry))
    under_m = surfaces.height_under_m(np.array([[point.x, point.z]]), point.y)
    pivot_m = axes @ edits.facts(entry, objects.record_of(scene, object_id)["objectType"]).pivot_m
    centre_m = np.array([point.x - pivot_m[0], under_m + _CLEARANCE_M + reach_m[1], point.z - pivot_m[2]])
    struck = surfaces.bodies_in_box(centre_m, 0.5 * size_m, axes)
    if struck:
        name = scene.simulator.objects[struck[0]].id
        raise ActionError(f"Spawn area not clear ({name}) is in the way), can't place object at that point")
    if not is_kinematic:
        centre_m[1] = reach_m[1] + edits.rest_height_m(surfaces, centre_m.tolist(), (2.0 * reach_m).tolist())
    with edits.edited(scene):
        edits.put(entry, centre_m.tolist(), turn)
    edits.relate(scene, [object_id])


def _bodies_of(scene: Scene, entry: dict[str, Any]) -> set[int]:
    """Indices of an object's body and of those of all that stands on it."""
    instances = objects.table_of(scene).instances
    return {instances[part["id"]] - 1 for part, _ in objects.placed_objects({"objects": [entry]})}


def _text(vector: Vector3) -> str:
    return f"({vector.x:.1f}, {vector.y:.1f}, {vector.z:.1f})"


def _remove(scene: Scene, object_ids: Sequence[str]) -> None:
    for object_id in object_ids:
        objects.record_of(scene, object_id)
        edits.entry_of(scene, object_id)
    edits.settle(scene)
    fallen: list[str] = []
    with edits.edited(scene) as house:
        for object_id in object_ids:
            entry = edits.detach(edits.holders_of(house), object_id)
            children = entry.pop("children", None) or []
            fallen += [child["id"] for child, _ in objects.placed_objects({"objects": children})]
            house["objects"] += children
            scene.disabled[object_id] = entry
    fallen = [object_id for object_id in fallen if object_id not in scene.disabled]
    if fallen:
        edits.drop(scene, fallen)
        edits.relate(scene, fallen)
