"""Find poses from which an object can be used, and free points on a receptacle."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from evonav.thor import objects
from evonav.thor.actions import paths
from evonav.thor.actions.motion import invalid_operation
from evonav.thor.actions.object_queries import target
from evonav.thor.actions.registry import ActionError, Vector3, action
from evonav.thor.actions.teleport import out_of_range
from evonav.thor.agent import Agent
from evonav.thor.engine import Engine
from evonav.thor.geometry import Vec3, ground_gap_m, vector
from evonav.thor.surfaces import surfaces_of

Pose = dict[str, float | bool]

_HORIZONS_DEG = (-30.0, 0.0, 30.0, 60.0)
# Number of points along each side of the grid that samples a receptacle's surface.
_POINTS_A_SIDE = 20
_NO_LIMIT = 2**31 - 1
_MAX_TESTS = 100_000


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
) -> list[Pose]:
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
    poses: list[Pose] = []
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


def _may_frame(engine: Engine, agent: Agent, record: objects.Record) -> bool:
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
