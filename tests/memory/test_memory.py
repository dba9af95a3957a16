"""The agent's memory through its Python interface."""

import math
from dataclasses import replace

import numpy as np
import pytest
from cup_views import INTRINSICS, a_cup
from numpy.typing import NDArray
from walked_house import walked

import evonav
from evonav.errors import InvalidArgumentError
from evonav.memory import FrontierConfig, ObjectMap, ObjectMapConfig, OccupancyMap
from evonav.perception.ground_truth import DETECTED_KINDS
from evonav.sensors.observation import MapFrame, VisibleOccupancy
from evonav.sensors.visibility import visible_occupancy
from evonav.world.pose import Pose
from evonav.world.simulator import OccupancyGrid

FRAME = MapFrame(40, 60, 0.1, (-1.0, 2.0))


def cells(*pairs: tuple[int, int]) -> NDArray[np.int32]:
    return np.array(pairs, np.int32).reshape(-1, 2)


def seen(free: NDArray[np.int32], blocked: NDArray[np.int32]) -> VisibleOccupancy:
    return VisibleOccupancy(free=free, blocked=blocked)


def test_conflicts_go_both_ways_and_the_last_observation_counts() -> None:
    memory = OccupancyMap(FRAME)
    assert len(memory.integrate(seen(cells((3, 4), (3, 5)), cells((3, 6))), (-0.6, 2.3))) == 0
    again = seen(cells((3, 6)), cells((3, 5), (9, 9)))
    assert memory.conflicts(again).freed.tolist() == [[3, 6]]
    conflicts = memory.integrate(again, (-0.6, 2.3))
    assert len(conflicts) == 2
    assert conflicts.obstructed.tolist() == [[3, 5]]
    assert memory.cells[3, 4:7].tolist() == [1, 2, 1]
    assert memory.explored[3, 4]
    assert not memory.explored[39, 59]
    memory.clear()
    assert not memory.cells.any()
    assert not memory.explored.any()


def test_assumed_cells_cause_no_conflict() -> None:
    memory = OccupancyMap(FRAME)
    memory.assume_free((0.0, 3.0), 0.3)
    assert memory.cells[10, 10] == 1
    assert memory.explored[10, 10]
    assert len(memory.integrate(seen(cells(), cells((10, 10))), (0.0, 3.0))) == 0
    assert memory.cells[10, 10] == 2
    memory.forget(cells((10, 10)))
    assert memory.cells[10, 10] == 0


def test_ways_go_around_walls_over_free_cells() -> None:
    memory = OccupancyMap(FRAME)
    rows, cols = np.mgrid[0:9, 0:9].reshape(2, -1).astype(np.int32)
    is_wall = (cols == 4) & (rows > 0)
    floor = np.stack([rows, cols], 1)
    memory.integrate(seen(floor[~is_wall], floor[is_wall]), (0.0, 2.0))
    left, right, unknown = (-0.65, 2.85), (-0.45, 2.85), (2.0, 5.0)
    ways_m = memory.distances_m(left, np.array([left, right, unknown]))
    assert ways_m.tolist() == [0.0, pytest.approx(1.8, abs=1e-5), math.inf]
    with pytest.raises(InvalidArgumentError, match="start_m"):
        memory.distances_m((math.nan, 0.0), np.zeros((1, 2)))
    with pytest.raises(InvalidArgumentError, match="targets_m"):
        memory.distances_m(left, np.zeros((1, 3)))


def test_exploring_by_frontiers_sees_every_room() -> None:
    blocked = np.zeros((40, 60), np.uint8)
    blocked[[0, -1]] = blocked[:, [0, -1]] = 1
    blocked[:, 25], blocked[20, 25:] = 1, 1
    blocked[5:11, 25], blocked[20, 45:51] = 0, 0
    grid = OccupancyGrid(blocked, FRAME.cell_m, FRAME.corner_m)
    memory = OccupancyMap(FRAME)
    place, ids = (-0.5, 5.5), []
    for _ in range(30):
        for quarter in range(4):
            look = visible_occupancy(grid, Pose(place[0], 0, place[1], quarter * math.pi / 2), INTRINSICS, 3.0)
            assert len(memory.integrate(look, place)) == 0
        frontiers = memory.update_frontiers(place)
        assert [f.id for f in frontiers] == sorted(f.id for f in memory.frontiers)
        if not frontiers:
            break
        place = frontiers[0].position_m
        ids.append(frontiers[0].id)
    assert (memory.cells[blocked == 0] == 1).all()
    assert memory.update_frontiers(place) == []
    assert ids == sorted(ids)


def test_a_wall_hides_what_lies_behind_it_and_the_view_ends_with_range_and_angle() -> None:
    blocked = np.zeros((40, 60), np.uint8)
    blocked[30] = 1
    grid = OccupancyGrid(blocked, FRAME.cell_m, FRAME.corner_m)
    look = visible_occupancy(grid, Pose(2.05, 0, 4.05, 0.0), INTRINSICS, 2.0)
    assert set(look.blocked[:, 0].tolist()) == {30}
    assert look.free[:, 0].min() == 20
    assert look.free[:, 0].max() == 29
    assert (np.abs(look.free[:, 1] - 30) <= look.free[:, 0] - 19).all()
    east = visible_occupancy(grid, Pose(2.05, 0, 4.05, math.pi / 2), INTRINSICS, 1.0)
    assert len(east.blocked) == 0
    assert east.free[:, 1].max() == 30 + 10


def test_a_stale_entry_is_distinguished_from_a_valid_one() -> None:
    entries = ObjectMap()
    here, moved = a_cup("Mug"), a_cup("Mug", col=35)
    assert entries.update(here).entry_ids == (1,)
    assert entries.update(here).entry_ids == (1,)
    entries.begin_stage(2)
    assert entries.update(moved).entry_ids == (2,)
    same, other = entries.compare(1, here), entries.compare(1, moved)
    assert (same.overlap[0], same.distance_m[0]) == (pytest.approx(1.0), pytest.approx(0.0, abs=0.05))
    assert other.overlap[0] == 0.0
    assert other.distance_m[0] > 0.5
    entry = entries.entries[0]
    assert (entry.label, entry.label_counts, entry.num_detections) == ("Mug", [("Mug", 2)], 2)
    assert (entry.first_seen_stage, entry.last_seen_stage, entry.last_seen_view) == (1, 1, 2)
    points_m = entries.points_m(1)
    assert points_m is not None
    assert points_m.shape == (entry.num_points, 3)
    low, high = points_m.min(0), points_m.max(0)
    np.testing.assert_allclose(entry.centre_m, (low + high) / 2, atol=1e-6)
    np.testing.assert_allclose(entry.size_m, high - low, atol=1e-6)
    assert entry.centre_m[1] == pytest.approx(here.pose.y_m, abs=0.1)
    assert entries.remove(1)
    assert entries.entry(1) is None
    assert len(entries) == 1
    with pytest.raises(InvalidArgumentError, match="entry_id"):
        entries.compare(1, here)


def test_an_entry_is_the_same_object_until_it_changes() -> None:
    entries = ObjectMap()
    here, moved = a_cup("Mug"), a_cup("Mug", col=35)
    entries.update(here)
    entries.update(moved)
    first, second = entries.entries
    assert [entries.entry(1), entries.entry(2)] == [first, second]
    entries.update(moved)
    assert entries.entries[0] is first
    seen_again = entries.entry(2)
    assert seen_again is not None
    assert (second.num_detections, seen_again.num_detections) == (1, 2)
    depth_m = np.minimum(here.depth_m, moved.depth_m)
    depth_m[:30, :30] = 9.0
    assert [one.entry_id for one in entries.remove_seen_through(replace(here, depth_m=depth_m))] == [1]
    left = entries.entry(1)
    assert left is not None
    assert left.num_points < first.num_points


def test_a_map_that_was_cleared_returns_no_entry_of_before() -> None:
    entries, here = ObjectMap(), a_cup("Mug")
    entries.update(here)
    (before,) = entries.entries
    entries.clear()
    entries.update(replace(here, pose=replace(here.pose, x_m=here.pose.x_m + 1.0)))
    (after,) = entries.entries
    assert (after.id, after.num_detections, after.num_points) == (before.id, before.num_detections, before.num_points)
    assert after.centre_m[0] == pytest.approx(before.centre_m[0] + 1.0)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("depth_m", np.full((60, 60), np.nan, np.float32)),
        ("depth_m", np.ones((30, 120), np.float32)),
        ("depth_m", np.ones((60, 60), np.float32).T[::-1]),
        ("depth_m", np.ones((60, 60))),
        ("depth_m", np.ones(60, np.float32)),
        ("masks", np.full((60, 60), 5, np.int32)),
        ("masks", np.full((60, 60), -1, np.int64)),
        ("confidences", np.ones(3, np.float32)),
        ("confidences", np.full(1, np.nan, np.float32)),
        ("features", np.ones((3, 4), np.float32)),
        ("features", np.full((1, 4), np.inf, np.float32)),
    ],
)
def test_arrays_that_do_not_fit_are_named(name: str, value: NDArray[np.generic]) -> None:
    entries, view = ObjectMap(), a_cup("Mug")
    is_depth = name == "depth_m"
    wrong = replace(view, **({name: value} if is_depth else {"detections": replace(view.detections, **{name: value})}))
    with pytest.raises((InvalidArgumentError, TypeError), match=name):
        entries.update(wrong)
    assert entries.num_views == 0


def test_cells_and_parameters_that_do_not_fit_are_named() -> None:
    memory = OccupancyMap(FRAME)
    with pytest.raises(InvalidArgumentError, match="`free`"):
        memory.integrate(seen(cells((40, 0)), cells()), (0.0, 0.0))
    with pytest.raises(InvalidArgumentError, match="`blocked`"):
        memory.integrate(seen(cells(), np.zeros((2, 3), np.int32)), (0.0, 0.0))
    with pytest.raises(InvalidArgumentError, match="`agent_m`"):
        memory.update_frontiers((math.nan, 0.0))
    with pytest.raises(InvalidArgumentError, match="`max_span_rad`"):
        OccupancyMap(FRAME, FrontierConfig(max_span_deg=0.0))
    with pytest.raises(InvalidArgumentError, match="`voxel_m`"):
        ObjectMap(ObjectMapConfig(voxel_m=math.inf))
    grid = OccupancyGrid(np.zeros((4, 4), np.uint8), 0.1, (0.0, 0.0))
    with pytest.raises(InvalidArgumentError, match="`origin_m`"):
        visible_occupancy(grid, Pose(9, 0, 9, 0), INTRINSICS, 3.0)
    with pytest.raises(InvalidArgumentError, match="`range_m`"):
        visible_occupancy(grid, Pose(0.1, 0, 0.1, 0), INTRINSICS, math.nan)


@pytest.mark.parametrize("index", [3, 7])
def test_the_maps_of_a_whole_house_are_true(index: int) -> None:
    simulator = evonav.Simulator(evonav.load_houses()[index])
    cells_of, entries = OccupancyMap(simulator.map_frame), ObjectMap()
    num_conflicts = 0
    for view in walked(simulator, 40):
        num_conflicts += len(cells_of.update(view))
        entries.update(view)
    assert num_conflicts == 0, "the house did not change"
    grid, known = simulator.embedded.occupancy(), cells_of.cells
    places_m = simulator.embedded.reachable_positions()[:, [0, 2]]
    cols, rows = np.floor((places_m - grid.corner_m) / grid.cell_m).astype(int).T
    assert (known[rows, cols] != 0).mean() > 0.9
    assert (grid.cells[known == 1] == 0).all()
    assert (grid.cells[known == 2] == 1).all()
    objects = [body for body in simulator.embedded.objects if body.kind in DETECTED_KINDS]
    near = [
        any(body.category == entry.label and math.dist(body.centre_m, entry.centre_m) < 0.8 for body in objects)
        for entry in entries.entries
    ]
    assert len(near) > 0.4 * len(objects)
    assert np.mean(near) > 0.9
