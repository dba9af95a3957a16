"""Move portable objects to random free places: `InitialRandomSpawn`. The core finds the places."""

import copy
import json
from collections.abc import Iterator

from pydantic import BaseModel, ConfigDict, NonNegativeInt

from evonav.thor.actions.registry import ActionError, ErrorCode, action
from evonav.thor.asset_metadata import metadata_of_asset
from evonav.thor.engine import Engine
from evonav.thor.objects import placed_objects
from evonav.thor.scene import Document


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
        delta_json, unplaced = scene.simulator.random_spawn(json.dumps(request))
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
