"""Motion and the floor plan: waypoints on any path, views on any schedule, rooms and footprints from above."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from toy_house import ToySimulator, episode_spec

from evonav.agents.agent import NavigateTo, SensorConfig, ViewSchedule
from evonav.agents.viewpoint import observation_point
from evonav.errors import InvalidArgumentError
from evonav.evaluation.episode.motion import Planner, length_outside_m, navigate, polyline_length_m, waypoints
from evonav.evaluation.episode.sensors import view_yaws_rad
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.run.components import load_spec
from evonav.sensors.observation import MapFrame
from evonav.tasks.listing import BUNDLED_TASKS
from evonav.world.pose import Pose
from evonav.world.simulator import OccupancyGrid

POINTS = st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=6)


@given(POINTS, st.floats(0.05, 2.0), st.floats(0.1, 20.0))
def test_waypoints_follow_the_path(corners, spacing_m, max_travel_m):
    points, is_end = waypoints(corners, spacing_m, max_travel_m)
    path = [corners[0], *points]
    whole_m = polyline_length_m(corners)
    assert polyline_length_m(path) == pytest.approx(min(whole_m, max_travel_m), abs=1e-6)
    assert all(math.dist(a, b) <= spacing_m + 1e-6 for a, b in pairwise(path))
    if is_end:
        assert path[-1] == corners[-1]
        assert whole_m <= max_travel_m + 1e-6
    passed = [corner for corner in corners if corner in path]
    assert passed[:1] == corners[:1]


@given(st.integers(1, 7), st.floats(10.0, 90.0), st.floats(-math.pi, math.pi))
def test_views_are_evenly_spaced_and_the_heading_is_last(count, spacing_deg, heading_rad):
    yaws = view_yaws_rad(ViewSchedule(count, spacing_deg), heading_rad)
    assert len(yaws) == count
    steps = np.diff(np.sort(yaws))
    assert steps == pytest.approx(math.radians(spacing_deg))
    if count % 2:
        assert yaws[-1] == pytest.approx(heading_rad)
        assert sum(yaws) / count == pytest.approx(heading_rad)


def test_navigation_stops_after_a_metre_and_turns_on_arrival():
    simulator = ToySimulator()
    case = episode_spec("toy-static")
    simulator.reset(case.stages[0].house_json, case.start)
    planner = Planner(simulator)
    action = NavigateTo((2.5, 4.0), face_m=(2.5, 5.0))
    first = navigate(simulator, planner, action, spacing_m=0.25, max_travel_m=1.0)
    assert first.length_m == pytest.approx(1.0)
    assert not first.has_arrived
    second = navigate(simulator, planner, action, spacing_m=0.25, max_travel_m=1.0)
    assert second.has_arrived
    assert (simulator.pose.x_m, simulator.pose.z_m) == pytest.approx((2.5, 4.0), abs=0.1)
    assert simulator.pose.yaw_rad == pytest.approx(0.0, abs=0.2)


def test_the_protocol_caps_what_an_agent_may_sense():
    ProtocolConfig().check(SensorConfig())
    for sensors in (
        SensorConfig(first_round=ViewSchedule(8, 40.0)),
        SensorConfig(later_rounds=ViewSchedule(0, 40.0)),
        SensorConfig(max_travel_m=1.5),
        SensorConfig(max_travel_m=float("nan")),
        SensorConfig(occupancy_range_m=3.5),
    ):
        with pytest.raises(InvalidArgumentError):
            ProtocolConfig().check(sensors)


def test_the_floor_plan_holds_rooms_walls_and_footprints():
    spec = episode_spec("toy-static")
    house = spec.parsed_house(1)
    assert [house.room_of(x_m, 1.0) for x_m in (1.0, 7.0, 9.0)] == ["room|1", "room|2", None]
    plan = spec.floor_plan(1)
    assert [room.room_id for room in plan.rooms] == ["room|1", "room|2"]
    assert len(plan.walls) == 6
    assert len(plan.objects) == len(house.objects)


def test_footprints_are_the_outlines_of_the_parts_to_the_millimetre():
    spec = load_spec(min(path.parent for path in BUNDLED_TASKS.glob("*/task.json")))
    plan = {item.object_id: item for item in spec.floor_plan(1).objects}
    for object_id, _, parts in spec.parsed_house(1).footprints(allow_unknown_assets=True):
        outlines = {tuple((round(x, 3), round(z, 3)) for x, z in outline) for outline, _, _ in parts}
        assert set(plan[object_id].outlines_m) == outlines
        points = np.array([point for outline, _, _ in parts for point in outline])
        assert np.ptp(points, axis=0) == pytest.approx([plan[object_id].size_m[0], plan[object_id].size_m[2]])


FRAME = MapFrame(rows=60, cols=60, cell_m=0.1, corner_m=(-1.0, -1.0))


def test_the_observation_point_lies_where_most_floor_is():
    free = np.zeros((60, 60), dtype=bool)
    free[:, 25:] = True  # everything at x >= 1.5
    free[5:8, 5:8] = True  # and a small pocket
    point = observation_point(free, FRAME, (1.0, 2.0))
    assert point == pytest.approx((2.45, 2.0), abs=0.1)
    assert observation_point(free, FRAME, (-0.9, 4.9)) is None


@given(st.integers(0, 2**32 - 1), st.floats(-1.5, 5.5), st.floats(-1.5, 5.5))
def test_the_observation_point_is_free(seed, x_m, z_m):
    free = np.random.default_rng(seed).random((60, 60)) < 0.3
    point = observation_point(free, FRAME, (x_m, z_m))
    if point is None:
        rows, cols = np.nonzero(free)
        assert np.hypot((cols + 0.5) * 0.1 - 1.0 - x_m, (rows + 0.5) * 0.1 - 1.0 - z_m).min() > 1.5 - 1e-9
    else:
        assert free[math.floor((point[1] + 1.0) / 0.1), math.floor((point[0] + 1.0) / 0.1)]
        assert math.dist(point, (x_m, z_m)) < 1.9


def test_a_pose_that_is_taken_is_snapped_and_recorded():
    from evonav.evaluation.episode.episode import Episode
    from evonav.evaluation.episode.spec import EpisodeSpec
    from evonav.evaluation.run.components import make_agent
    from evonav.perception.ground_truth import GroundTruthPerception

    case = episode_spec("toy-static")
    inside_table = EpisodeSpec("t", "toy", Pose(2.0, 0.9, 1.2, 1.25), case.stages)
    episode = Episode(
        inside_table, "a", make_agent("random-walk"), ToySimulator(), GroundTruthPerception(), ProtocolConfig(), 0
    )
    record = next(iter(episode.run())).record
    assert record.is_snapped
    assert (record.requested_start.x_m, record.requested_start.z_m) == (2.0, 1.2)
    assert record.effective_start != record.requested_start
    assert record.effective_start.yaw_rad == 1.25
    assert record.trace[0].pose == record.effective_start


class Gap:
    """A simulator whose steps end at a gap that its paths lead through; the target itself stands in a pocket."""

    TARGET = (5.0, 0.9, 0.5)

    def __init__(self, is_cut_off=False, steps_reach_m=1.0):
        self.pose = Pose(0.5, 0.9, 0.5, 0.0)
        self.is_cut_off = is_cut_off
        self.steps_reach_m = steps_reach_m
        self.num_asked = 0

    def shortest_path(self, start, target):
        self.num_asked += 1
        is_step = target[0] <= self.steps_reach_m
        if target == self.TARGET or (self.is_cut_off and not is_step):
            return np.empty((0, 3))
        return np.array([start, target])

    def reachable_positions(self):
        return np.array([[0.5, 0.9, 0.5], [self.steps_reach_m, 0.9, 0.5]])

    def occupancy(self):
        cells = np.zeros((1, 10), dtype=np.uint8)
        cells[0, 9] = 1
        return OccupancyGrid(cells=cells, cell_m=0.5, corner_m=(0.0, 0.25))


@pytest.mark.parametrize(
    ("simulator", "end_m"),
    [
        (Gap(), (4.25, 0.5)),  # the free cell nearest to the target
        (Gap(steps_reach_m=3.75), (3.75, 0.5)),  # steps reach near enough: as ever
        (Gap(is_cut_off=True), (1.0, 0.5)),  # no path anywhere: what steps reach
    ],
)
def test_a_target_in_a_pocket_is_approached_through_gaps_that_steps_do_not_pass(simulator, end_m):
    assert Planner(simulator).path_m((5.0, 0.5))[-1] == pytest.approx(end_m)
    assert simulator.num_asked <= 20


def test_the_way_to_a_radius_ends_where_the_path_first_enters_it():
    corners = [(0.0, 0.0), (4.0, 0.0), (4.0, 5.0)]
    assert length_outside_m(corners, (4.0, 5.0), 2.0) == pytest.approx(7.0)
    assert length_outside_m(corners, (3.0, 1.0), 1.0) == pytest.approx(3.0)  # touched on the way, at (3, 0)
    assert length_outside_m(corners, (4.0, 9.0), 2.0) == pytest.approx(9.0)  # never reached
    assert length_outside_m(corners, (0.5, 0.0), 2.0) == 0.0
    assert length_outside_m([(0.0, 0.0)], (5.0, 0.0), 2.0) == 0.0
    assert length_outside_m([], (5.0, 0.0), 2.0) == 0.0
