"""Actions that move, remove and query objects, in bundled houses."""

import json
import math
from typing import Any

import msgpack
import numpy as np
import pytest
from thor_engine import Json, do, engine_in, records, refused

from evonav.house import bundled_houses
from evonav.thor import objects
from evonav.thor.engine import Engine
from evonav.thor.events import pack_event

HOUSES: list[Json] = [json.loads(house.to_json()) for house in bundled_houses(3)]


@pytest.fixture
def engine() -> Engine:
    return engine_in(HOUSES[2])


def movable(engine: Engine) -> list[Json]:
    return [record for record in records(engine).values() if record["pickupable"] or record["moveable"]]


def poses(chosen: list[Json]) -> list[Json]:
    return [{"objectName": r["name"], "position": r["position"], "rotation": r["rotation"]} for r in chosen]


def corners_m(record: Json) -> Any:
    return np.array(record["axisAlignedBoundingBox"]["cornerPoints"])


@pytest.mark.parametrize("is_stationary", [True, False])
def test_setting_the_present_poses_changes_nothing(engine: Engine, is_stationary: bool) -> None:
    before = records(engine)
    do(engine, "SetObjectPoses", objectPoses=poses(movable(engine)), placeStationary=is_stationary)
    after = records(engine)
    assert set(after) == set(before)
    for object_id, record in before.items():
        np.testing.assert_allclose(corners_m(after[object_id]), corners_m(record), atol=1e-3, err_msg=object_id)
    lost = [
        i for i, r in before.items() if set(r["parentReceptacles"] or ()) - set(after[i]["parentReceptacles"] or ())
    ]
    assert len(lost) <= 2


def test_movable_objects_that_are_not_named_are_removed(engine: Engine) -> None:
    kept, *others = movable(engine)
    do(engine, "SetObjectPoses", objectPoses=poses([kept]))
    left = records(engine)
    assert kept["objectId"] in left
    assert not {record["objectId"] for record in others} & set(left)
    assert [r["objectId"] for r in left.values() if r["moveable"] or r["pickupable"]] == [kept["objectId"]]


def test_a_pose_is_that_of_the_pivot_and_copies_get_names_of_their_own(engine: Engine) -> None:
    lamp = next(record for record in movable(engine) if record["objectType"] == "FloorLamp")
    target = {"x": lamp["position"]["x"] + 0.5, "y": 1.0, "z": lamp["position"]["z"]}
    pose = {"objectName": lamp["name"], "position": target, "rotation": {"x": 0, "y": 40, "z": 0}}
    do(engine, "SetObjectPoses", objectPoses=[*poses([lamp]), pose])
    copy = records(engine)[f"{lamp['objectId']}_copy_1"]
    assert copy["name"] == f"{lamp['name']}_copy_1"
    assert copy["position"] == pytest.approx(target)
    assert copy["rotation"]["y"] == 40
    assert records(engine)[lamp["objectId"]]["position"] == pytest.approx(lamp["position"])


def test_an_unknown_name_fails_and_the_other_objects_are_placed(engine: Engine) -> None:
    chosen = poses(movable(engine)[:1])
    message = refused(engine, "SetObjectPoses", objectPoses=[*chosen, {"objectName": "Ghost"}])
    assert message == "No Pickupable or Moveable object of name Ghost found in scene."
    assert len(movable(engine)) == 1


def test_an_object_is_placed_on_the_surface_below_a_point(engine: Engine) -> None:
    table = next(r for r in records(engine).values() if r["objectType"] == "Dresser" and r["receptacleObjectIds"])
    small = table["receptacleObjectIds"][0]
    do(engine, "RemoveFromScene", objectIds=table["receptacleObjectIds"][1:])
    box = table["axisAlignedBoundingBox"]
    top_m = box["center"]["y"] + 0.5 * box["size"]["y"]
    point = {**box["center"], "y": 2.0}
    do(engine, "PlaceObjectAtPoint", objectId=small, position=point)
    record = records(engine)[small]
    assert corners_m(record)[:, 1].min() == pytest.approx(top_m, abs=1e-6)
    assert (record["position"]["x"], record["position"]["z"]) == pytest.approx((point["x"], point["z"]))
    assert record["parentReceptacles"] == [table["objectId"]]
    do(engine, "PlaceObjectAtPoint", objectId=small, position=point, forceKinematic=True)
    assert corners_m(records(engine)[small])[:, 1].min() == pytest.approx(top_m + 0.005, abs=1e-6)


def test_an_object_is_not_placed_where_another_is(engine: Engine) -> None:
    lamp = next(record for record in movable(engine) if record["objectType"] == "FloorLamp")
    dresser = next(record for record in records(engine).values() if record["objectType"] == "Dresser")
    point = {**dresser["axisAlignedBoundingBox"]["center"]}
    point["x"] -= 0.5 * dresser["axisAlignedBoundingBox"]["size"]["x"] + 0.02
    before = records(engine)
    message = refused(engine, "PlaceObjectAtPoint", objectId=lamp["objectId"], position={**point, "y": 0.5})
    assert "Spawn area not clear" in message
    assert records(engine) == before


def test_a_teleported_object_falls_unless_it_collides(engine: Engine) -> None:
    lamp = next(record for record in movable(engine) if record["objectType"] == "FloorLamp")
    x_m, _, z_m = engine.scene.simulator.pose.position_m
    aloft = {"x": x_m, "y": lamp["position"]["y"] + 0.4, "z": z_m}
    do(engine, "TeleportObject", objectId=lamp["objectId"], position=aloft, forceKinematic=True)
    assert records(engine)[lamp["objectId"]]["position"] == pytest.approx(aloft)
    do(engine, "TeleportObject", objectId=lamp["objectId"], position=aloft)
    fallen = records(engine)[lamp["objectId"]]
    assert corners_m(fallen)[:, 1].min() == pytest.approx(0.0, abs=1e-6)
    assert fallen["parentReceptacles"] == ["Floor"]
    inside = next(record for record in records(engine).values() if record["objectType"] == "Fridge")["position"]
    message = refused(engine, "TeleportObject", objectId=lamp["objectId"], position={**inside, "y": 1.0})
    assert message.endswith("is in the way.")
    assert records(engine)[lamp["objectId"]] == fallen
    do(engine, "TeleportObject", objectId=lamp["objectId"], position={**inside, "y": 1.0}, forceAction=True)


def test_furniture_carries_the_objects_on_it(engine: Engine) -> None:
    before = records(engine)
    table = next(r for r in before.values() if r["objectType"] == "Dresser" and r["receptacleObjectIds"])
    target = {**table["position"], "x": table["position"]["x"] + 3.0}
    turned = {**table["rotation"], "y": table["rotation"]["y"] + 90}
    arguments = {"position": target, "rotation": turned, "forceAction": True, "forceKinematic": True}
    do(engine, "TeleportObject", objectId=table["objectId"], **arguments)
    after = records(engine)
    assert after[table["objectId"]]["receptacleObjectIds"] == table["receptacleObjectIds"]

    def seen_from_table(all_records: dict[str, Json], object_id: str) -> Any:
        middles_m = [
            list(all_records[i]["axisAlignedBoundingBox"]["center"].values()) for i in (object_id, table["objectId"])
        ]
        return np.subtract(*middles_m) @ objects.rotation_of(all_records[table["objectId"]]["rotation"])

    for object_id in table["receptacleObjectIds"]:
        np.testing.assert_allclose(seen_from_table(after, object_id), seen_from_table(before, object_id), atol=1e-6)
        assert (after[object_id]["rotation"]["y"] - before[object_id]["rotation"]["y"]) % 360 == pytest.approx(90)


def test_points_off_the_scene_are_named(engine: Engine) -> None:
    small = movable(engine)[0]["objectId"]
    message = refused(engine, "PlaceObjectAtPoint", objectId=small, position={"x": 99.0, "y": 1.0, "z": 0.0})
    assert "Position coordinate ((99.0, 1.0, 0.0)) is not within scene bounds" in message


def test_objects_on_a_removed_object_fall_and_it_returns_empty(engine: Engine) -> None:
    before = records(engine)
    table = next(r for r in before.values() if r["objectType"] == "Dresser" and r["receptacleObjectIds"])
    do(engine, "DisableObject", objectId=table["objectId"])
    after = records(engine)
    assert table["objectId"] not in after
    for object_id in table["receptacleObjectIds"]:
        assert corners_m(after[object_id])[:, 1].min() < corners_m(before[object_id])[:, 1].min() - 0.2
        assert "Floor" in after[object_id]["parentReceptacles"]
    do(engine, "EnableObject", objectId=table["objectId"])
    back = records(engine)[table["objectId"]]
    np.testing.assert_allclose(corners_m(back), corners_m(table), atol=1e-6)


def test_the_building_stays(engine: Engine) -> None:
    wall = next(record for record in records(engine).values() if record["objectType"] == "Wall")
    assert "part of the building" in refused(engine, "DisableObject", objectId=wall["objectId"])


@pytest.mark.parametrize("action", ["RemoveFromScene", "OpenObject", "Contains"])
def test_unknown_ids_are_named(engine: Engine, action: str) -> None:
    assert (
        refused(engine, action, objectId="Ghost")
        == "ArgumentException: objectId: Ghost is not the objectId on any object in the scene!"
    )


def test_unknown_ids_where_ai2thor_has_another_message(engine: Engine) -> None:
    assert refused(engine, "DisableObject", objectId="Ghost") == ""
    assert refused(engine, "EnableObject", objectId="Ghost") == ""
    at = {"x": 1.0, "y": 1.0, "z": 1.0}
    assert refused(engine, "PlaceObjectAtPoint", objectId="Ghost", position=at) == "Cannot find object with id Ghost."


@pytest.mark.parametrize("number", [0, 2])
def test_the_object_at_a_pixel_is_the_one_of_the_instance_image(number: int) -> None:
    """And its point has the pixel's depth. Pixels next to an outline may be either side's."""
    engine = engine_in(HOUSES[number])
    engine.agent.horizon_deg = 20.0
    agreed = total = 0
    for yaw_deg in (0.0, 75.0, 200.0):
        engine.agent.yaw_deg = yaw_deg
        frame = engine.scene.simulator.render(engine.agent.pose, rgb=False)
        assert frame.instances is not None
        bodies = engine.scene.simulator.objects
        for row in range(5, 300, 30):
            for col in range(5, 300, 30):
                around = frame.instances[row - 1 : row + 2, col - 1 : col + 2]
                body = bodies[int(frame.instances[row, col]) - 1]
                if (around != around[1, 1]).any() or around[1, 1] == 0 or body.kind == "ceiling":
                    continue
                x, y = (col + 0.5) / 300, (row + 0.5) / 300
                total += 1
                agreed += do(engine, "GetObjectInFrame", x=x, y=y) == body.id
                point = do(engine, "GetCoordinateFromRaycast", x=x, y=y)
                offset_m = np.subtract(list(point.values()), engine.agent.camera.position_m)
                depth_m = offset_m @ objects.camera_axes(engine.agent)[:, 2]
                assert depth_m == pytest.approx(float(frame.depth_m[row, col]), rel=2e-3, abs=2e-3)
    assert total > 100
    assert agreed == total


def test_image_points_and_world_points_convert_both_ways(engine: Engine) -> None:
    engine.agent.yaw_deg, engine.agent.horizon_deg = 33.0, 12.0
    point = do(engine, "GetCoordinateFromRaycast", x=0.3, y=0.8)
    back = do(engine, "WorldToViewportPoint", position=point)
    assert (back["x"], back["y"]) == pytest.approx((0.3, 0.8))
    assert "x/y must be in [0:1]" in refused(engine, "GetObjectInFrame", x=1.5, y=0.5)


def test_states_show_in_records(engine: Engine) -> None:
    def one(flag: str) -> Json:
        return next(record for record in records(engine).values() if record[flag])

    fridge, lamp = one("openable"), next(r for r in records(engine).values() if r["objectType"] == "FloorLamp")
    do(engine, "OpenObject", objectId=fridge["objectId"], openness=0.6, forceAction=True)
    opened = records(engine)[fridge["objectId"]]
    assert (opened["isOpen"], opened["openness"]) == (True, 0.6)
    do(engine, "CloseObject", objectId=fridge["objectId"], forceAction=True)
    assert not records(engine)[fridge["objectId"]]["isOpen"]
    is_on = lamp["isToggled"]
    first, then = ("ToggleObjectOff", "ToggleObjectOn") if is_on else ("ToggleObjectOn", "ToggleObjectOff")
    do(engine, first, objectId=lamp["objectId"], forceAction=True)
    assert records(engine)[lamp["objectId"]]["isToggled"] != is_on
    assert "already" in refused(engine, first, objectId=lamp["objectId"], forceAction=True)
    do(engine, then, objectId=lamp["objectId"], forceAction=True)
    assert records(engine)[lamp["objectId"]] == lamp


def test_one_action_sets_the_state_of_many_objects(engine: Engine) -> None:
    def those(flag: str) -> list[Json]:
        return [record for record in records(engine).values() if record[flag]]

    do(engine, "SetObjectStates", SetObjectStates={"stateChange": "toggleable", "isToggled": True})
    assert those("toggleable")
    assert all(record["isToggled"] for record in those("toggleable"))
    do(engine, "SetObjectStates", SetObjectStates={"objectType": "FloorLamp", "stateChange": "toggleable"})
    assert {record["objectType"] for record in those("toggleable") if not record["isToggled"]} == {"FloorLamp"}
    do(engine, "SetObjectStates", SetObjectStates={"stateChange": "openable", "isOpen": True})
    assert all(record["openness"] == 1 for record in those("openable"))
    assert "stateChange" in refused(engine, "SetObjectStates", SetObjectStates={"stateChange": "sliceable"})


def test_states_that_an_object_lacks_are_refused(engine: Engine) -> None:
    dresser = next(record for record in records(engine).values() if record["objectType"] == "Dresser")["objectId"]
    assert refused(engine, "OpenObject", objectId=dresser, forceAction=True) == f"{dresser} is not an Openable object"
    assert refused(engine, "ToggleObjectOn", objectId=dresser, forceAction=True) == f"{dresser} is not toggleable"
    far = refused(engine, "OpenObject", objectId=dresser)
    assert far == "NullReferenceException: Target object not found within the specified visibility."


def test_open_on_and_dirty_states_come_from_the_house_file() -> None:
    engine = engine_in(HOUSES[2])
    house = engine.scene.house
    assert house is not None
    entries = {entry["id"]: entry for entry, _ in objects.placed_objects(house)}
    book = next(r["objectId"] for r in records(engine).values() if r["objectType"] == "Book")
    lamp = next(r["objectId"] for r in records(engine).values() if r["objectType"] == "FloorLamp")
    entries[book]["openness"], entries[lamp]["isOn"] = 0.25, False
    do(engine, "CreateHouse", house=house)
    assert records(engine)[book]["openness"] == 0.25
    assert not records(engine)[lamp]["isToggled"]


def test_null_in_a_house_file_means_the_assets_default(engine: Engine) -> None:
    house = engine.scene.house
    assert house is not None
    entries = [entry for entry, _ in objects.placed_objects(house)]
    for entry in entries:
        for key in ("openness", "isOn", "isDirty"):
            entry.pop(key, None)
    do(engine, "CreateHouse", house=house)
    before = records(engine)
    assert any(record["isToggled"] for record in before.values())
    for entry in entries:
        entry.update({"openness": None, "isOn": None, "isDirty": None})
    do(engine, "CreateHouse", house=house)
    assert records(engine) == before


def test_an_object_outside_a_fridge_is_not_cold(engine: Engine) -> None:
    fridge = next(record for record in records(engine).values() if record["objectType"] == "Fridge")
    food = fridge["receptacleObjectIds"][0]
    assert records(engine)[food]["temperature"] == "Cold"
    x_m, _, z_m = engine.scene.simulator.pose.position_m
    do(engine, "PlaceObjectAtPoint", objectId=food, position={"x": x_m, "y": 1.0, "z": z_m})
    assert records(engine)[food]["temperature"] == "RoomTemp"
    assert food not in records(engine)[fridge["objectId"]]["receptacleObjectIds"]


def test_a_door_is_drawn_as_open_as_it_is(engine: Engine) -> None:
    door = next(record for record in records(engine).values() if record["objectType"] == "Doorway" and record["isOpen"])
    size_m = np.ptp(corners_m(door), axis=0)
    do(engine, "CloseObject", objectId=door["objectId"], forceAction=True)
    closed_m = np.ptp(corners_m(records(engine)[door["objectId"]]), axis=0)
    assert min(closed_m[0], closed_m[2]) < min(size_m[0], size_m[2]) - 0.3
    assert math.isclose(closed_m[1], size_m[1], abs_tol=1e-6)


@pytest.mark.parametrize(
    "object_type",
    ["FloorLamp", "Wall", *(pytest.param(name, marks=pytest.mark.slow) for name in ("Dresser", "Doorway"))],
)
def test_an_object_is_visible_from_its_interactable_poses_and_from_no_others(engine: Engine, object_type: str) -> None:
    target = next(record for record in records(engine).values() if record["objectType"] == object_type)["objectId"]
    positions = do(engine, "GetReachablePositions")[::6]
    found = do(engine, "GetInteractablePoses", objectId=target, positions=positions, standings=[True])
    assert found
    chosen = {(pose["x"], pose["z"], pose["rotation"], pose["horizon"]) for pose in found}
    is_seen = set()
    for position in positions:
        for yaw_deg in (0.0, 90.0, 180.0, 270.0):
            for horizon_deg in (-30.0, 0.0, 30.0, 60.0):
                engine.agent.x_m, engine.agent.z_m = position["x"], position["z"]
                engine.agent.yaw_deg, engine.agent.horizon_deg = yaw_deg, horizon_deg
                if target in do(engine, "GetVisibleObjects"):
                    is_seen.add((position["x"], position["z"], yaw_deg, horizon_deg))
    assert chosen == is_seen
    first = do(engine, "GetInteractablePoses", objectId=target, positions=positions, standings=[True], maxPoses=3)
    assert len(first) == 3
    older = do(engine, "PositionsFromWhichItemIsInteractable", objectId=target, positions=positions)
    assert set(older) == {"x", "y", "z", "rotation", "standing", "horizon"}
    assert older["standing"].count(1.0) == len(found)


def test_poses_of_an_absurd_grid_are_refused(engine: Engine) -> None:
    target = next(record for record in records(engine).values() if record["objectType"] == "FloorLamp")["objectId"]
    x_m, z_m = engine.agent.point_m
    positions = [{"x": x_m + 1e-3 * i, "y": 0.9, "z": z_m} for i in range(2)]
    lamp = records(engine)[target]["position"]
    many = [{"x": lamp["x"], "y": 0.9, "z": lamp["z"]}] * 4000
    message = refused(engine, "GetInteractablePoses", objectId=target, positions=positions + many)
    assert "gridSize 0.25 m gives 4002 positions" in message


def test_objects_can_be_placed_at_spawn_coordinates(engine: Engine) -> None:
    table = next(r for r in records(engine).values() if r["objectType"] == "Dresser" and r["receptacleObjectIds"])
    small, *rest = table["receptacleObjectIds"]
    points = do(engine, "GetSpawnCoordinatesAboveReceptacle", objectId=table["objectId"], anywhere=True)
    assert 50 < len(points) <= 400
    do(engine, "PlaceObjectAtPoint", objectId=small, positions=points)
    assert records(engine)[small]["parentReceptacles"] == [table["objectId"]]
    assert set(rest) <= set(do(engine, "Contains", objectId=table["objectId"]))
    assert "not found within" in refused(engine, "GetSpawnCoordinatesAboveReceptacle", objectId=table["objectId"])


def test_events_list_filtered_objects_after_every_edit(engine: Engine) -> None:
    """Whatever was packed before, an event is that of a scene for which nothing was packed yet."""

    def unpacked_before() -> bytes:
        engine.scene.mark_changed()
        return pack_event(engine, sequence_id=1, has_colors=False)

    first, second, *_ = movable(engine)
    for wanted in (frozenset(), frozenset({second["objectId"]}), None):
        engine.object_filter = wanted
        packed = pack_event(engine, sequence_id=1, has_colors=False)
        assert packed == unpacked_before()
        listed = {record["objectId"] for record in msgpack.unpackb(packed)["agents"][0]["objects"]}
        assert listed == (set(records(engine)) if wanted is None else set(wanted))
    do(engine, "DisableObject", objectId=first["objectId"])
    packed = pack_event(engine, sequence_id=1, has_colors=False)
    assert packed == unpacked_before()
