"""Motion, positions and paths through AI2-THOR's own client and its helpers."""

import gzip
import json
import math
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from recorded_data import data_path, needs_data

from evonav.house import bundled_houses

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


def test_mistakes_raise_and_failures_do_not(controller: Any) -> None:
    with pytest.raises(ValueError, match="missing the following arguments"):
        controller.step("TeleportFull", horizon=0, standing=True)
    with pytest.raises(ValueError, match="moveMagnitude"):
        controller.step("MoveAhead", moveMagnitude="far")
    event = controller.step("LookDown", degrees=100)
    assert not event.metadata["lastActionSuccess"]
    assert event.metadata["errorCode"] == "LookDownCantExceedMin"
    event = controller.step("TeleportFull", position={"x": 99, "y": 0.9, "z": 0}, rotation=0, horizon=0, standing=True)
    assert "out of scene bounds" in event.metadata["errorMessage"]


@pytest.mark.parametrize(("mode", "word"), [("arm", "arm"), ("stretch", "stretch"), ("drone", "drone")])
def test_other_modes_fail_at_the_start(start_controller: StartController, house: Json, mode: str, word: str) -> None:
    controller = start_controller(scene=house)
    with pytest.raises(RuntimeError, match=word):
        controller.reset(scene=house, agentMode=mode)


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


def test_house_starts_as_they_are(start_controller: StartController) -> None:
    houses = [json.loads(house.to_json()) for house in bundled_houses(8)]
    controller = start_controller(scene=houses[0])
    for house in houses:
        controller.reset(scene=house)
        event = controller.step("TeleportFull", **house["metadata"]["agent"])
        assert event.metadata["lastActionSuccess"], event.metadata["errorMessage"]


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
