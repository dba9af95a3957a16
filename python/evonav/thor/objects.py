"""Make AI2-THOR's object records: the metadata's `objects`.

Fields, the order of corners and the listed objects follow AI2-THOR's source (`ObjectMetadataFromSimObjPhysics`,
`SimObjPhysics`, `ProceduralTools`) and its recorded records. Besides the house's objects AI2-THOR lists doors, windows,
the floor as a whole (`Floor`, the receptacle), each room's floor, and walls, but no ceilings and no open-plan walls. It
also lists parts of furniture (drawers `id___0`). Evonav does not know these: the furniture contains what lies in them.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from evonav.thor.actions.registry import ActionError
from evonav.thor.agent import AgentBody
from evonav.thor.asset_metadata import AssetMetadata, metadata_of_asset
from evonav.thor.geometry import Vec3, box_around, vector
from evonav.thor.scene import Scene
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.simulator import SceneObject

if TYPE_CHECKING:
    from evonav.thor.engine import Engine

Record = dict[str, Any]

FLOOR_ID = "Floor"

FLAGS = (
    *("receptacle", "toggleable", "breakable", "canFillWithLiquid", "dirtyable", "canBeUsedUp", "cookable"),
    *("isHeatSource", "isColdSource", "sliceable", "openable", "pickupable", "moveable"),
)
"""The properties of an asset."""
# Each row: a state, the flag that it needs, and its key in the house file.
_STATES = (
    ("isToggled", "toggleable", "isOn"),
    ("isBroken", "breakable", "isBroken"),
    ("isFilledWithLiquid", "canFillWithLiquid", "isFilledWithLiquid"),
    ("isDirty", "dirtyable", "isDirty"),
    ("isUsedUp", "canBeUsedUp", "isUsedUp"),
    ("isCooked", "cookable", "isCooked"),
    ("isSliced", "sliceable", "isSliced"),
)
# Upper end of the floor's receptacle trigger box when the house does not give it.
_FLOOR_REACH_M = 0.7


def static_records(scene: Scene) -> list[Record]:
    """Return all fields of all objects; `distance`, `visible` and `isInteractable` depend on the agent and are unset.

    Do not change the records: they are cached until the scene changes.
    """
    return table_of(scene).records


def views(engine: "Engine") -> Iterator[tuple[Record, float, bool]]:
    """Yield the static record of each object, its distance from the agent in metres, and whether it is visible.

    A distance is that between the positions in three dimensions. Visible objects are interactable.
    """
    scene, agent = engine.scene, engine.agent
    table = table_of(scene)
    distances_m = np.linalg.norm(table.positions_m - (agent.x_m, agent.y_m, agent.z_m), axis=1).tolist()
    seen = visible_ids(scene, agent, engine.settings.visibilityDistance)
    for record, distance_m in zip(table.records, distances_m, strict=True):
        yield record, distance_m, record["objectId"] in seen


class ObjectTable(NamedTuple):
    """All records of a scene, and what is derived with them."""

    records: list[Record]
    positions_m: NDArray[np.float64]
    """Positions of the objects, `(N, 3)`."""
    instances: dict[str, int]
    """Instance ids in images, by object id."""
    by_body: dict[int, str]
    """Object ids by index of the body."""
    by_id: dict[str, Record]
    """The records by object id."""


_tables: WeakKeyDictionary[EmbeddedSimulator, ObjectTable] = WeakKeyDictionary()


def table_of(scene: Scene) -> ObjectTable:
    """Return the records of a scene in its present version."""
    return scene.derived(_related_table)


def _related_table(scene: Scene) -> ObjectTable:
    if scene.house is None:
        return _build({}, ())
    table = _tables.get(scene.simulator)
    if table is None:
        table = _tables[scene.simulator] = _build(scene.house, scene.simulator.objects)
    records = [dict(record) for record in table.records]
    _relate(scene.house, records)
    return table._replace(records=records, by_id={record["objectId"]: record for record in reversed(records)})


def record_of(scene: Scene, object_id: str) -> Record:
    """Return an object's static record.

    Raises:
        ActionError: The object does not exist.
    """
    record = table_of(scene).by_id.get(object_id)
    if record is None:
        raise ActionError(f"ArgumentException: objectId: {object_id} is not the objectId on any object in the scene!")
    return record


def own_size_m(scene: Scene, entry: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return the edges of a house object's box along its own axes."""
    record = record_of(scene, entry["id"])
    asset = metadata_of_entry(entry, record["objectType"])
    return np.array(asset.size_m or list(record["axisAlignedBoundingBox"]["size"].values()))


def _build(house: Mapping[str, Any], all_bodies: Sequence[SceneObject]) -> ObjectTable:
    """Make the records of all objects, without their receptacles."""
    found = [(index, body) for index, body in enumerate(all_bodies) if body.kind != "ceiling"]
    bodies = {body.id: body for _, body in found}
    records = [_object_record(entry, bodies[entry["id"]]) for entry, _ in placed_objects(house)]
    openings = [*house.get("doors", ()), *house.get("windows", ())]
    records += [_opening_record(entry, bodies[entry["id"]], house) for entry in openings]
    if house:
        records += _structure_records(house, bodies)
    positions_m = np.array([list(record["position"].values()) for record in records], dtype=np.float64).reshape(-1, 3)
    by_body = {index: body.id for index, body in found}
    instances = {object_id: index + 1 for index, object_id in by_body.items()}
    return ObjectTable(records, positions_m, instances, by_body, {})


def placed_objects(house: Mapping[str, Any]) -> Iterator[tuple[dict[str, Any], str | None]]:
    """Yield the entries of a house file's objects, depth first, each with its parent's id."""

    def walk(entries: Sequence[dict[str, Any]], parent_id: str | None) -> Iterator[tuple[dict[str, Any], str | None]]:
        for entry in entries:
            yield entry, parent_id
            yield from walk(entry.get("children") or (), entry["id"])

    yield from walk(house.get("objects") or (), None)


def _relate(house: Mapping[str, Any], records: list[Record]) -> None:
    """Fill in receptacles and contents; the floor contains all that begins below the top of its trigger box."""
    holders = {entry["id"]: parent_id for entry, parent_id in placed_objects(house)}
    receptacles = {record["objectId"]: record for record in records if record["receptacle"]}
    for record in receptacles.values():
        record["receptacleObjectIds"] = []
    reach_m, floor = _floor_reach_m(house), _floor_id(house)
    for record in records:
        if record["objectId"] not in holders:
            continue
        parents = [holders[record["objectId"]], floor if _bottom_m(record) < reach_m else None]
        known = [receptacles[parent_id] for parent_id in parents if parent_id in receptacles]
        record["parentReceptacles"] = [parent["objectId"] for parent in known] or None
        for parent in known:
            parent["receptacleObjectIds"].append(record["objectId"])
        record["temperature"] = "Cold" if any(parent["isColdSource"] for parent in known) else "RoomTemp"


def _object_record(entry: Mapping[str, Any], body: SceneObject) -> Record:
    asset = metadata_of_entry(entry, body.category)
    rotation = {axis: float(entry["rotation"][axis]) % 360.0 for axis in "xyz"}
    centre_m = (float(entry["position"]["x"]), body.centre_m[1], float(entry["position"]["z"]))
    record = _record(entry, body, asset, centre_m, rotation)
    if asset.is_movable:
        size_m, turn = (asset.size_m, rotation) if asset.size_m else (body.size_m, None)
        record["objectOrientedBoundingBox"] = {"cornerPoints": oriented_corners(centre_m, size_m, turn)}
    return record


def _opening_record(entry: Mapping[str, Any], body: SceneObject, house: Mapping[str, Any]) -> Record:
    """Make a door's or window's record: AI2-THOR puts the closed one's centre at `assetPosition` along `wall0`."""
    asset = metadata_of_entry(entry, body.category)
    wall = next((wall for wall in house["walls"] if wall["id"] == entry.get("wall0")), None)
    centre_m, yaw_deg = body.centre_m, 0.0
    if wall is not None:
        yaw_deg = (_wall_yaw_deg(wall) + 180.0) % 360.0
        if "assetPosition" in entry:
            start, along_m, up_m = _wall_ends(wall)[0], *(float(entry["assetPosition"][axis]) for axis in "xy")
            yaw_rad = math.radians(_wall_yaw_deg(wall))
            x_m, y_m, z_m = (float(start[axis]) for axis in "xyz")
            centre_m = (x_m + along_m * math.cos(yaw_rad), y_m + up_m, z_m - along_m * math.sin(yaw_rad))
    return _record(entry, body, asset, centre_m, vector((0.0, yaw_deg, 0.0)))


def _structure_records(house: Mapping[str, Any], bodies: Mapping[str, SceneObject]) -> Iterator[Record]:
    rooms = [bodies[room["id"]] for room in house.get("rooms", ())]
    low, high = box_around(rooms)
    middle, size = (0.5 * (low + high)).tolist(), (high - low).tolist()
    whole = SceneObject(_floor_id(house), "Floor", "floor", tuple(middle), tuple(size))
    for body, flags in ((whole, {"receptacle"}), *((room, set[str]()) for room in rooms)):
        asset = AssetMetadata("Floor", frozenset(flags))
        yield _record({"id": body.id}, replace(body, category="Floor"), asset, (0.0, 0.0, 0.0), vector((0.0, 0.0, 0.0)))
    for wall in house.get("walls", ()):
        if not wall.get("empty"):
            body = replace(bodies[wall["id"]], category="Wall")
            yield _record(wall, body, AssetMetadata("Wall"), body.centre_m, vector((0.0, _wall_yaw_deg(wall), 0.0)))


def _record(
    entry: Mapping[str, Any],
    body: SceneObject,
    asset: AssetMetadata,
    centre_m: Vec3,
    rotation: dict[str, float],
) -> Record:
    """Make a record without its oriented box and receptacles; its `position` is the asset's pivot."""
    is_openable = "openable" in asset.flags
    openness = float(_value_of(entry, "openness", "isOpen" in asset.first_states)) if is_openable else 0.0
    pivot_m = np.add(centre_m, rotation_of(rotation) @ asset.pivot_m).tolist()
    states = {
        state: flag in asset.flags and bool(_value_of(entry, key, state in asset.first_states))
        for state, flag, key in _STATES
    }
    return {
        "name": str(_value_of(entry, "name", entry["id"])),
        "position": vector(pivot_m),
        "rotation": rotation,
        "visible": False,
        "isInteractable": False,
        **{flag: flag in asset.flags for flag in FLAGS},
        **states,
        "fillLiquid": entry.get("fillLiquid") if states["isFilledWithLiquid"] else None,
        "temperature": "RoomTemp",
        "isOpen": openness > 0.0,
        "openness": openness,
        "isPickedUp": False,
        "mass": asset.mass_kg if asset.materials else 0.0,
        "salientMaterials": list(asset.materials) if asset.materials else None,
        "receptacleObjectIds": [] if "receptacle" in asset.flags else None,
        "distance": 0.0,
        "objectType": body.category,
        "objectId": entry["id"],
        "assetId": str(_value_of(entry, "assetId", "")),
        "parentReceptacles": None,
        "controlledObjects": [] if "toggleable" in asset.flags else None,
        "isMoving": False,
        "axisAlignedBoundingBox": aligned_box(body.centre_m, body.size_m),
        "objectOrientedBoundingBox": None,
    }


def metadata_of_entry(entry: Mapping[str, Any], object_type: str) -> AssetMetadata:
    """Return the metadata of an entry's asset."""
    return metadata_of_asset(str(_value_of(entry, "assetId", "")), object_type)


def _value_of(entry: Mapping[str, Any], key: str, otherwise: object) -> Any:  # noqa: ANN401
    """Return the house file's value, or `otherwise` where it has none or `null`."""
    value = entry.get(key)
    return otherwise if value is None else value


def rotation_of(euler_deg: Mapping[str, float]) -> NDArray[np.float64]:
    """Return Unity's rotation `(3, 3)` of Euler angles: about z, then x, then y. Do not change the array."""
    return _rotation(float(euler_deg["x"]), float(euler_deg["y"]), float(euler_deg["z"]))


@lru_cache(4096)
def _rotation(x_deg: float, y_deg: float, z_deg: float) -> NDArray[np.float64]:
    (sx, cx), (sy, cy), (sz, cz) = (
        (math.sin(angle), math.cos(angle)) for angle in map(math.radians, (x_deg, y_deg, z_deg))
    )
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    turned: NDArray[np.float64] = about_y @ about_x @ about_z
    turned.flags.writeable = False
    return turned


def aligned_box(centre_m: Sequence[float], size_m: Sequence[float]) -> Record:
    """Return the record of an `axisAlignedBoundingBox`."""
    spans = [(centre + 0.5 * size, centre - 0.5 * size) for centre, size in zip(centre_m, size_m, strict=True)]
    return {
        "cornerPoints": [[x, y, z] for x in spans[0] for y in spans[1] for z in spans[2]],
        "center": vector(centre_m),
        "size": vector(size_m),
    }


# Corners in half edges: four around the bottom, then four around the top.
_ORIENTED = [(x, y, z) for y in (-0.5, 0.5) for x, z in ((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5))]


def oriented_corners(centre_m: Vec3, size_m: Vec3, rotation: Mapping[str, float] | None) -> list[list[float]]:
    """Return the `cornerPoints` of an `objectOrientedBoundingBox`."""
    own_m = np.multiply(_ORIENTED, size_m)
    turned_m = own_m @ rotation_of(rotation).T if rotation else own_m
    corners_m: list[list[float]] = (turned_m + centre_m).tolist()
    return corners_m


def _bottom_m(record: Record) -> float:
    box = record["axisAlignedBoundingBox"]
    return float(box["center"]["y"] - 0.5 * box["size"]["y"])


def _floor_id(house: Mapping[str, Any]) -> str:
    return str(house.get("id") or FLOOR_ID)


def _floor_reach_m(house: Mapping[str, Any]) -> float:
    return float((house.get("proceduralParameters") or {}).get("receptacleHeight") or _FLOOR_REACH_M)


def _wall_ends(wall: Mapping[str, Any]) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """Return a wall's two lower corners, in the file's order."""
    corners = sorted(wall["polygon"], key=lambda corner: float(corner["y"]))
    return corners[0], corners[1]


def _wall_yaw_deg(wall: Mapping[str, Any]) -> float:
    start, end = _wall_ends(wall)
    return math.degrees(math.atan2(float(start["z"]) - float(end["z"]), float(end["x"]) - float(start["x"]))) % 360.0


def visible_ids(scene: Scene, agent: AgentBody, distance_m: float) -> set[str]:
    """Return the ids of the objects that AI2-THOR calls visible, by `EmbeddedSimulator.visible_objects`."""
    if scene.house is None:
        return set()
    by_body = table_of(scene).by_body
    seen = scene.simulator.visible_objects(scene.seen_from(agent.camera), max_distance_m=distance_m)
    return {by_body[body] for body in seen}


def camera_axes(agent: AgentBody) -> NDArray[np.float64]:
    """Return `world_from_camera`, `(3, 3)`: right, up and ahead as columns."""
    return rotation_of({"x": agent.horizon_deg, "y": agent.yaw_deg, "z": 0.0})


def object_of_body(scene: Scene, body: int) -> str | None:
    """Return the id of the object that a body of the simulator belongs to; `None` for a ceiling."""
    return table_of(scene).by_body.get(body)
