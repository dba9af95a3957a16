"""The embedded simulator keeps the simulator's contract, and the checker notices when one does not."""

import math
import pickle
import weakref
from collections import deque
from collections.abc import Callable
from copy import copy
from dataclasses import replace
from typing import Any, get_args

import numpy as np
import pytest

from evonav import _core
from evonav.errors import HouseError, InvalidArgumentError, SimulationError
from evonav.house import bundled_houses
from evonav.world.appearance import Materials
from evonav.world.check import check_simulator
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import Action, Frame, OccupancyGrid, SimulatorConfig, Style

HOUSES = [house.to_json() for house in bundled_houses(3)]
SMALL = SimulatorConfig(width_px=64, height_px=48)


@pytest.mark.parametrize("house_json", HOUSES)
def test_contract_holds(house_json: str) -> None:
    check_simulator(EmbeddedSimulator(), house_json)


def _frame(change: Callable[[Frame], dict[str, Any]]) -> type[EmbeddedSimulator]:
    class Broken(EmbeddedSimulator):
        def render(self, pose: Pose | None = None, *, rgb: bool = True, instances: bool = True) -> Frame:
            frame = super().render(pose, rgb=rgb, instances=instances)
            fields = {name: getattr(frame, name) for name in Frame.__slots__}
            return Frame(**(fields | change(frame)))

    return Broken


def _ranges(frame: Frame) -> dict[str, Any]:
    """Euclidean instead of planar depth."""
    rows, cols = np.indices(frame.depth_m.shape) + 0.5
    height, width = frame.depth_m.shape
    offsets = np.hypot(rows - height / 2, cols - width / 2) / frame.intrinsics.focal_px
    return {"depth_m": (frame.depth_m * np.sqrt(1 + offsets**2)).astype(np.float32)}


class MapsItsSurroundings(EmbeddedSimulator):
    def occupancy(self) -> OccupancyGrid:
        grid = super().occupancy()
        return OccupancyGrid(np.roll(grid.cells, 5, axis=0), grid.cell_m, grid.corner_m)


class TurnsLeft(EmbeddedSimulator):
    def step(self, action: Action) -> bool:
        swapped = {Action.TURN_LEFT: Action.TURN_RIGHT, Action.TURN_RIGHT: Action.TURN_LEFT}
        return super().step(swapped.get(action, action))


class WalksThroughWalls(EmbeddedSimulator):
    def step(self, action: Action) -> bool:
        pose = self.pose
        if not super().step(action):
            step_m = self.config.move_m
            self._pose = Pose(
                pose.x_m + step_m * math.sin(pose.yaw_rad),
                pose.y_m,
                pose.z_m + step_m * math.cos(pose.yaw_rad),
                pose.yaw_rad,
            )
        return True


class TeleportsAnywhere(EmbeddedSimulator):
    def teleport(self, pose: Pose) -> bool:
        self._pose = pose
        return True


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (_frame(lambda f: {"depth_m": f.depth_m.astype(np.float64)}), "depth_m is float64"),
        (_frame(lambda f: {"depth_m": f.depth_m[::-1].copy()}), "unproject outside the box"),
        (_frame(_ranges), "unproject outside the box"),
        (_frame(lambda f: {"instances": None if f.instances is None else f.instances + 1}), "instance ids are not all"),
        (_frame(lambda f: {"rgb": None}), "requested rgb"),
        (MapsItsSurroundings, "on blocked cells"),
        (TurnsLeft, "TURN_RIGHT turned by"),
        (WalksThroughWalls, "which is not free"),
        (TeleportsAnywhere, "teleport 100 m outside succeeded"),
    ],
)
def test_the_checker_finds_broken_contracts(broken: type[EmbeddedSimulator], message: str) -> None:
    with pytest.raises(SimulationError, match=message):
        check_simulator(broken(SMALL), HOUSES[0])


def test_pickle_carries_house_and_pose() -> None:
    simulator = EmbeddedSimulator(SMALL)
    simulator.reset(HOUSES[0])
    simulator.step(Action.TURN_RIGHT)
    copy = pickle.loads(pickle.dumps(simulator))
    assert copy.pose == simulator.pose
    assert copy.objects == simulator.objects
    np.testing.assert_array_equal(copy.render().rgb, simulator.render().rgb)


def test_pose_that_is_not_free_moves_to_the_nearest_reachable_position() -> None:
    simulator = EmbeddedSimulator(SMALL)
    start = simulator.reset(HOUSES[0])
    effective = simulator.reset(HOUSES[0], Pose(-50.0, 0.0, -50.0, yaw_rad=1.0))
    assert simulator.is_free(effective.position_m)
    assert effective.yaw_rad == pytest.approx(1.0, abs=1e-6)
    assert simulator.reset(HOUSES[0], start) == start


def test_the_last_house_is_not_loaded_again_and_is_itself_again_after_changes() -> None:
    simulator = EmbeddedSimulator(SMALL)
    start = simulator.reset(HOUSES[0])
    core, view, objects, cells = simulator.core, simulator.render(), simulator.objects, simulator.occupancy().cells
    simulator.set_appearance([Materials(seed=1)])
    target = next(body for body in objects if body.kind == "object")
    x_m, y_m, z_m = target.centre_m
    move = {"id": target.id, "position_m": [x_m + 1.0, y_m, z_m], "rotation_deg": [0.0, 0.0, 0.0], "parent": None}
    simulator.apply({"moves": [move]})
    assert (simulator.occupancy().cells != cells).any()
    assert simulator.reset(HOUSES[0]) == start
    assert simulator.core is core
    assert simulator.objects == objects
    np.testing.assert_array_equal(simulator.render().rgb, view.rgb)
    np.testing.assert_array_equal(simulator.occupancy().cells, cells)
    simulator.reset(HOUSES[1])
    assert simulator.objects != objects
    with pytest.raises(HouseError, match=r"again.json"):
        simulator.reset("{}", name="again.json")
    simulator.reset(HOUSES[0])
    assert simulator.core is core


def test_simulators_share_a_house_as_long_as_one_of_them_has_it() -> None:
    first, second, other = (
        EmbeddedSimulator(SMALL),
        EmbeddedSimulator(SMALL),
        EmbeddedSimulator(replace(SMALL, width_px=90)),
    )
    for simulator in (first, second, other):
        simulator.reset(HOUSES[0])
    assert first.core is second.core is not other.core
    assert EmbeddedSimulator(SMALL, allow_unknown_assets=True).reset(HOUSES[0]) == first.pose
    second.set_appearance([Materials(seed=1)])
    assert first.core is not second.core
    house = weakref.ref(first.core)
    first.close()
    assert house() is not None
    second.close()
    assert house() is None


def test_a_simulator_keeps_the_houses_that_it_loaded_last() -> None:
    simulator = EmbeddedSimulator(SMALL, recent=deque(maxlen=2))
    cores, grids, objects = [], [], []
    for house in (*HOUSES[:2], *HOUSES[:2]):
        simulator.reset(house)
        cores.append(weakref.ref(simulator.core))
        grids.append(simulator.occupancy())
        objects.append(simulator.objects)
    assert cores[:2] == cores[2:]
    assert grids[0] is grids[2] is not grids[1] is grids[3]
    assert objects[0] is objects[2] is not objects[1] is objects[3]
    copy(simulator).close()
    assert all(core() is not None for core in cores)
    simulator.reset(HOUSES[2])
    assert [core() is None for core in cores[:2]] == [True, False]


def test_styles_differ_in_colours_alone() -> None:
    views = {}
    for style in get_args(Style):
        simulator = EmbeddedSimulator(replace(SMALL, style=style))
        simulator.reset(HOUSES[0])
        views[style] = simulator.render()
    for style, view in views.items():
        np.testing.assert_array_equal(view.depth_m, views["plain"].depth_m)
        np.testing.assert_array_equal(view.instances, views["plain"].instances)
        assert (view.rgb != views["plain"].rgb).any() == (style != "plain")
    with pytest.raises(InvalidArgumentError, match=r"style.*\"ink\".*plain, default"):
        EmbeddedSimulator(SimulatorConfig(style="ink")).reset(HOUSES[0])  # type: ignore[arg-type]


def test_errors_are_typed() -> None:
    simulator = EmbeddedSimulator(SMALL)
    with pytest.raises(SimulationError, match="call reset first"):
        simulator.render()
    with pytest.raises(HouseError, match="kitchen"):
        simulator.reset("{}", name="kitchen.json")
    simulator.reset(HOUSES[0])
    with pytest.raises(InvalidArgumentError, match="position_m"):
        simulator.render(Pose(math.nan, 0.0, 0.0, 0.0))
    assert not simulator.teleport(Pose(math.nan, 0.0, 0.0, 0.0))
    with pytest.raises(InvalidArgumentError, match="delta"):
        simulator.apply("{")
    with pytest.raises(InvalidArgumentError, match="width_px"):
        EmbeddedSimulator(SimulatorConfig(width_px=0)).reset(HOUSES[0])


def test_moving_an_object_equals_loading_the_changed_house() -> None:
    simulator = EmbeddedSimulator(SMALL)
    simulator.reset(HOUSES[0])
    target = next(o for o in simulator.objects if o.kind == "object")
    x_m, y_m, z_m = target.centre_m
    move = {"id": target.id, "position_m": [x_m + 0.1, y_m, z_m], "rotation_deg": [0.0, 90.0, 0.0], "parent": None}
    pose = simulator.apply({"moves": [move]})
    fresh = EmbeddedSimulator(SMALL)
    fresh.reset(simulator.house_json, pose)
    assert fresh.objects == simulator.objects
    assert any(o.id == target.id and o.centre_m != target.centre_m for o in simulator.objects)
    for yaw_rad in np.arange(0.0, 6.2, 0.7):
        view = Pose(pose.x_m, pose.y_m, pose.z_m, float(yaw_rad))
        np.testing.assert_array_equal(simulator.render(view).rgb, fresh.render(view).rgb)
    np.testing.assert_array_equal(simulator.occupancy().cells, fresh.occupancy().cells)
    np.testing.assert_array_equal(simulator.reachable_positions(), fresh.reachable_positions())


def test_path_lengths_are_those_of_the_paths() -> None:
    simulator = EmbeddedSimulator(SMALL)
    start = simulator.reset(HOUSES[1]).position_m
    targets_m = simulator.reachable_positions()[::97]
    lengths_m = simulator.path_lengths_m(start, targets_m)
    for target_m, length_m in zip(targets_m, lengths_m, strict=True):
        path_m = simulator.shortest_path(start, (target_m[0], target_m[1], target_m[2]))
        assert np.linalg.norm(np.diff(path_m, axis=0), axis=1).sum() == pytest.approx(length_m)


def test_sight_is_blocked_by_walls_and_not_by_the_object_looked_at() -> None:
    # An odd number of pixels, so that the middle one's centre is on the optical axis.
    simulator = EmbeddedSimulator(SimulatorConfig(width_px=65, height_px=49))
    simulator.reset(HOUSES[0])
    frame = simulator.render(rgb=False)
    assert frame.instances is not None
    row, col = 24, 32
    instance = int(frame.instances[row, col])
    forward_m = np.array(
        [
            math.sin(frame.pose.yaw_rad) * math.cos(frame.pose.horizon_rad),
            -math.sin(frame.pose.horizon_rad),
            math.cos(frame.pose.yaw_rad) * math.cos(frame.pose.horizon_rad),
        ]
    )
    behind = frame.pose.position_m + forward_m * (float(frame.depth_m[row, col]) + 0.002)
    point_m = (float(behind[0]), float(behind[1]), float(behind[2]))
    assert not simulator.is_visible(frame.pose.position_m, point_m)
    assert simulator.is_visible(frame.pose.position_m, point_m, [instance])


@pytest.mark.parametrize("house_json", HOUSES)
def test_occupancy_needs_only_teleport_and_reachable_positions(house_json: str) -> None:
    cell_m = SMALL.occupancy_cell_m
    simulator = EmbeddedSimulator(replace(SMALL, grid_m=cell_m))
    start = simulator.reset(house_json)
    (num_rows, num_cols), corner_m = _core.map_spec(house_json, name="house", cell_m=cell_m)
    cells = np.ones((num_rows, num_cols), np.uint8)
    rows, cols = np.indices(cells.shape) + 0.5
    centres_m = np.stack([corner_m[0] + cols * cell_m, corner_m[1] + rows * cell_m], axis=-1).reshape(-1, 2)
    offsets_m = np.hypot(*(centres_m - [start.x_m, start.z_m]).T)
    nearest = np.argsort(offsets_m, kind="stable")
    assert any(simulator.teleport(Pose(x_m, 0.0, z_m, 0.0)) for x_m, z_m in centres_m[nearest].tolist())
    reached = (simulator.reachable_positions()[:, [0, 2]] - corner_m) // cell_m
    cells[reached[:, 1].astype(int), reached[:, 0].astype(int)] = 0
    grid = simulator.occupancy()
    np.testing.assert_array_equal(grid.cells, cells)
    assert grid.corner_m == corner_m
