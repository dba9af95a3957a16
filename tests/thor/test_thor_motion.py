"""The engine's motion against the embedded simulator's, bit for bit, and against AI2-THOR's rules and words."""

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from thor_engine import do, engine_in, refused

from evonav.house import bundled_houses
from evonav.thor.actions.registry import ErrorCode
from evonav.thor.engine import Engine, Result
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import Action, SimulatorConfig

Json = dict[str, Any]
HOUSES: list[Json] = [json.loads(house.to_json()) for house in bundled_houses(3)]
STEPS = {Action.MOVE_FORWARD: "MoveAhead", Action.TURN_LEFT: "RotateLeft", Action.TURN_RIGHT: "RotateRight"}


def run(engine: Engine, action: str, **arguments: object) -> Result:
    return engine.execute({"action": action, "sequenceId": 7, "renderImage": False, **arguments})


@settings(max_examples=25, deadline=None)
@given(
    house=st.sampled_from(HOUSES),
    turn_deg=st.sampled_from([15.0, 30.0, 45.0, 90.0, 7.5, 36.7]),
    steps=st.lists(st.sampled_from([*STEPS, Action.MOVE_FORWARD, Action.MOVE_FORWARD]), max_size=60),
)
def test_poses_equal_the_embedded_simulators_bit_by_bit(house: Json, turn_deg: float, steps: list[Action]) -> None:
    engine = engine_in(house, snapToGrid=False, rotateStepDegrees=turn_deg)
    simulator = EmbeddedSimulator(SimulatorConfig(turn_deg=turn_deg))
    simulator.reset(json.dumps(house))
    assert simulator.teleport(engine.agent.pose)
    for step in steps:
        assert run(engine, STEPS[step]).is_success == simulator.step(step)
        got, want = engine.agent.pose, simulator.pose
        assert (got.x_m, got.z_m, got.yaw_rad, got.horizon_rad) == (want.x_m, want.z_m, want.yaw_rad, want.horizon_rad)


@pytest.fixture(scope="module")
def free_engine() -> Engine:
    return engine_in(HOUSES[0], snapToGrid=False, rotateStepDegrees=15)


@given(x_m=st.floats(-0.05, 0.05), z_m=st.floats(-0.05, 0.05), yaw_deg=st.floats(-720, 720), horizon=st.floats(-30, 60))
@settings(max_examples=60, deadline=None)
def test_teleports_come_back_exactly(
    free_engine: Engine, x_m: float, z_m: float, yaw_deg: float, horizon: float
) -> None:
    engine, start = free_engine, HOUSES[0]["metadata"]["agent"]["position"]
    pose = Pose.of_degrees(start["x"] + x_m, 0.9, start["z"] + z_m, yaw_deg, horizon)
    at = {"x": pose.x_m, "y": 0.9009992, "z": pose.z_m}
    look = {"rotation": {"y": pose.yaw_deg}, "horizon": pose.horizon_deg, "standing": True}
    do(engine, "TeleportFull", position=at, **look, forceAction=True)
    got = engine.agent.pose
    assert (got.x_m, got.z_m, got.yaw_rad, got.horizon_rad) == (pose.x_m, pose.z_m, pose.yaw_rad, pose.horizon_rad)
    assert (engine.agent.yaw_deg, engine.agent.horizon_deg) == (pose.yaw_deg, pose.horizon_deg)


def test_moves_in_all_directions_undo_each_other() -> None:
    engine = engine_in(HOUSES[1])
    start = engine.agent.pose
    moves = {"MoveAhead": "MoveBack", "MoveRight": "MoveLeft", "MoveLeft": "MoveRight", "MoveBack": "MoveAhead"}
    sides = {"MoveAhead": (0, 1), "MoveRight": (1, 0), "MoveLeft": (-1, 0), "MoveBack": (0, -1)}
    num_moved = 0
    for yaw_deg in (0, 90, 180, 270):
        for move, back in moves.items():
            do(engine, "Teleport", rotation={"y": yaw_deg})
            if not run(engine, move).is_success:
                continue
            num_moved += 1
            right, ahead = sides[move]
            turn_rad = math.radians(yaw_deg)
            assert engine.agent.x_m - start.x_m == pytest.approx(
                0.25 * (right * math.cos(turn_rad) + ahead * math.sin(turn_rad))
            )
            assert engine.agent.z_m - start.z_m == pytest.approx(
                0.25 * (ahead * math.cos(turn_rad) - right * math.sin(turn_rad))
            )
            do(engine, back)
            assert engine.agent.point_m == (start.x_m, start.z_m)
    assert num_moved > 8


def test_steps_end_on_the_grid_by_default() -> None:
    engine = engine_in(HOUSES[1])
    do(engine, "Teleport", rotation={"y": 37})
    if run(engine, "MoveAhead").is_success:
        assert (engine.agent.x_m * 4) % 1 == (engine.agent.z_m * 4) % 1 == 0
    start = engine.agent.point_m
    do(engine, "MoveBack", moveMagnitude=0.4)
    assert math.dist(start, engine.agent.point_m) == pytest.approx(math.hypot(0.25, 0.25))
    free = engine_in(HOUSES[1], snapToGrid=False)
    start = free.agent.point_m
    do(free, "MoveBack", moveMagnitude=0.1)
    assert math.dist(start, free.agent.point_m) == pytest.approx(0.1)
    assert "moveMagnitude must be > 0" in refused(free, "MoveAhead", moveMagnitude=0)


def test_a_blocked_move_names_the_blocking_object() -> None:
    engine = engine_in(HOUSES[0])
    for _ in range(200):
        before = engine.agent.point_m
        result = run(engine, "MoveAhead")
        if not result.is_success:
            break
    assert engine.agent.point_m == before
    name, _, rest = result.error_message.partition(" is blocking Agent 0 from moving by (0.2500, 0.0000, 0.0000).")
    assert not rest
    blocker = next(body for body in engine.scene.simulator.objects if body.id == name)
    gap_m = abs(blocker.centre_m[0] - before[0] - 0.25) - blocker.size_m[0] / 2
    assert gap_m < 0.2


def test_max_distance_to_object_limits_the_agent() -> None:
    engine = engine_in(HOUSES[1])
    body = next(body for body in engine.scene.simulator.objects if body.kind == "object")
    message = refused(engine, "MoveBack", objectId=body.id, maxAgentsDistance=0.01)
    assert message == f"Agent movement would bring it beyond the max distance of {body.id}"
    do(engine, "MoveBack", objectId=body.id, maxAgentsDistance=100)
    x_m, z_m = engine.agent.point_m
    half_x_m, half_z_m = body.size_m[0] / 2, body.size_m[2] / 2
    nearest = (
        min(max(x_m, body.centre_m[0] - half_x_m), body.centre_m[0] + half_x_m),
        min(max(z_m, body.centre_m[2] - half_z_m), body.centre_m[2] + half_z_m),
    )
    assert do(engine, "DistanceToObject", objectId=body.id) == pytest.approx(math.dist(nearest, (x_m, z_m)))
    assert refused(engine, "DistanceToObject", objectId="nothing") == "No object with ID nothing"


def test_turns() -> None:
    engine = engine_in(HOUSES[0], snapToGrid=False, rotateStepDegrees=30)
    do(engine, "Teleport", rotation={"x": 0, "y": 350, "z": 0})
    do(engine, "RotateRight")
    assert engine.agent.yaw_deg == 20.0
    do(engine, "RotateLeft", degrees=20.1)
    assert engine.agent.yaw_deg == 359.9
    assert "Cannot rotate by 0 degrees" in refused(engine, "RotateLeft", degrees=0)
    do(engine, "Rotate", rotation={"y": 45})
    assert engine.agent.yaw_deg == 45.0
    do(engine, "Rotate", rotation={"y": -1e-5})
    assert engine.agent.yaw_deg == 0.0


def test_the_camera_stops_at_its_limits() -> None:
    engine = engine_in(HOUSES[0])
    do(engine, "Teleport", horizon=0)
    do(engine, "LookDown")
    do(engine, "LookDown", degrees=30)
    assert engine.agent.horizon_deg == 60.0
    message = refused(engine, "LookDown", degrees=0.1)
    assert message == "can't look down beyond 60 degrees below the forward horizon"
    assert engine.last.error_code is ErrorCode.LOOK_DOWN_CANT_EXCEED_MIN
    for _ in range(3):
        do(engine, "LookUp")
    assert refused(engine, "LookUp") == "can't look up beyond 30 degrees above the forward horizon"
    for huge in (1e300, 1e308):
        assert refused(engine, "LookUp", degrees=huge) == "can't look up beyond 30 degrees above the forward horizon"
    refused(engine, "LookUp", degrees=0.1)
    assert "multiple of 0.1f" in refused(engine, "LookDown", degrees=0.15)
    assert "positive degree value" in refused(engine, "LookDown", degrees=-10)
    wide = engine_in(HOUSES[0], maxDownwardLookAngle=80, maxUpwardLookAngle=70)
    do(wide, "Teleport", horizon=80)
    do(wide, "Teleport", horizon=-70)


def test_crouching_lowers_the_camera() -> None:
    engine = engine_in(HOUSES[0])
    assert engine.agent.camera_height_m == 1.575
    assert refused(engine, "Stand") == "Already standing."
    do(engine, "Crouch")
    assert engine.agent.camera_height_m == pytest.approx(0.9)
    assert refused(engine, "Crouch") == "Already crouching."
    do(engine, "Teleport", standing=True)
    assert engine.agent.is_standing


@pytest.mark.parametrize("how", ["standing", "crouching", "lifted"])
def test_pictures_are_taken_from_the_cameras_height(how: str) -> None:
    house = HOUSES[0]
    engine = engine_in(house)
    height_m = 1.575
    if how == "crouching":
        do(engine, "Crouch")
        height_m -= 0.675
    elif how == "lifted":
        at = house["metadata"]["agent"]["position"] | {"y": 0.9009992 + 0.25}
        do(engine, "Teleport", position=at, forceAction=True)
        height_m += 0.25
    low = EmbeddedSimulator(SimulatorConfig(camera_height_m=height_m))
    low.reset(json.dumps(house))
    want, got = low.render(engine.agent.pose), engine.view(rgb=True, instances=True)
    assert engine.agent.camera.y_m == pytest.approx(height_m)
    assert np.abs(got.depth_m - want.depth_m)[np.isfinite(want.depth_m)].max() < 1e-3
    assert got.instances is not None
    assert want.instances is not None
    assert (got.instances != want.instances).mean() < 1e-3


def test_teleport_keeps_what_it_is_not_given() -> None:
    engine = engine_in(HOUSES[0])
    before = engine.agent.pose
    do(engine, "Teleport")
    assert engine.agent.pose == before
    do(engine, "Teleport", x=before.x_m, y=before.y_m, z=before.z_m)
    assert engine.agent.pose == before


def test_teleports_that_ai2thor_refuses() -> None:
    engine = engine_in(HOUSES[0])
    agent = HOUSES[0]["metadata"]["agent"]
    at = agent["position"]
    thing = HOUSES[0]["objects"][0]
    middle = {axis: round(thing["position"][axis] * 4) / 4 for axis in "xz"} | {"y": 0.9}
    for change, said in (
        ({"horizon": 61}, "Each horizon must be in [-30:60]. You gave 61."),
        ({"rotation": {"x": 5, "y": 0, "z": 0}}, "You gave (5.000000, 0.000000, 0.000000)."),
        ({"position": at | {"x": 500}}, "out of scene bounds! Ignore this by setting forceAction=true."),
        ({"position": at | {"x": at["x"] + 0.1}}, "is not on the grid of size 0.25."),
        ({"position": at | {"y": 2}}, "there was too large a change(1.099 > 0.05) in the y component."),
        ({"position": at | {"y": 0.5}}, "Collided with: Floor."),
        ({"position": middle}, "InvalidOperationException: Collided with: " + thing["id"]),
    ):
        assert said in refused(engine, "TeleportFull", **(agent | change))
        do(engine, "TeleportFull", **(agent | change), forceAction=True)
        do(engine, "TeleportFull", **agent)


def test_a_forced_teleport_keeps_its_height() -> None:
    engine = engine_in(HOUSES[0])
    do(engine, "Teleport", position=HOUSES[0]["metadata"]["agent"]["position"] | {"y": 2.0}, forceAction=True)
    assert engine.agent.y_m == 2.0
    assert engine.agent.camera_height_m == pytest.approx(2.0 + 0.674, abs=1e-3)


def test_missing_and_wrong_arguments_have_codes() -> None:
    engine = engine_in(HOUSES[0])
    agent = HOUSES[0]["metadata"]["agent"]
    for left_out in ("position", "rotation", "horizon", "standing"):
        refused(engine, "TeleportFull", **{key: value for key, value in agent.items() if key != left_out})
        assert engine.last.error_code is ErrorCode.MISSING_ARGUMENTS
        assert left_out in engine.last.error_message
    refused(engine, "Teleport", x=1.0)
    assert engine.last.error_code is ErrorCode.MISSING_ARGUMENTS
    refused(engine, "MoveAhead", moveMagnitude="far")
    assert engine.last.error_code is ErrorCode.INVALID_ARGUMENT
    refused(engine, "MoveAhead", moveMagnitde=0.5)
    assert engine.last.error_code is ErrorCode.INVALID_ARGUMENT
    do(engine, "MoveBack", forceAction=True, manualInteract=False, speed=2)
    refused(engine, "RotateLeft", speed="fast")
    assert engine.last.error_code is ErrorCode.INVALID_ARGUMENT
    refused(engine, "MoveRelative", z=1)
    assert engine.last.error_code is ErrorCode.INVALID_ACTION


def test_the_locobot_is_low_narrow_and_rolls() -> None:
    engine = engine_in(HOUSES[0], agentMode="locobot", applyActionNoise=False)
    config = engine.scene.simulator.config
    assert (config.agent_radius_m, config.agent_height_m, config.vertical_fov_deg) == (0.175, 0.9, 60.0)
    assert config.camera_height_m == engine.agent.camera_height_m == pytest.approx(0.8698, abs=1e-4)
    assert engine.agent.y_m == 0.9009992
    assert "horizontal movement" in refused(engine, "MoveLeft")
    start = engine.agent.point_m
    do(engine, "MoveBack")
    assert math.dist(start, engine.agent.point_m) == 0.25
    do(engine, "MoveRelative", z=1)
    assert engine.agent.point_m == start
    do(engine, "Teleport", horizon=0)
    do(engine, "LookDown")
    assert refused(engine, "LookDown") == "can't look down beyond 30 degrees below the forward horizon"
    assert refused(engine, "LookUp", degrees=10) == "Must have degrees == 0 for now."
    for name in ("TeleportFull", "Teleport"):
        refused(engine, name, **HOUSES[0]["metadata"]["agent"])
        assert engine.last.error_code is ErrorCode.INVALID_ARGUMENT
    refused(engine, "Crouch")
    assert engine.last.error_code is ErrorCode.INVALID_ACTION


def test_the_locobots_motion_is_noisy_and_repeats() -> None:
    def walk(seed: int | None = None) -> list[Pose]:
        engine = engine_in(HOUSES[0], agentMode="locobot", snapToGrid=False)
        if seed is not None:
            do(engine, "SetRandomSeed", seed=seed)
        poses = [engine.agent.pose]
        for name in ("MoveBack", "RotateLeft", "RotateRight") * 30:
            run(engine, name)
            poses.append(engine.agent.pose)
        return poses

    poses = walk()
    assert poses == walk()
    assert poses != walk(seed=1)
    assert walk(seed=1) == walk(seed=1)
    turns_deg = [math.degrees(b.yaw_rad - a.yaw_rad) for a, b in zip(poses[1::3], poses[2::3], strict=False)]
    errors_deg = [math.remainder(turn + 90, 360) for turn in turns_deg]
    assert 0.3 < np.std(errors_deg) < 0.7
    moved = [(a, b) for a, b in zip(poses[0::3], poses[1::3], strict=False) if a.position_m != b.position_m]
    assert 0.15 < np.std([math.degrees(math.remainder(b.yaw_rad - a.yaw_rad, math.tau)) for a, b in moved]) < 0.4
    assert 0.002 < np.std([math.dist(a.position_m, b.position_m) for a, b in moved]) < 0.01


def test_a_house_may_define_the_agents_start() -> None:
    pose = HOUSES[0]["metadata"]["agent"] | {"standing": False, "horizon": 15}
    engine = Engine()
    do(engine, "CreateHouse", house=HOUSES[0])
    assert engine.agent.point_m == (0.0, 0.0), "metadata.agent is for the caller to teleport to"
    do(engine, "CreateHouse", house=HOUSES[0] | {"metadata": {"agentPoses": {"default": pose}}})
    agent = engine.agent
    assert agent.point_m == (pose["position"]["x"], pose["position"]["z"])
    assert (agent.y_m, agent.yaw_deg, agent.horizon_deg, agent.is_standing) == (
        0.9009992,
        pose["rotation"]["y"],
        15.0,
        False,
    )


def test_a_house_with_a_broken_start_is_refused() -> None:
    engine = Engine()
    house = HOUSES[0] | {"metadata": {"agentPoses": {"default": {"position": "here"}}}}
    assert "metadata.agentPoses" in refused(engine, "CreateHouse", house=house)
    assert engine.scene.house is None


def test_some_actions_do_nothing() -> None:
    engine = engine_in(HOUSES[0])
    before = engine.agent.pose
    for name in ("Pass", "Done", "NoOp", "Stop"):
        do(engine, name)
    assert engine.agent.pose == before
