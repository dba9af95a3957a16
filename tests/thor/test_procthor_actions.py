"""Each action of the procthor generator, straight at the engine."""

import copy
import json
from typing import Any

import numpy as np
import pytest

from evonav.house import bundled_houses
from evonav.thor import objects
from evonav.thor.engine import Engine, Result

Json = dict[str, Any]


def engine_with(house: Json | None) -> Engine:
    engine = Engine()
    assert engine.execute({"action": "Reset", "sceneName": "Procedural"}).is_success
    if house is not None:
        assert engine.execute({"action": "CreateHouse", "house": copy.deepcopy(house)}).is_success
    return engine


def do(engine: Engine, action: str, **parameters: object) -> Result:
    result = engine.execute({"action": action, **parameters})
    assert result.is_success, result.error_message
    return result


def refused(engine: Engine, action: str, **parameters: object) -> str:
    result = engine.execute({"action": action, **parameters})
    assert not result.is_success
    assert "inside the engine" not in result.error_message
    return result.error_message


def record_of(engine: Engine, object_id: str) -> Json:
    return next(r for r in objects.static_records(engine.scene) if r["objectId"] == object_id)


def spans(box: Json) -> list[tuple[float, float]]:
    return [(box["center"][a] - box["size"][a] / 2, box["center"][a] + box["size"][a] / 2) for a in "xyz"]


@pytest.fixture(scope="module")
def house() -> Json:
    found: Json = json.loads(next(iter(bundled_houses())).to_json())
    return found


@pytest.fixture
def table(house: Json) -> str:
    """A table of the house."""
    found = next(o["id"] for o in house["objects"] if o["assetId"].startswith("Dining_Table"))
    return str(found)


def test_a_house_without_metadata_is_loaded(house: Json) -> None:
    bare = {key: value for key, value in house.items() if key != "metadata"}
    assert engine_with(bare).scene.simulator.objects == engine_with(house).scene.simulator.objects


def test_an_asset_is_spawned_into_an_empty_scene_with_its_box_about_the_position() -> None:
    engine = engine_with(None)
    returned = do(
        engine, "SpawnAsset", assetId="Bed_9", generatedId="0-0", position={"x": 1, "y": 2}, rotation={"y": 90}
    ).action_return
    assert returned == {"objectId": "0-0"}
    size = do(engine, "GetAssetDatabase").action_return["Bed_9"]["boundingBox"]
    record = record_of(engine, "0-0")
    assert record["objectType"] == "Bed"
    box = record["axisAlignedBoundingBox"]
    assert box["center"] == pytest.approx({"x": 1, "y": 2, "z": 0}, abs=1e-6)
    assert box["size"] == pytest.approx({"x": size["z"], "y": size["y"], "z": size["x"]}, abs=1e-6)


def test_an_impossible_spawn_is_refused_and_leaves_the_scene(house: Json) -> None:
    engine = engine_with(house)
    before = [r["objectId"] for r in objects.static_records(engine.scene)]
    taken = house["rooms"][0]["id"]
    assert "NoSuch_1" in refused(engine, "SpawnAsset", assetId="NoSuch_1", generatedId="a")
    assert taken in refused(engine, "SpawnAsset", assetId="Bed_9", generatedId=taken)
    assert "5000" in refused(engine, "SpawnAsset", assetId="Bed_9", generatedId="a", position={"x": 5000})
    assert [r["objectId"] for r in objects.static_records(engine.scene)] == before


def test_the_geometry_is_the_surface_of_the_object_in_the_world() -> None:
    engine = engine_with(None)
    do(engine, "SpawnAsset", assetId="Bed_9", generatedId="a", position={"x": 1, "y": 0.5, "z": 2}, rotation={"y": 30})
    (mesh,) = do(engine, "GetInSceneAssetGeometry", objectId="a", triangles=True).action_return
    vertices = np.array([[p["x"], p["y"], p["z"]] for p in mesh["vertices"]])
    low, high = zip(*spans(record_of(engine, "a")["axisAlignedBoundingBox"]), strict=True)
    np.testing.assert_allclose([vertices.min(axis=0), vertices.max(axis=0)], [low, high], atol=1e-6)
    # Closed and wound clockwise seen from outside in the left-handed frame: the volume is positive and fits the box.
    corners = vertices[np.array(mesh["triangles"]).reshape(-1, 3)] - vertices.mean(axis=0)
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert 0.05 < volume < np.prod(np.subtract(high, low))
    (smooth,) = do(engine, "GetInSceneAssetGeometry", objectId="a", triangles=True, normals=True).action_return
    assert len(smooth["normals"]) == len(smooth["vertices"]) == len(smooth["triangles"]) > len(mesh["vertices"])
    assert "nothing" in refused(engine, "GetInSceneAssetGeometry", objectId="nothing")


def test_spawned_objects_rest_on_the_receptacle_without_overlap(house: Json, table: str) -> None:
    engine = engine_with(house)
    names = []
    for index in range(6):
        name = f"small|{index}"
        do(engine, "SpawnAsset", assetId="Mug_1", generatedId=name, position={"y": -20})
        assert record_of(engine, name)["axisAlignedBoundingBox"]["center"]["y"] == pytest.approx(-20)
        engine.execute(spawn_request(name, table, index))
        if engine.last.is_success:
            names.append(name)
    assert len(names) >= 3
    board = spans(record_of(engine, table)["axisAlignedBoundingBox"])
    boxes = {name: spans(record_of(engine, name)["axisAlignedBoundingBox"]) for name in names}
    for name, box in boxes.items():
        assert record_of(engine, name)["parentReceptacles"][0] == table
        assert box[1][0] == pytest.approx(board[1][1], abs=0.03)
        assert board[0][0] < sum(box[0]) / 2 < board[0][1]
        assert board[2][0] < sum(box[2]) / 2 < board[2][1]
    for first in names:
        for second in names:
            overlaps = [min(a[1], b[1]) - max(a[0], b[0]) for a, b in zip(boxes[first], boxes[second], strict=True)]
            assert first == second or min(overlaps) < 0.005


def spawn_request(name: str, receptacle: str, seed: int) -> Json:
    return {
        "action": "InitialRandomSpawn",
        "randomSeed": seed,
        "objectIds": [name],
        "receptacleObjectIds": [receptacle],
        "forceVisible": False,
        "allowFloor": False,
        "allowMoveable": True,
    }


def test_a_seed_gives_the_same_places_and_another_seed_others(house: Json) -> None:
    def places(seed: int) -> str:
        engine = engine_with(house)
        do(engine, "InitialRandomSpawn", randomSeed=seed)
        return json.dumps(engine.scene.house)

    assert places(3) == places(3)
    assert places(3) != places(4)


def test_furniture_and_excluded_objects_stay(house: Json) -> None:
    engine = engine_with(house)
    before = {r["objectId"]: r for r in objects.static_records(engine.scene)}
    excluded = next(key for key, r in before.items() if r["pickupable"] and r["parentReceptacles"])
    do(engine, "InitialRandomSpawn", randomSeed=1, excludedObjectIds=[excluded])
    after = {r["objectId"]: r for r in objects.static_records(engine.scene)}
    moved = {key for key in before if before[key]["position"] != after[key]["position"]}
    assert moved
    assert excluded not in moved
    assert all(before[key]["pickupable"] for key in moved)


def test_objects_are_copied_up_to_the_requested_count(house: Json) -> None:
    engine = engine_with(house)
    kinds = [r["objectType"] for r in objects.static_records(engine.scene) if r["pickupable"]]
    kind = kinds[0]
    wanted = kinds.count(kind) + 2
    do(engine, "InitialRandomSpawn", randomSeed=1, numDuplicatesOfType=[{"objectType": kind, "count": wanted}])
    after = [r["objectType"] for r in objects.static_records(engine.scene)]
    assert after.count(kind) == wanted


def test_a_named_object_that_fits_nowhere_fails_the_action_and_stays(house: Json, table: str) -> None:
    engine = engine_with(house)
    do(engine, "SpawnAsset", assetId="Apple_1", generatedId="apple", position={"y": -20})
    picture = next(o["id"] for o in house["objects"] if "Painting" in o["assetId"])
    message = refused(
        engine, "InitialRandomSpawn", objectIds=["apple"], receptacleObjectIds=[picture], allowMoveable=True
    )
    assert "apple" in message
    assert record_of(engine, "apple")["axisAlignedBoundingBox"]["center"]["y"] < -15
    assert "nowhere" in refused(engine, "InitialRandomSpawn", objectIds=["apple"], receptacleObjectIds=["nowhere"])


def test_the_filter_is_set_and_reset() -> None:
    engine = engine_with(None)
    do(engine, "SetObjectFilter", objectIds=["a"])
    assert engine.object_filter == {"a"}
    do(engine, "ResetObjectFilter")
    assert engine.object_filter is None
    do(engine, "SetObjectFilter", objectIds=[])
    do(engine, "Reset")
    assert engine.object_filter is None
