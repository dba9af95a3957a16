"""Angles survive the way to AI2-THOR's degrees and back, and turning never drifts."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evonav.house import bundled_houses
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose, canonical_horizon_rad, canonical_yaw_rad
from evonav.world.simulator import Action, SimulatorConfig

ANGLES = st.floats(-100.0, 100.0)


@given(ANGLES, ANGLES)
def test_canonical_angles_survive_conversion_to_degrees(yaw_rad: float, horizon_rad: float) -> None:
    pose = Pose(0.0, 0.0, 0.0, yaw_rad, horizon_rad).canonical()
    assert pose.canonical() == pose
    assert 0.0 <= pose.yaw_deg < 360.0
    assert 0.0 <= pose.yaw_rad < math.tau
    assert Pose.of_degrees(0.0, 0.0, 0.0, pose.yaw_deg, pose.horizon_deg) == pose
    assert abs(math.remainder(pose.yaw_rad - yaw_rad, math.tau)) < 1e-6
    assert abs(pose.horizon_rad - horizon_rad) < 1e-6


@given(st.integers(0, 3_599_999), st.integers(-900_000, 900_000))
def test_degrees_of_four_decimals_come_back(yaw: int, horizon: int) -> None:
    pose = Pose.of_degrees(1.0, 2.0, 3.0, yaw / 1e4, horizon / 1e4)
    assert (pose.yaw_deg, pose.horizon_deg) == (yaw / 1e4, horizon / 1e4)
    # Another turn more or less is the same pose.
    assert Pose.of_degrees(1.0, 2.0, 3.0, yaw / 1e4 - 720.0, horizon / 1e4) == pose


def test_edges_of_the_circle() -> None:
    assert canonical_yaw_rad(math.tau) == 0.0
    assert canonical_yaw_rad(-1e-9) == 0.0
    assert math.copysign(1.0, canonical_horizon_rad(-1e-9)) == 1.0
    assert canonical_yaw_rad(-math.pi / 2) == math.radians(270.0)
    assert math.isnan(canonical_yaw_rad(math.nan))
    assert not math.isfinite(canonical_yaw_rad(math.inf))


@pytest.mark.parametrize("action", [Action.TURN_LEFT, Action.TURN_RIGHT])
def test_turns_close_the_circle_to_the_bit(action: Action) -> None:
    simulator = EmbeddedSimulator(SimulatorConfig(width_px=32, height_px=32))
    start = simulator.reset(next(bundled_houses(1)).to_json())
    seen = set()
    for _ in range(24):
        assert simulator.step(action)
        seen.add(simulator.pose.yaw_deg)
    assert simulator.pose == start
    assert len(seen) == 24


def test_the_simulator_moves_and_renders_at_canonical_angles() -> None:
    simulator = EmbeddedSimulator(SimulatorConfig(width_px=32, height_px=32))
    start = simulator.reset(next(bundled_houses(1)).to_json())
    rough = Pose(start.x_m, start.y_m, start.z_m, 1.0 + 3e-7, 0.3 + 3e-7)
    exact = rough.canonical()
    assert exact != rough
    assert simulator.teleport(rough)
    assert simulator.pose == exact
    frame = simulator.render(rough)
    assert (frame.pose.yaw_rad, frame.pose.horizon_rad) == (exact.yaw_rad, exact.horizon_rad)
    np.testing.assert_array_equal(frame.depth_m, simulator.render(exact).depth_m)
    while not simulator.step(Action.MOVE_FORWARD):
        simulator.step(Action.TURN_LEFT)
    yaw_rad = simulator.pose.yaw_rad
    assert simulator.pose.x_m == start.x_m + simulator.config.move_m * math.sin(yaw_rad)
    assert simulator.pose.z_m == start.z_m + simulator.config.move_m * math.cos(yaw_rad)
