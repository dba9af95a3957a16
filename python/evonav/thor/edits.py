"""Change a scene's objects: move and remove them, and let them fall."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.errors import EvonavError
from evonav.thor import objects
from evonav.thor.actions.registry import ActionError
from evonav.thor.geometry import vector
from evonav.thor.scene import Scene
from evonav.thor.surfaces import Surfaces, fresh_surfaces

Entry = dict[str, Any]

# Points below an object where support is searched, in its sizes: those of the world for children in the house file.
_OUTLINE = 0.35 * np.array([(0, 0), (1, 1), (-1, 1), (-1, -1), (1, -1)])
# Recorded objects may sink this far into our shapes of what supports them.
_DIP_M = 0.06
# Objects below this height above the floor do not stand on a shelf.
_LEAST_SHELF_M = 0.01
# Objects more than this above a receptacle's box do not stand on it.
_REACH_M = 0.05


@contextmanager
def editing(scene: Scene) -> Iterator[Entry]:
    """Yield the house for changes, and restore it if the result is not a valid house."""
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
    """Return a house object's entry in the house file.

    Raises:
        ActionError: The object does not exist, or it is part of the building.
    """
    if scene.house is not None:
        for entry, _ in objects.placed_objects(scene.house):
            if entry["id"] == object_id:
                return entry
    record = objects.record_of(scene, object_id)
    raise ActionError(f"{object_id} ({record['objectType']}) is part of the building, which stays as it is")


def _copied(entries: Sequence[Entry]) -> list[Entry]:
    """Copy entries so that poses and children can be changed."""
    return [
        {
            **e,
            "position": {**e["position"]},
            "rotation": {**e["rotation"]},
            "children": _copied(e.get("children") or []),
        }
        for e in entries
    ]


def lists_by_id(house: Entry) -> dict[str, list[Entry]]:
    """Return the list of the house file that contains each entry, by id."""
    lists = [house.setdefault("objects", [])]
    lists += [entry["children"] for entry, _ in objects.placed_objects(house) if entry.get("children")]
    return {entry["id"]: entries for entries in lists for entry in entries}


def detach(lists: Mapping[str, list[Entry]], object_id: str) -> Entry:
    """Remove an entry, with the objects on it, from its list."""
    entries = lists[object_id]
    return entries.pop(next(index for index, entry in enumerate(entries) if entry["id"] == object_id))


def set_pose(entry: Entry, centre_m: Sequence[float], rotation: Mapping[str, float]) -> None:
    """Set the pose of an entry, where it stays, and move the objects on it along."""
    before_m, turn_before = centre_of(entry), objects.rotation_of(entry["rotation"])
    turn = objects.rotation_of(rotation) @ turn_before.T
    yaw_deg = rotation["y"] - float(entry["rotation"]["y"])
    for child, _ in objects.placed_objects({"objects": entry.get("children") or []}):
        child_m = turn @ (centre_of(child) - before_m) + centre_m
        child["position"] = vector(child_m.tolist())
        child["rotation"] = {**child["rotation"], "y": (float(child["rotation"]["y"]) + yaw_deg) % 360.0}
    entry["position"] = vector(map(float, centre_m))
    entry["rotation"] = {axis: float(rotation[axis]) % 360.0 for axis in "xyz"}
    entry["kinematic"] = True


def centre_of(entry: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return the centre of an entry's box, as the house file has it."""
    return np.array([float(entry["position"][axis]) for axis in "xyz"])


def settle(scene: Scene) -> None:
    """Write the resting heights of objects into the house file, which may have higher ones."""
    bodies = {body.id: body for body in scene.simulator.objects if body.kind == "object"}
    for entry, _ in objects.placed_objects(scene.house or {}):
        entry["position"]["y"] = bodies[entry["id"]].centre_m[1]


def drop(scene: Scene, object_ids: Sequence[str]) -> None:
    """Let objects fall onto what is below their outlines, lowest first."""
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
    with editing(scene) as house:
        for entry, _ in objects.placed_objects(house):
            if entry["id"] in heights_m:
                entry["position"]["y"] = heights_m[entry["id"]]
                entry["kinematic"] = True


def rest_height_m(
    surfaces: Surfaces, centre_m: Sequence[float], size_m: Sequence[float], ignored: int | None = None
) -> float:
    """Return the height at which the bottom of a falling box comes to rest; it never rises."""
    bottom_m = centre_m[1] - 0.5 * size_m[1]
    outline_m = np.array([centre_m[0], centre_m[2]]) + _OUTLINE * np.array([size_m[0], size_m[2]])
    return min(bottom_m, surfaces.height_under_m(outline_m, bottom_m + _DIP_M, ignored))


def update_receptacles(scene: Scene, object_ids: Sequence[str]) -> None:
    """Put entries below the receptacles on which they now stand."""
    house, moved = scene.house or {}, set(object_ids)
    records, lists = objects.table_of(scene).by_id, lists_by_id(house)
    placed = [entry for entry, _ in objects.placed_objects(house)]
    receptacles = [entry for entry in placed if records[entry["id"]]["receptacle"]]
    low, high = (np.array([_corner_m(records[e["id"]], side) for e in receptacles]).reshape(-1, 3) for side in (-1, 1))
    for entry in placed:
        if entry["id"] in moved:
            own = {child["id"] for child, _ in objects.placed_objects({"objects": [entry]})}
            others = [i for i, receptacle in enumerate(receptacles) if receptacle["id"] not in own]
            bottom_m = _corner_m(records[entry["id"]], -1)[1]
            found = find_receptacle(bottom_m, centre_of(entry), low[others], high[others])
            taken = detach(lists, entry["id"])
            target = house["objects"] if found is None else receptacles[others[found]].setdefault("children", [])
            target.append(taken)
            lists[entry["id"]] = target
    scene.mark_changed()


def find_receptacle(
    bottom_m: float, centre_m: NDArray[np.float64], low_m: NDArray[np.float64], high_m: NDArray[np.float64]
) -> int | None:
    """Find the receptacle that an object stands on or lies in, by boxes alone.

    Args:
        bottom_m: Height of the object's lowest point.
        low_m: `(N, 3)` least corners of the receptacles' boxes.
        high_m: `(N, 3)` greatest corners of the receptacles' boxes.

    Returns:
        The receptacle's index, or `None`. A receptacle below the object comes before one around it (a chair pushed
        under a table reaches above the table's seat), and of several the smallest counts: the plate, not the table
        under it.
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
