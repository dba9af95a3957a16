"""Reachable positions and shortest paths of the engine: the embedded simulator's, in AI2-THOR's order and words."""

import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from thor_engine import Json, do, engine_in, refused

from evonav.house import bundled_houses
from evonav.thor import objects
from evonav.thor.actions.registry import ErrorCode
from evonav.thor.engine import Engine
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.simulator import SimulatorConfig

HOUSES: list[Json] = [json.loads(house.to_json()) for house in bundled_houses(3)]


def embedded(engine: Engine, house: Json, **config: float) -> EmbeddedSimulator:
    simulator = EmbeddedSimulator(SimulatorConfig(**config))
    simulator.reset(json.dumps(house))
    assert simulator.teleport(engine.agent.pose)
    return simulator


def points_of(positions: list[Json]) -> list[tuple[float, float]]:
    return [(p["x"], p["z"]) for p in positions]


@pytest.mark.parametrize("house", HOUSES)
@pytest.mark.parametrize("grid_m", [0.25, 0.1, 0.4])
def test_reachable_positions_equal_the_embedded_simulators(house: Json, grid_m: float) -> None:
    engine = engine_in(house)
    positions = do(engine, "GetReachablePositions", **({} if grid_m == 0.25 else {"gridSize": grid_m}))
    points = points_of(positions)
    want = embedded(engine, house, grid_m=grid_m).reachable_positions()[:, [0, 2]].tolist()
    assert sorted(map(list, points)) == sorted(want)
    assert len(set(points)) == len(points) > 100
    assert {p["y"] for p in positions} == {engine.agent.y_m}


def test_reachable_positions_come_breadth_first_in_ai2thors_order() -> None:
    engine = engine_in(HOUSES[1])
    points = points_of(do(engine, "GetReachablePositions"))
    here = engine.agent.point_m
    assert points[0] == here
    cells = [(round((x - here[0]) * 4), round((z - here[1]) * 4)) for x, z in points]
    can_move = engine.scene.simulator.can_move
    # By the book: a queue of cells, each of which adds what it reaches first.
    queue = [(0, 0)]
    for i, j in queue:
        for step in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            cell = (i + step[0], j + step[1])
            ends = [(here[0] + c[0] * 0.25, here[1] + c[1] * 0.25) for c in ((i, j), cell)]
            if cell not in queue and can_move(*ends):
                queue.append(cell)
    assert cells == queue


def test_the_grid_may_turn_with_the_agent() -> None:
    engine = engine_in(HOUSES[1], snapToGrid=False, rotateStepDegrees=30)
    do(engine, "Teleport", rotation={"y": 30})
    points = points_of(do(engine, "GetReachablePositions", directionsRelativeAgent=True))
    here, yaw_rad = engine.agent.point_m, math.radians(30)
    for x, z in points:
        right = ((x - here[0]) * math.cos(yaw_rad) - (z - here[1]) * math.sin(yaw_rad)) * 4
        ahead = ((x - here[0]) * math.sin(yaw_rad) + (z - here[1]) * math.cos(yaw_rad)) * 4
        assert abs(right - round(right)) < 1e-9
        assert abs(ahead - round(ahead)) < 1e-9
    assert len(points) > 100
    straight = (here[0] + 0.25 * math.sin(yaw_rad), here[1] + 0.25 * math.cos(yaw_rad))
    assert (straight in points) == engine.scene.simulator.can_move(here, straight)


def test_a_stuck_agent_reaches_its_own_position_only() -> None:
    engine = engine_in(HOUSES[0])
    middle = HOUSES[0]["objects"][0]["position"]
    do(engine, "Teleport", position=middle, forceAction=True)
    assert points_of(do(engine, "GetReachablePositions")) == [(middle["x"], middle["z"])]


@pytest.mark.parametrize("grid_m", [1e-9, -0.25])
def test_useless_grids_are_refused(grid_m: float) -> None:
    assert "gridSize" in refused(engine_in(HOUSES[0]), "GetReachablePositions", gridSize=grid_m)


def test_too_many_steps() -> None:
    engine = engine_in(HOUSES[0])
    num_points = len(do(engine, "GetReachablePositions", gridSize=0.5))
    do(engine, "GetReachablePositions", gridSize=0.5, maxStepCount=math.ceil(num_points / 4))
    message = refused(engine, "GetReachablePositions", gridSize=0.5, maxStepCount=math.ceil(num_points / 4) - 1)
    assert message == "InvalidOperationException: Too many steps taken in GetReachablePositions."


def test_a_grid_of_too_many_positions_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = engine_in(HOUSES[0])
    num_points = len(do(engine, "GetReachablePositions", gridSize=0.5))
    monkeypatch.setattr("evonav.thor.actions.paths._MAX_POSITIONS", num_points)
    do(engine, "GetReachablePositions", gridSize=0.5)
    monkeypatch.setattr("evonav.thor.actions.paths._MAX_POSITIONS", num_points - 1)
    assert f"gridSize 0.5 m gives more than {num_points - 1} positions" in refused(
        engine, "GetReachablePositions", gridSize=0.5
    )


@pytest.mark.parametrize("name", ["position", "rotation", "horizon"])
def test_a_forced_pose_beyond_single_precision_is_refused(name: str) -> None:
    engine = engine_in(HOUSES[0])
    before = engine.state
    pose = {name: 1e300 if name == "horizon" else {"x": 0.0, "y": 1e300, "z": 0.0}}
    assert "single precision" in refused(engine, "Teleport", forceAction=True, **pose)
    assert engine.state == before


@pytest.fixture(scope="module")
def pairs() -> list[tuple[Engine, EmbeddedSimulator]]:
    """Each house in an engine and in a simulator."""
    engines = [engine_in(house) for house in HOUSES]
    return [(engine, embedded(engine, house)) for engine, house in zip(engines, HOUSES, strict=True)]


@settings(max_examples=30, deadline=None)
@given(data=st.data(), number=st.sampled_from(range(3)))
def test_path_corners_equal_the_embedded_simulators(
    pairs: list[tuple[Engine, EmbeddedSimulator]], data: st.DataObject, number: int
) -> None:
    engine, simulator = pairs[number]
    reachable_m = simulator.reachable_positions().tolist()
    ends = [data.draw(st.sampled_from(reachable_m)) for _ in range(2)]
    start, target = ({"x": x, "y": 0.9, "z": z} for x, _, z in ends)
    path = do(engine, "GetShortestPathToPoint", position=start, target=target)
    want = simulator.shortest_path(tuple(ends[0]), tuple(ends[1]))
    assert points_of(path["corners"]) == [(x, z) for x, _, z in want.tolist()]
    assert path["status"] == "PathComplete"
    # As the client's helper spells it.
    assert do(engine, "GetShortestPathToPoint", position=start, **target) == path
    do(engine, "Teleport", position=start, forceAction=True)
    assert do(engine, "GetShortestPathToPoint", target=target) == path


def test_ends_off_the_free_space() -> None:
    engine = engine_in(HOUSES[0])
    corners = do(engine, "GetReachablePositions")
    here = corners[0]
    far = here | {"x": here["x"] + 100}
    assert "No point on NavMesh near targetPosition" in refused(engine, "GetShortestPathToPoint", target=far)
    assert "No point on NavMesh near startPosition" in refused(
        engine, "GetShortestPathToPoint", position=far, target=here
    )
    # The middle of a wall that is free space's border: one end may be off, both only if allowed.
    can_move = engine.scene.simulator.can_move
    edge = next(p for p in corners if not can_move((p["x"], p["z"]), (p["x"] - 0.25, p["z"])))
    step_m = next(d / 100 for d in range(100) if not can_move(*[(edge["x"] - d / 100, edge["z"])] * 2))
    inside = edge | {"x": edge["x"] - step_m - 0.05}
    assert len(do(engine, "GetShortestPathToPoint", position=here, target=inside)["corners"]) > 1
    message = refused(engine, "GetShortestPathToPoint", position=inside, target=inside)
    assert "Closest point on NavMesh was too far from the agent" in message
    do(engine, "GetShortestPathToPoint", position=inside, target=inside, allowedError=0.2)
    deep = next(
        body.centre_m
        for body in engine.scene.simulator.objects
        if body.kind == "object" and body.centre_m[1] < 0.9 and 0.3 < min(body.size_m[0], body.size_m[2]) < 0.6
    )
    target = {"x": deep[0], "y": 0.9, "z": deep[2]}
    assert "No point on NavMesh near targetPosition" in refused(engine, "GetShortestPathToPoint", target=target)
    do(engine, "GetShortestPathToPoint", target=target, allowedError=0.5)
    refused(engine, "GetShortestPathToPoint")
    assert engine.last.error_code is ErrorCode.MISSING_ARGUMENTS


def test_the_path_to_an_object_ends_where_it_can_be_seen() -> None:
    engine = engine_in(HOUSES[1])
    num_found = 0
    for thing in HOUSES[1]["objects"]:
        result = engine.execute({"action": "GetShortestPath", "objectId": thing["id"]})
        if not result.is_success:
            assert "is not visible on navigation path given current agent parameters" in result.error_message
            continue
        num_found += 1
        end = result.action_return["corners"][-1]
        record = next(r for r in objects.static_records(engine.scene) if r["objectId"] == thing["id"])
        to = record["position"]
        yaw_deg = math.degrees(math.atan2(to["x"] - end["x"], to["z"] - end["z"]))
        ground_m = math.hypot(to["x"] - end["x"], to["z"] - end["z"])
        horizon = math.degrees(math.atan2(1.575 - to["y"], ground_m))
        looking = engine_in(HOUSES[1])
        at = {"x": end["x"], "y": 0.9009992, "z": end["z"]}
        do(looking, "Teleport", position=at, rotation={"y": yaw_deg}, horizon=horizon, forceAction=True)
        assert thing["id"] in objects.visible_ids(looking.scene, looking.agent, 1.5)
    assert num_found > 0.8 * len(HOUSES[1]["objects"])


def test_objects_by_type() -> None:
    engine = engine_in(HOUSES[1])
    records = objects.static_records(engine.scene)
    by_type: dict[str, list[str]] = {}
    for record in records:
        by_type.setdefault(record["objectType"], []).append(record["objectId"])
    single = next(name for name, ids in by_type.items() if len(ids) == 1 and ids[0] in str(HOUSES[1]["objects"]))
    several = next(name for name, ids in by_type.items() if len(ids) > 1)
    assert do(engine, "ObjectTypeToObjectIds", objectType=several) == by_type[several]
    here = HOUSES[1]["metadata"]["agent"]["position"]
    by_id = do(engine, "GetShortestPath", objectId=by_type[single][0], position=here, rotation={"y": 90})
    assert do(engine, "GetShortestPath", objectType=single.lower(), position=here) == by_id
    assert "cannot disambiguate" in refused(engine, "GetShortestPath", objectType=several)
    assert "was not found in the scene" in refused(engine, "GetShortestPath", objectType="Submarine")
    assert "Cannot find sim object with id nothing" in refused(engine, "GetShortestPath", objectId="nothing")


def test_the_expert_walks_to_objects() -> None:
    engine = engine_in(HOUSES[1])
    num_seen, things = 0, HOUSES[1]["objects"][::2]
    for thing in things:
        do(engine, "TeleportFull", **HOUSES[1]["metadata"]["agent"])
        for _ in range(150):
            result = engine.execute({"action": "ObjectNavExpertAction", "objectId": thing["id"]})
            if not result.is_success:
                break
            do(engine, str(result.action_return))
        assert result.error_message == "", "AI2-THOR's way to say that nothing is left to do"
        num_seen += thing["id"] in objects.visible_ids(engine.scene, engine.agent, 1.5)
    # The expert stops when it is there and a part of the object is in the picture, even behind something else.
    assert num_seen >= 0.8 * len(things)


@pytest.mark.parametrize(("horizon", "look"), [(-30, "LookDown"), (60, "LookUp")])
def test_the_expert_looks_for_an_object_in_front_of_it(horizon: float, look: str) -> None:
    engine = engine_in(HOUSES[1])
    looks = set()
    for thing in HOUSES[1]["objects"]:
        result = engine.execute({"action": "GetShortestPath", "objectId": thing["id"]})
        if not result.is_success:
            continue
        end = result.action_return["corners"][-1]
        do(engine, "Teleport", position={"x": end["x"], "y": 0.9, "z": end["z"]}, horizon=horizon)
        for _ in range(8):
            result = engine.execute({"action": "ObjectNavExpertAction", "objectId": thing["id"]})
            if not result.is_success:
                break
            looks.add(result.action_return)
            do(engine, result.action_return)
        assert result.error_message == ""
    assert look in looks


def test_the_expert_walks_to_a_position() -> None:
    engine = engine_in(HOUSES[1])
    target = do(engine, "GetReachablePositions")[-1]
    for _ in range(200):
        result = engine.execute({"action": "ObjectNavExpertAction", "position": target})
        if not result.is_success:
            break
        do(engine, str(result.action_return))
    assert engine.agent.point_m == (target["x"], target["z"])
    refused(engine, "ObjectNavExpertAction")
    assert engine.last.error_code is ErrorCode.MISSING_ARGUMENTS


def test_paths_are_not_drawn() -> None:
    engine = engine_in(HOUSES[1])
    do(engine, "VisualizePath", positions=do(engine, "GetReachablePositions")[:3], grid=False)
    do(engine, "HideVisualizedPath")
    assert "Path cannot be null or empty" in refused(engine, "VisualizePath", positions=[])
