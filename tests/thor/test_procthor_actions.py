"""Each action of the procthor generator, straight at the engine."""

import json

import numpy as np
import pytest
from thor_engine import Json, do, engine_in, records, refused

from evonav.house import bundled_houses


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
    assert engine_in(bare).scene.simulator.objects == engine_in(house).scene.simulator.objects


def test_an_asset_is_spawned_into_an_empty_scene_with_its_box_about_the_position() -> None:
    engine = engine_in(None)
    returned = do(
        engine, "SpawnAsset", assetId="Bed_9", generatedId="0-0", position={"x": 1, "y": 2}, rotation={"y": 90}
    )
    assert returned == {"objectId": "0-0"}
    size = do(engine, "GetAssetDatabase")["Bed_9"]["boundingBox"]
    record = records(engine)["0-0"]
    assert record["objectType"] == "Bed"
    box = record["axisAlignedBoundingBox"]
    assert box["center"] == pytest.approx({"x": 1, "y": 2, "z": 0}, abs=1e-6)
    assert box["size"] == pytest.approx({"x": size["z"], "y": size["y"], "z": size["x"]}, abs=1e-6)


def test_an_impossible_spawn_is_refused_and_leaves_the_scene(house: Json) -> None:
    engine = engine_in(house)
    before = list(records(engine))
    taken = house["rooms"][0]["id"]
    assert "NoSuch_1" in refused(engine, "SpawnAsset", assetId="NoSuch_1", generatedId="a")
    assert taken in refused(engine, "SpawnAsset", assetId="Bed_9", generatedId=taken)
    assert "5000" in refused(engine, "SpawnAsset", assetId="Bed_9", generatedId="a", position={"x": 5000})
    assert list(records(engine)) == before


def test_the_geometry_is_the_surface_of_the_object_in_the_world() -> None:
    engine = engine_in(None)
    do(engine, "SpawnAsset", assetId="Bed_9", generatedId="a", position={"x": 1, "y": 0.5, "z": 2}, rotation={"y": 30})
    (mesh,) = do(engine, "GetInSceneAssetGeometry", objectId="a", triangles=True)
    vertices = np.array([[p["x"], p["y"], p["z"]] for p in mesh["vertices"]])
    low, high = zip(*spans(records(engine)["a"]["axisAlignedBoundingBox"]), strict=True)
    np.testing.assert_allclose([vertices.min(axis=0), vertices.max(axis=0)], [low, high], atol=1e-6)
    # Closed and wound clockwise seen from outside in the left-handed frame: the volume is positive and fits the box.
    corners = vertices[np.array(mesh["triangles"]).reshape(-1, 3)] - vertices.mean(axis=0)
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert 0.05 < volume < np.prod(np.subtract(high, low))
    (smooth,) = do(engine, "GetInSceneAssetGeometry", objectId="a", triangles=True, normals=True)
    assert len(smooth["normals"]) == len(smooth["vertices"]) == len(smooth["triangles"]) > len(mesh["vertices"])
    assert "nothing" in refused(engine, "GetInSceneAssetGeometry", objectId="nothing")


def test_spawned_objects_rest_on_the_receptacle_without_overlap(house: Json, table: str) -> None:
    engine = engine_in(house)
    names = []
    for index in range(6):
        name = f"small|{index}"
        do(engine, "SpawnAsset", assetId="Mug_1", generatedId=name, position={"y": -20})
        assert records(engine)[name]["axisAlignedBoundingBox"]["center"]["y"] == pytest.approx(-20)
        engine.execute(spawn_request(name, table, index))
        if engine.last.is_success:
            names.append(name)
    assert len(names) >= 3
    board = spans(records(engine)[table]["axisAlignedBoundingBox"])
    boxes = {name: spans(records(engine)[name]["axisAlignedBoundingBox"]) for name in names}
    for name, box in boxes.items():
        assert records(engine)[name]["parentReceptacles"][0] == table
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
        engine = engine_in(house)
        do(engine, "InitialRandomSpawn", randomSeed=seed)
        return json.dumps(engine.scene.house)

    assert places(3) == places(3)
    assert places(3) != places(4)


def test_furniture_and_excluded_objects_stay(house: Json) -> None:
    engine = engine_in(house)
    before = records(engine)
    excluded = next(key for key, r in before.items() if r["pickupable"] and r["parentReceptacles"])
    do(engine, "InitialRandomSpawn", randomSeed=1, excludedObjectIds=[excluded])
    after = records(engine)
    moved = {key for key in before if before[key]["position"] != after[key]["position"]}
    assert moved
    assert excluded not in moved
    assert all(before[key]["pickupable"] for key in moved)


def test_objects_are_copied_up_to_the_requested_count(house: Json) -> None:
    engine = engine_in(house)
    kinds = [r["objectType"] for r in records(engine).values() if r["pickupable"]]
    kind = kinds[0]
    wanted = kinds.count(kind) + 2
    do(engine, "InitialRandomSpawn", randomSeed=1, numDuplicatesOfType=[{"objectType": kind, "count": wanted}])
    after = [r["objectType"] for r in records(engine).values()]
    assert after.count(kind) == wanted


def test_a_named_object_that_fits_nowhere_fails_the_action_and_stays(house: Json, table: str) -> None:
    engine = engine_in(house)
    do(engine, "SpawnAsset", assetId="Apple_1", generatedId="apple", position={"y": -20})
    picture = next(o["id"] for o in house["objects"] if "Painting" in o["assetId"])
    message = refused(
        engine, "InitialRandomSpawn", objectIds=["apple"], receptacleObjectIds=[picture], allowMoveable=True
    )
    assert "apple" in message
    assert records(engine)["apple"]["axisAlignedBoundingBox"]["center"]["y"] < -15
    assert "nowhere" in refused(engine, "InitialRandomSpawn", objectIds=["apple"], receptacleObjectIds=["nowhere"])
