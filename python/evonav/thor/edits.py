"""Changes of a scene's objects: what moves, what goes, and where things then rest."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.errors import EvonavError
from evonav.thor import objects
from evonav.thor.actions.registry import ActionError
from evonav.thor.asset_metadata import AssetFacts, facts_of
from evonav.thor.scene import Scene
from evonav.thor.surfaces import Surfaces, fresh_surfaces

Entry = dict[str, Any]

# Where under things a support is looked for, in their sizes: as the world does for children of the house file.
_OUTLINE = 0.35 * np.array([(0, 0), (1, 1), (-1, 1), (-1, -1), (1, -1)])
# How far recorded things sink into our shapes of what carries them.
_DIP_M = 0.06
# Lower than this over the floor nothing stands on a shelf.
_LEAST_SHELF_M = 0.01
# Higher than this over a receptacle's box nothing stands on it any more.
_REACH_M = 0.05


@contextmanager
def edited(scene: Scene) -> Iterator[Entry]:
    """The house, to be changed; as it was, should what becomes of it be no house."""
    house = scene.begin_edit()
    before, disabled = _copied(house.get("objects") or []), dict(scene.disabled)
    try:
        yield house
        _ = scene.simulator
    except (ActionError, EvonavError):
        house["objects"], scene.disabled = before, disabled
        scene.begin_edit()
        raise


def entry_of(scene: Scene, object_id: str) -> Entry:
    """A house object's entry in the house file.

    Raises:
        ActionError: There is no such object, or it is part of the building.
    """
    if scene.house is not None:
        for entry, _ in objects.placed_objects(scene.house):
            if entry["id"] == object_id:
                return entry
    record = objects.record_of(scene, object_id)
    raise ActionError(f"{object_id} ({record['objectType']}) is part of the building, which stays as it is")


def _copied(entries: Sequence[Entry]) -> list[Entry]:
    """Entries of which poses and children may be changed."""
    return [
        {
            **e,
            "position": {**e["position"]},
            "rotation": {**e["rotation"]},
            "children": _copied(e.get("children") or []),
        }
        for e in entries
    ]


def holders_of(house: Entry) -> dict[str, list[Entry]]:
    """The list in the house file that holds each entry, by id."""
    lists = [house.setdefault("objects", [])]
    lists += [entry["children"] for entry, _ in objects.placed_objects(house) if entry.get("children")]
    return {entry["id"]: entries for entries in lists for entry in entries}


def detach(holders: Mapping[str, list[Entry]], object_id: str) -> Entry:
    """Takes an entry, with what stands on it, out of the list that holds it."""
    entries = holders[object_id]
    return entries.pop(next(index for index, entry in enumerate(entries) if entry["id"] == object_id))


def facts(entry: Mapping[str, Any], object_type: str) -> AssetFacts:
    """Facts of an entry's asset."""
    return facts_of(str(entry.get("assetId", "")), object_type)


def put(entry: Entry, centre_m: Sequence[float], rotation: Mapping[str, float]) -> None:
    """Sets the pose of an entry, which stays there, and moves what stands on it along."""
    before_m, turn_before = centre_of(entry), objects.rotation_of(entry["rotation"])
    turn = objects.rotation_of(rotation) @ turn_before.T
    yaw_deg = rotation["y"] - float(entry["rotation"]["y"])
    for child, _ in objects.placed_objects({"objects": entry.get("children") or []}):
        child_m = turn @ (centre_of(child) - before_m) + centre_m
        child["position"] = dict(zip("xyz", child_m.tolist(), strict=True))
        child["rotation"] = {**child["rotation"], "y": (float(child["rotation"]["y"]) + yaw_deg) % 360.0}
    entry["position"] = dict(zip("xyz", map(float, centre_m), strict=True))
    entry["rotation"] = {axis: float(rotation[axis]) % 360.0 for axis in "xyz"}
    entry["kinematic"] = True


def centre_of(entry: Mapping[str, Any]) -> NDArray[np.float64]:
    """Middle of an entry's box, as the house file has it."""
    return np.array([float(entry["position"][axis]) for axis in "xyz"])


def settle(scene: Scene) -> None:
    """Writes where things rest into the house file, which may have them higher."""
    bodies = {body.id: body for body in scene.simulator.objects if body.kind == "object"}
    for entry, _ in objects.placed_objects(scene.house or {}):
        entry["position"]["y"] = bodies[entry["id"]].centre_m[1]


def drop(scene: Scene, object_ids: Sequence[str]) -> None:
    """Lets objects fall onto what is under their outlines, lowest first."""
    surfaces, falling = fresh_surfaces(scene), set(object_ids)
    bodies = scene.simulator.objects
    order = sorted((body.centre_m[1] - 0.5 * body.size_m[1], index) for index, body in enumerate(bodies))
    heights_m = {}
    for bottom_m, index in order:
        body = bodies[index]
        if body.kind == "object" and body.id in falling:
            fall_m = bottom_m - rest_height_m(surfaces, body.centre_m, body.size_m, ignored=index)
            surfaces.lift(index, -fall_m)
            heights_m[body.id] = body.centre_m[1] - fall_m
    with edited(scene) as house:
        for entry, _ in objects.placed_objects(house):
            if entry["id"] in heights_m:
                entry["position"]["y"] = heights_m[entry["id"]]
                entry["kinematic"] = True


def rest_height_m(
    surfaces: Surfaces, centre_m: Sequence[float], size_m: Sequence[float], ignored: int | None = None
) -> float:
    """Where the bottom of a box comes to rest when it falls: it never rises."""
    bottom_m = centre_m[1] - 0.5 * size_m[1]
    outline_m = np.array([centre_m[0], centre_m[2]]) + _OUTLINE * np.array([size_m[0], size_m[2]])
    return min(bottom_m, surfaces.height_under_m(outline_m, bottom_m + _DIP_M, ignored))


def relate(scene: Scene, object_ids: Sequence[str]) -> None:
    """Puts entries under the receptacles on which they now are."""
    house, moved = scene.house or {}, set(object_ids)
    records, holders = {record["objectId"]: record for record in objects.static_records(scene)}, holders_of(house)
    placed = [entry for entry, _ in objects.placed_objects(house)]
    receptacles = [entry for entry in placed if records[entry["id"]]["receptacle"]]
    low, high = (np.array([_corner_m(records[e["id"]], side) for e in receptacles]).reshape(-1, 3) for side in (-1, 1))
    for entry in placed:
        if entry["id"] in moved:
            own = {child["id"] for child, _ in objects.placed_objects({"objects": [entry]})}
            others = [i for i, receptacle in enumerate(receptacles) if receptacle["id"] not in own]
            bottom_m = _corner_m(records[entry["id"]], -1)[1]
            found = holder_of(bottom_m, centre_of(entry), low[others], high[others])
            taken = detach(holders, entry["id"])
            target = house["objects"] if found is None else receptacles[others[found]].setdefault("children", [])
            target.append(taken)
            holders[entry["id"]] = target
    scene.note_relations()


def holder_of(
    bottom_m: float, centre_m: NDArray[np.float64], low_m: NDArray[np.float64], high_m: NDArray[np.float64]
) -> int | None:
    """Which of some receptacles a thing stands on or lies in, by boxes alone.

    Args:
        bottom_m: Height of the thing's lowest point.
        centre_m: Middle of the thing.
        low_m: `(N, 3)` least corners of the receptacles' boxes.
        high_m: `(N, 3)` greatest corners.

    Returns:
        An index; rather one whose top the thing is on than one that it is in (a chair pushed under a table reaches
        above it), and of several the smallest: the plate, not the table under it.
    """
    ground_m = centre_m[[0, 2]]
    is_over = ((low_m[:, (0, 2)] <= ground_m) & (ground_m <= high_m[:, (0, 2)])).all(axis=1)
    is_over &= (low_m[:, 1] + _LEAST_SHELF_M < bottom_m) & (bottom_m <= high_m[:, 1] + _REACH_M)
    is_on_top = is_over & (bottom_m >= high_m[:, 1] - _REACH_M)
    is_over = is_on_top if is_on_top.any() else is_over
    volumes_m3 = np.where(is_over, (high_m - low_m).prod(axis=1), np.inf)
    return int(volumes_m3.argmin()) if is_over.any() else None


def _corner_m(record: objects.Record, side: int) -> NDArray[np.float64]:
    box = record["axisAlignedBoundingBox"]
    return np.array([box["center"][axis] + 0.5 * side * box["size"][axis] for axis in "xyz"])
