"""Motion, positions, paths and objects through AI2-THOR's own client and its helpers."""

import gzip
import json
import math
from collections import defaultdict
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded_data import data_path, needs_data

from evonav.house import bundled_houses, stream_houses

metrics = pytest.importorskip("ai2thor.util.metrics", reason="the thor dependency group (ai2thor) is not installed")

Json = dict[str, Any]
StartController = Callable[..., Any]
RECORDED = data_path("ram81-procthor-1k")


def rows(path: Path) -> list[Json]:
    return [json.loads(line) for line in gzip.decompress(path.read_bytes()).splitlines()]


def test_a_short_episode_with_both_engines(controller: Any, house: Json) -> None:
    agent = controller.last_event.metadata["agent"]
    assert agent["position"] == house["metadata"]["agent"]["position"] | {"y": 0.9009992}
    assert (agent["rotation"], agent["isStanding"]) == (house["metadata"]["agent"]["rotation"], True)
    assert agent["cameraHorizon"] == house["metadata"]["agent"]["horizon"]
    positions = controller.step("GetReachablePositions").metadata["actionReturn"]
    assert positions[0] == agent["position"]
    for position in positions[:: len(positions) // 20]:
        event = controller.step("Teleport", position=position, rotation=90)
        assert event.metadata["lastActionSuccess"], event.metadata["errorMessage"]
        assert event.metadata["agent"]["position"] == position
        assert event.metadata["agent"]["rotation"]["y"] == 90
        before = event.metadata["agent"]["position"]
        event = controller.step("MoveAhead")
        after = event.metadata["agent"]["position"]
        if event.metadata["lastActionSuccess"]:
            assert after == before | {"x": before["x"] + 0.25}
        else:
            assert after == before
            assert " is blocking Agent 0 from moving by (0.2500, 0.0000, 0.0000)." in event.metadata["errorMessage"]


def test_metrics_of_the_client(controller: Any, house: Json) -> None:
    start = controller.last_event.metadata["agent"]
    positions = controller.step("GetReachablePositions").metadata["actionReturn"]
    path = metrics.get_shortest_path_to_point(controller, start["position"], positions[-1])
    straight_m = math.dist(*[(p["x"], p["z"]) for p in (start["position"], positions[-1])])
    length_m = metrics.path_distance(path)
    assert straight_m <= length_m < 3 * straight_m
    assert metrics.compute_single_spl(path, path, True) == 1.0
    detour = metrics.compute_single_spl([*path, path[0]], path, True)
    assert detour == pytest.approx(length_m / (length_m + straight_m))
    assert metrics.compute_single_spl(path, path, False) == 0.0
    records = controller.last_event.metadata["objects"]
    types = [record["objectType"] for record in records]
    thing = next(r for r in records if types.count(r["objectType"]) == 1 and r["parentReceptacles"] and r["pickupable"])
    by_id = metrics.get_shortest_path_to_object(controller, thing["objectId"], start["position"], start["rotation"])
    by_type = metrics.get_shortest_path_to_object_type(controller, thing["objectType"], start["position"])
    assert by_id == by_type
    assert metrics.vector_distance(by_id[0], start["position"] | {"y": by_id[0]["y"]}) == 0
    with pytest.raises(ValueError, match="Unable to find shortest path"):
        metrics.get_shortest_path_to_object(controller, "nothing", start["position"])
    away = {"x": 1e3, "y": 0.9, "z": 0.0}
    with pytest.raises(ValueError, match="No point on NavMesh near targetPosition"):
        metrics.get_shortest_path_to_point(controller, start["position"], away)


def test_other_modes_fail_at_the_start(controller: Any, house: Json) -> None:
    with pytest.raises(RuntimeError, match="'drone' is not supported"):
        controller.reset(scene=house, agentMode="drone")


def test_house_starts_as_they_are(controller_in: StartController) -> None:
    for house in bundled_houses(8):
        controller_in(json.loads(house.to_json()))


@pytest.mark.slow
@needs_data("ram81-procthor-1k")
def test_recorded_locobot_starts(start_controller: StartController) -> None:
    """AI2-THOR drew them from its own GetReachablePositions, so all of a house hang together."""
    houses = rows(RECORDED / "val.jsonl.gz")
    starts: dict[int, set[tuple[float, float]]] = defaultdict(set)
    for episode in rows(RECORDED / "procthor-attr-onav-locobot-val.jsonl.gz"):
        position = episode["agentPose"]["position"]
        starts[episode["scene"]].add((position["x"], position["z"]))
    controller = start_controller(scene=houses[0], agentMode="locobot")
    assert controller.last_event.metadata["agent"]["isStanding"] is None
    num_taken = num_reached = 0
    for scene, points in starts.items():
        controller.reset(scene=houses[scene], agentMode="locobot")
        largest = 0
        for x, z in sorted(points):
            position = {"x": x, "y": 0.9009992, "z": z}
            event = controller.step("TeleportFull", position=position, rotation=0, horizon=30, renderImage=False)
            if not event.metadata["lastActionSuccess"]:
                continue
            num_taken += 1
            if largest < len(points) / 2:
                reached = controller.step("GetReachablePositions").metadata["actionReturn"]
                largest = len({(p["x"], p["z"]) for p in reached} & points)
        num_reached += largest
    num_points = sum(map(len, starts.values()))
    assert num_points == 434
    assert num_taken >= 0.995 * num_points
    assert num_reached >= 0.99 * num_points


@pytest.mark.parametrize("number", range(4))
def test_every_room_of_a_made_house_is_reached(controller_in: StartController, number: int) -> None:
    """`House.validate` of the package `procthor`: the house loads, the start is free, each room has five places."""
    house = next(islice(stream_houses("endless:21"), number, None))
    document = json.loads(house.to_json())
    controller = controller_in(document)
    places = controller.step("GetReachablePositions", raise_for_failure=True).metadata["actionReturn"]
    for room in house.rooms:
        assert sum(house.room_of(place["x"], place["z"]) == room.id for place in places) >= 5, room.id
    loaded = {item["objectId"] for item in controller.last_event.metadata["objects"]}
    assert {item.id for item in house.objects} <= loaded


def movable(controller: Any) -> list[Json]:
    return [r for r in controller.last_event.metadata["objects"] if r["pickupable"] or r["moveable"]]


def test_the_client_moves_removes_and_restores_objects(controller: Any) -> None:
    before = {r["objectId"]: r for r in controller.last_event.metadata["objects"]}
    poses = [
        {"objectName": r["name"], "position": r["position"], "rotation": r["rotation"]} for r in movable(controller)
    ]
    assert controller.step(action="SetObjectPoses", objectPoses=poses)
    after = {r["objectId"]: r for r in controller.last_event.metadata["objects"]}
    assert set(after) == set(before)
    gone = movable(controller)[0]["objectId"]
    assert controller.step("DisableObject", objectId=gone)
    assert controller.last_event.get_object(gone) is None
    assert controller.step("EnableObject", objectId=gone)
    back = controller.last_event.get_object(gone)["axisAlignedBoundingBox"]["center"]
    assert back == pytest.approx(after[gone]["axisAlignedBoundingBox"]["center"])
    assert not controller.step("DisableObject", objectId="Ghost")
    assert controller.last_event.metadata["errorMessage"] == ""


def test_an_object_put_before_the_agent_is_seen_there(controller: Any) -> None:
    """In the picture, in the metadata, and by `GetObjectInFrame`."""
    lamp = next((r for r in movable(controller) if r["axisAlignedBoundingBox"]["size"]["y"] > 0.2), None)
    assert lamp is not None
    seen = False
    for pose in controller.step("GetReachablePositions").metadata["actionReturn"]:
        for yaw_deg, (dx_m, dz_m) in ((0, (0.0, 0.9)), (90, (0.9, 0.0))):
            controller.step("Teleport", position=pose, rotation=yaw_deg, horizon=30, standing=True)
            spot = {"x": pose["x"] + dx_m, "y": 1.2, "z": pose["z"] + dz_m}
            if controller.step("PlaceObjectAtPoint", objectId=lamp["objectId"], position=spot):
                event = controller.step("Pass")
                seen = lamp["objectId"] in event.instance_masks
                break
        if seen:
            break
    assert seen
    rows, cols = np.nonzero(event.instance_masks[lamp["objectId"]])
    row, col = int(rows[len(rows) // 2]), int(cols[len(cols) // 2])
    height, width = event.frame.shape[:2]
    found = controller.step("GetObjectInFrame", x=(col + 0.5) / width, y=(row + 0.5) / height)
    assert found.metadata["actionReturn"] == lamp["objectId"]
    assert found.get_object(lamp["objectId"])["visible"]
    assert lamp["objectId"] in controller.step("GetVisibleObjects").metadata["actionReturn"]
