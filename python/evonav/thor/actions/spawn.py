"""Spawn single assets, read their surfaces, and let objects fall."""

import json
from typing import Any

import numpy as np

from evonav.errors import EvonavError
from evonav.thor.actions.asset_database import is_known
from evonav.thor.actions.registry import ActionError, ErrorCode, Vector3, action
from evonav.thor.engine import Engine
from evonav.thor.geometry import vector
from evonav.thor.scene import Document, Scene

# Half the side of the floor that replaces the void of AI2-THOR's empty scene.
_STAGE_HALF_M = 5.0
_ORIGIN = Vector3()
_LONGEST_STEP_S = 0.05


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
    if not is_known(assetId):
        raise ActionError(
            f"Object '{assetId}' is not contained in asset database, you may need to rebuild asset database."
        )
    entries = _house_or_stage(engine.scene)["objects"]
    entries.append(
        {
            "id": generatedId,
            "assetId": assetId,
            "position": position.model_dump(),
            "rotation": {axis: angle % 360.0 for axis, angle in rotation},
            "kinematic": False,
        }
    )
    try:
        _ = engine.scene.simulator
    except EvonavError:
        entries.pop()
        engine.scene.begin_edit()
        raise
    return {"objectId": generatedId}


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
    """Seed the noise of the LoCoBot's motion; other random actions have seeds of their own."""
    engine.agent.noise = np.random.default_rng(abs(seed))


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
    delta_json = engine.scene.simulator.settled()
    if json.loads(delta_json)["moves"]:
        engine.scene.apply(delta_json)


@action("PausePhysicsAutoSim", "UnpausePhysicsAutoSim")
def pause_physics(engine: Engine) -> None:
    """Do nothing: nothing moves between two actions."""


def _house_or_stage(scene: Scene) -> Document:
    if scene.house is None:
        corner = _STAGE_HALF_M
        outline = [(-corner, -corner), (-corner, corner), (corner, corner), (corner, -corner)]
        floor = [vector((x, 0.0, z)) for x, z in outline]
        room = {"id": "room|stage", "roomType": "Stage", "floorPolygon": floor, "floorMaterial": {"name": ""}}
        scene.house = {"metadata": {}, "rooms": [room], "walls": [], "doors": [], "windows": [], "objects": []}
    return scene.begin_edit()
