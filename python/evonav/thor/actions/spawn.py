"""Add assets, put objects at random places, read surfaces, and let objects fall."""

import copy
import json
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, NonNegativeInt

from evonav import _core
from evonav.thor import edits
from evonav.thor.actions.registry import ActionError, ErrorCode, Vector3, action
from evonav.thor.asset_metadata import metadata_of_asset
from evonav.thor.engine import Engine
from evonav.thor.geometry import vector
from evonav.thor.objects import placed_objects
from evonav.thor.scene import Document

# Half the side of the floor that replaces the void of AI2-THOR's empty scene.
_STAGE_HALF_M = 5.0
_ORIGIN = Vector3()
_LONGEST_STEP_S = 0.05

# AI2-THOR's names of an asset's flags.
_PRIMARY = (("pickupable", "CanPickup"), ("moveable", "Moveable"))
_SECONDARY = (
    ("receptacle", "Receptacle"),
    ("openable", "CanOpen"),
    ("toggleable", "CanToggleOnOff"),
    ("breakable", "CanBreak"),
    ("canFillWithLiquid", "CanBeFilled"),
    ("dirtyable", "CanBeDirty"),
    ("canBeUsedUp", "CanBeUsedUp"),
    ("cookable", "CanBeCooked"),
    ("isHeatSource", "isHeatSource"),
    ("isColdSource", "isColdSource"),
    ("sliceable", "CanBeSliced"),
)


@action("GetAssetDatabase")
def get_asset_database(engine: Engine) -> dict[str, dict[str, Any]]:
    """Return the metadata of all assets by id, with the keys of the `procthor` package's asset database."""
    return _database()


@cache
def _database() -> dict[str, dict[str, Any]]:
    entries = {}
    for asset_id, category, size_m in _core.assets():
        flags = metadata_of_asset(asset_id, category).flags
        entries[asset_id] = {
            "assetId": asset_id,
            "objectType": category,
            "primaryProperty": next((name for flag, name in _PRIMARY if flag in flags), "Static"),
            "secondaryProperties": [name for flag, name in _SECONDARY if flag in flags],
            "boundingBox": vector(size_m),
        }
    return entries


@action("SpawnAsset")
def spawn_asset(
    engine: Engine,
    *,
    assetId: str,
    generatedId: str,
    position: Vector3 = _ORIGIN,
    rotation: Vector3 = _ORIGIN,
) -> dict[str, str]:
    """Add an asset to the scene without a test for collisions; `position` is the centre of its box."""
    if assetId not in _database():
        raise ActionError(
            f"Object '{assetId}' is not contained in asset database, you may need to rebuild asset database."
        )
    engine.scene.house = engine.scene.house or _stage()
    entry = {
        "id": generatedId,
        "assetId": assetId,
        "position": position.model_dump(),
        "rotation": {axis: angle % 360.0 for axis, angle in rotation},
        "kinematic": False,
    }
    with edits.editing(engine.scene) as house:
        house["objects"].append(entry)
    return {"objectId": generatedId}


class ObjectTypeCount(BaseModel):
    """Requested number of objects of a type."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    objectType: str
    count: NonNegativeInt


@action("InitialRandomSpawn")
def initial_random_spawn(
    engine: Engine,
    *,
    randomSeed: int = 0,
    forceVisible: bool = False,
    placeStationary: bool = True,
    numDuplicatesOfType: list[ObjectTypeCount] | None = None,
    excludedReceptacles: list[str] | None = None,
    excludedObjectIds: list[str] | None = None,
    objectIds: list[str] | None = None,
    receptacleObjectIds: list[str] | None = None,
    numPlacementAttempts: int = 5,
    allowFloor: bool = False,
    allowMoveable: bool = False,
) -> None:
    """Put objects at random places on receptacles; the same seed gives the same places.

    `placeStationary` has no effect: a placed object neither rolls nor falls over. If objects are named, each of them
    must find a place.
    """
    if numPlacementAttempts <= 0:
        raise ActionError("numPlacementAttempts must be a positive integer.")
    if objectIds and excludedObjectIds:
        raise ActionError("objectIds and excludedObjectIds exclude each other", ErrorCode.INVALID_ARGUMENT)
    scene = engine.scene
    known = {entry["id"] for entry, _ in placed_objects(scene.house or {})}
    for object_id in excludedObjectIds or []:
        if object_id not in known:
            raise ActionError(f"Cannot find sim object with id '{object_id}'")
    copies = [] if numDuplicatesOfType is None else _duplicate(scene.begin_edit(), numDuplicatesOfType)
    request = {
        "seed": randomSeed % 2**64,
        "object_ids": objectIds,
        "excluded_object_ids": excludedObjectIds or [],
        "receptacle_ids": receptacleObjectIds,
        "excluded_receptacles": excludedReceptacles or [],
        "forces_visible": forceVisible,
        "allows_floor": allowFloor,
        "allows_moveable": allowMoveable,
        "num_attempts": numPlacementAttempts,
    }
    dropped = set(copies)
    try:
        delta_json, unplaced = scene.simulator.core.random_spawn(json.dumps(request))
        scene.apply(delta_json)
        dropped.intersection_update(unplaced)
    finally:
        if dropped:
            house = scene.begin_edit()
            house["objects"] = [entry for entry in house["objects"] if entry["id"] not in dropped]
    if objectIds and unplaced:
        raise ActionError(f"no place was found for {', '.join(sorted(unplaced))}")


def _duplicate(house: Document, counts: list[ObjectTypeCount]) -> list[str]:
    """Copy objects until there are as many of each type as requested; return the ids of the copies, not placed yet."""
    by_type: dict[str, list[Document]] = {}
    for entry, _ in placed_objects(house):
        by_type.setdefault(metadata_of_asset(entry.get("assetId", ""), "").object_type, []).append(entry)
    copies = [copied for wanted in counts for copied in _copies(by_type.get(wanted.objectType, []), wanted.count)]
    house["objects"].extend(copies)
    return [copied["id"] for copied in copies]


def _copies(originals: list[Document], count: int) -> Iterator[Document]:
    for index in range(count - len(originals) if originals else 0):
        original = originals[index % len(originals)]
        # The copy is named as AI2-THOR names it.
        changes = {"id": f"{original['id']}_copy_{index}", "children": []}
        yield copy.deepcopy({key: value for key, value in original.items() if key != "children"}) | changes


@action("GetInSceneAssetGeometry")
def get_in_scene_asset_geometry(
    engine: Engine, *, objectId: str, triangles: bool = False, uv: bool = False, normals: bool = False
) -> list[dict[str, Any]]:
    """Return the surface of an object in place: one mesh, clockwise seen from outside as in Unity."""
    simulator = engine.scene.simulator
    body = next((index for index, known in enumerate(simulator.objects) if known.id == objectId), None)
    if body is None:
        raise ActionError(f"{objectId} is no object of the scene")
    if uv:
        raise ActionError("surfaces have no texture coordinates", ErrorCode.INVALID_ARGUMENT)
    corners_m, bodies, _ = simulator.triangles()
    faces_m = corners_m[bodies == body]
    mesh: dict[str, Any] = {"name": objectId}
    if normals:
        # Each corner belongs to one face, so its normal is that face's.
        across = np.cross(faces_m[:, 1] - faces_m[:, 0], faces_m[:, 2] - faces_m[:, 0])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        vertices_m, faces = faces_m.reshape(-1, 3), np.arange(3 * len(faces_m))
        mesh["normals"] = [vector(normal) for normal in np.repeat(across, 3, axis=0).tolist()]
    else:
        vertices_m, faces = np.unique(faces_m.reshape(-1, 3), axis=0, return_inverse=True)
    mesh["vertices"] = [vector(point) for point in vertices_m.tolist()]
    if triangles:
        mesh["triangles"] = faces.ravel().tolist()
    return [mesh]


@action("SetRandomSeed")
def set_random_seed(engine: Engine, *, seed: int) -> None:
    """Seed the noise of the LoCoBot's motion and random looks; other random actions have seeds of their own."""
    engine.agent.noise = np.random.default_rng(abs(seed))
    engine.random_seed, engine.num_randomizations = seed, 0


@action("SetObjectFilter")
def set_object_filter(engine: Engine, *, objectIds: list[str]) -> None:
    """List only these objects in the metadata from now on."""
    engine.object_filter = frozenset(objectIds)


@action("ResetObjectFilter")
def reset_object_filter(engine: Engine) -> None:
    """List all objects in the metadata again."""
    engine.object_filter = None


@action("AdvancePhysicsStep")
def advance_physics_step(
    engine: Engine, *, timeStep: float = 0.02, simSeconds: float | None = None, allowAutoSimulation: bool = False
) -> None:
    """Let objects without support fall to their resting places, all within this action."""
    if timeStep <= 0 or timeStep > _LONGEST_STEP_S:
        raise ActionError(
            "Please use a timeStep between 0.0f and 0.05f. Larger timeSteps produce inconsistent simulation results."
        )
    if simSeconds is not None and simSeconds < 0:
        raise ActionError(f"simSeconds must be non-negative (simSeconds=={simSeconds:g}).")
    delta_json = engine.scene.simulator.core.settled()
    if json.loads(delta_json)["moves"]:
        engine.scene.apply(delta_json)


@action("PausePhysicsAutoSim", "UnpausePhysicsAutoSim")
def pause_physics(engine: Engine) -> None:
    """Do nothing: nothing moves between two actions."""


def _stage() -> Document:
    """Return a house that is one floor."""
    corner = _STAGE_HALF_M
    outline = [(-corner, -corner), (-corner, corner), (corner, corner), (corner, -corner)]
    floor = [vector((x, 0.0, z)) for x, z in outline]
    room = {"id": "room|stage", "roomType": "Stage", "floorPolygon": floor, "floorMaterial": {"name": ""}}
    return {"metadata": {}, "rooms": [room], "walls": [], "doors": [], "windows": [], "objects": []}
