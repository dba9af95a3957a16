"""Move, remove and restore objects.

There is no physics. A placed object stays where it is put. An object that loses its support falls straight down onto
what is below its outline. Furniture carries the objects on it along.
"""

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from evonav.thor import edits, objects
from evonav.thor.actions.motion import out_of_range, vector_text
from evonav.thor.actions.registry import ActionError, Vector3, action, brief
from evonav.thor.engine import Engine
from evonav.thor.geometry import box_around
from evonav.thor.scene import Scene
from evonav.thor.surfaces import fresh_surfaces

# AI2-THOR places objects this high above a surface and lets them fall.
_CLEARANCE_M = 0.005
# Boxes that overlap by less than this do not collide.
_TOUCH_M = 0.001


class ObjectPose(BaseModel):
    """A requested pose of an object: that of its pivot, as in the records."""

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
    """Set the poses of all movable objects; a movable object that is not named is removed.

    An object that is named again is copied. With `placeStationary=False` objects fall onto what is below them.
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
    with edits.editing(scene) as house:
        lists = edits.lists_by_id(house)
        loose = {object_id: edits.detach(lists, object_id) for object_id in _outermost_last(house, movable.values())}
        placed: list[str] = []
        for index, pose in enumerate(objectPoses):
            object_id = movable.get(pose.objectName)
            if object_id is None:
                mistake = f"No Pickupable or Moveable object of name {pose.objectName} found in scene."
                continue
            entry = loose[object_id]
            # An immovable object stays when the object below it moves.
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
    edits.update_receptacles(scene, placed)
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
    """Put an object on the surface below a point, if it is free; of several points, on the first free one."""
    scene = engine.scene
    if objectId not in objects.table_of(scene).by_id:
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
    """Set an object's pose. It then falls unless `forceKinematic`, and may touch others only with `forceAction`."""
    scene = engine.scene
    record = objects.record_of(scene, objectId)
    edits.settle(scene)
    entry = edits.entry_of(scene, objectId)
    turn = rotation or Vector3(**record["rotation"])
    with edits.editing(scene):
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
    edits.update_receptacles(scene, [objectId])


@action("DisableObject")
def disable_object(engine: Engine, *, objectId: str) -> None:
    """Remove an object from the scene until `EnableObject`; objects on it fall."""
    if objectId not in objects.table_of(engine.scene).by_id:
        raise ActionError("")  # AI2-THOR's message is empty.
    _remove(engine.scene, [objectId])


@action("RemoveFromScene")
def remove_from_scene(engine: Engine, *, objectId: str | None = None, objectIds: list[str] | None = None) -> None:
    """Remove objects from the scene; objects on them fall."""
    chosen = objectIds if objectIds is not None else [objectId] if objectId is not None else []
    if not chosen:
        raise ActionError("objectIds must not be empty!")
    _remove(engine.scene, chosen)


@action("DisableAllObjectsOfType", "DisableObjectsOfType")
def disable_objects_of_type(engine: Engine, *, objectType: str = "", objectId: str = "") -> None:
    """Remove all objects of a type from the scene."""
    chosen = objectType or objectId
    _remove(engine.scene, [r["objectId"] for r in objects.static_records(engine.scene) if r["objectType"] == chosen])


@action("EnableObject")
def enable_object(engine: Engine, *, objectId: str) -> None:
    """Put a disabled object back where it was; do nothing if it is not disabled."""
    scene = engine.scene
    if objectId not in scene.disabled:
        if objectId not in objects.table_of(scene).by_id:
            raise ActionError("")  # AI2-THOR's message is empty.
        return
    with edits.editing(scene) as house:
        entry = scene.disabled.pop(objectId)
        entry["kinematic"] = True
        house["objects"].append(entry)
    edits.update_receptacles(scene, [objectId])


@action("MakeAllObjectsMoveable", "MakeAllObjectsStationary")
def change_physics(engine: Engine) -> None:
    """Do nothing: all objects are at rest."""


def _put_pivot(entry: dict[str, Any], object_type: str, position: Vector3, rotation: Vector3) -> None:
    turn = rotation.model_dump()
    offset_m = objects.rotation_of(turn) @ objects.metadata_of_entry(entry, object_type).pivot_m
    edits.set_pose(entry, np.subtract((position.x, position.y, position.z), offset_m).tolist(), turn)


def _outermost_last(house: dict[str, Any], object_ids: Any) -> list[str]:  # noqa: ANN401
    """List children before their parents, so that each can be removed alone."""
    chosen = set(object_ids)
    return [entry["id"] for entry, _ in objects.placed_objects(house) if entry["id"] in chosen][::-1]


def _place_at(scene: Scene, object_id: str, point: Vector3, rotation: Vector3 | None, is_kinematic: bool) -> None:
    edits.settle(scene)
    entry = edits.entry_of(scene, object_id)
    turn = rotation.model_dump() if rotation else entry["rotation"]
    size_m = objects.own_size_m(scene, entry)
    axes = objects.rotation_of(turn)
    reach_m = 0.5 * np.abs(axes) @ size_m
    low, high = (tuple(m.tolist()) for m in box_around(b for b in scene.simulator.objects if b.kind != "object"))
    if not all(lo <= value <= hi for lo, value, hi in zip(low, (point.x, point.y, point.z), high, strict=True)):
        place = vector_text((point.x, point.y, point.z), 1)
        raise out_of_range(f"Position coordinate ({place}) is not within scene bounds ({low}, {high})")
    surfaces = fresh_surfaces(scene)
    surfaces = surfaces.without(_bodies_of(scene, entry))
    under_m = surfaces.height_under_m(np.array([[point.x, point.z]]), point.y)
    pivot_m = axes @ objects.metadata_of_entry(entry, objects.record_of(scene, object_id)["objectType"]).pivot_m
    centre_m = np.array([point.x - pivot_m[0], under_m + _CLEARANCE_M + reach_m[1], point.z - pivot_m[2]])
    struck = surfaces.bodies_in_box(centre_m, 0.5 * size_m, axes)
    if struck:
        name = scene.simulator.objects[struck[0]].id
        raise ActionError(f"Spawn area not clear ({name}) is in the way), can't place object at that point")
    if not is_kinematic:
        centre_m[1] = reach_m[1] + edits.rest_height_m(surfaces, centre_m.tolist(), (2.0 * reach_m).tolist())
    with edits.editing(scene):
        edits.set_pose(entry, centre_m.tolist(), turn)
    edits.update_receptacles(scene, [object_id])


def _bodies_of(scene: Scene, entry: dict[str, Any]) -> set[int]:
    """Return the indices of the bodies of an object and of all objects on it."""
    instances = objects.table_of(scene).instances
    return {instances[part["id"]] - 1 for part, _ in objects.placed_objects({"objects": [entry]})}


def _remove(scene: Scene, object_ids: Sequence[str]) -> None:
    for object_id in object_ids:
        objects.record_of(scene, object_id)
        edits.entry_of(scene, object_id)
    edits.settle(scene)
    fallen: list[str] = []
    with edits.editing(scene) as house:
        for object_id in object_ids:
            entry = edits.detach(edits.lists_by_id(house), object_id)
            children = entry.pop("children", None) or []
            fallen += [child["id"] for child, _ in objects.placed_objects({"objects": children})]
            house["objects"] += children
            scene.disabled[object_id] = entry
    fallen = [object_id for object_id in fallen if object_id not in scene.disabled]
    if fallen:
        edits.drop(scene, fallen)
        edits.update_receptacles(scene, fallen)
