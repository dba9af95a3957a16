"""UniGoal's planner in the toy house: exploring, arriving, bumping, getting unstuck."""

import math
from dataclasses import replace

import numpy as np
import pytest
from cup_views import a_view
from toy_house import ToySimulator, house_json

from evonav.agents.unigoal.bev import BevConfig, BevMap
from evonav.agents.unigoal.planner import UniGoalPlanner
from evonav.world.pose import Pose
from evonav.world.simulator import Action

START = Pose(1.0, 0.9, 3.0, 0.0)


def look(simulator):
    frame = simulator.render(rgb=False, instances=False)
    return a_view(frame.depth_m, pose=frame.pose, intrinsics=frame.intrinsics)


def on_a_blank_map(seed=0):
    bev = BevMap((0.0, 0.0), 0, BevConfig(size_m=12.0))
    return bev, UniGoalPlanner(bev, seed)


class Walk:
    """Simulator, map and planner, a step at a time."""

    def __init__(self, moves=None, seed=0):
        self.simulator = ToySimulator(width_px=80, height_px=80)
        self.simulator.reset(house_json(moves), START)
        self.bev = BevMap((START.x_m, START.z_m), 0, BevConfig(size_m=24.0, stride_px=1))
        self.planner = UniGoalPlanner(self.bev, seed)
        self.planner.begin_stage()
        self.actions, self.num_bumps = [], 0

    @property
    def here(self):
        return (self.simulator.pose.x_m, self.simulator.pose.z_m)

    def step(self, goal, kind):
        """One step; `goal` "explore" asks for targets as an agent does."""
        self.planner.observe(self.simulator.pose, action=self.actions[-1] if self.actions else None)
        self.bev.integrate(look(self.simulator))
        if isinstance(goal, str):
            if self.planner.needs_target(self.simulator.pose):
                self.planner.exploration_target(self.simulator.pose)
            goal = self.planner.target_m
        step = self.planner.step(self.simulator.pose, goal, kind)
        self.actions.append(step.action)
        if step.action is not Action.STOP:
            self.num_bumps += not self.simulator.step(step.action)
        return step


def test_exploring_sees_both_rooms_without_bumping_much():
    walk = Walk()
    for _ in range(150):
        walk.step("explore", "exploration")
    free = walk.simulator.reachable_positions()
    cells = [walk.bev.cell_of((float(x), float(z))) for x, _, z in free]
    assert np.mean([walk.bev.core.explored[cell] for cell in cells]) > 0.95
    assert walk.num_bumps <= 6


def test_a_confirmed_goal_is_walked_up_to_and_stopped_at():
    walk = Walk()
    for _ in range(60):
        walk.step("explore", "exploration")
    bed = walk.bev.cell_of((5.8, 4.0))  # the near end of the bed, in the other room
    goal = np.array([bed], np.int32)
    for _ in range(120):
        step = walk.step(goal, "confirmed")
        if step.action is Action.STOP:
            break
    assert step.action is Action.STOP
    assert step.goal == "confirmed"
    # 0.5 m of the goal's own growth and 0.25 m to it.
    assert math.dist(walk.here, (5.8, 4.0)) < 0.5 + 0.25 + 0.1
    assert walk.num_bumps <= 6


def test_only_confirmed_goals_end_in_stop():
    walk = Walk()
    walk.step("explore", "exploration")
    near = np.array([walk.bev.cell_of((1.0, 3.3))], np.int32)
    assert walk.step(near, "confirmed").action is Action.STOP
    assert walk.step(near, "temporary").action is not Action.STOP
    assert walk.step((1.0, 3.3), "exploration").action is not Action.STOP


def test_a_goal_close_by_behind_something_is_as_near_as_it_gets():
    walk = Walk()
    for yaw in np.arange(24) * math.radians(15):
        walk.simulator.teleport(replace(START, x_m=3.3, z_m=1.0, yaw_rad=float(yaw)))
        walk.step("explore", "exploration")
    pose = replace(START, x_m=3.5, z_m=1.0)
    walk.planner.begin_stage()
    walk.planner.observe(pose)
    # Beyond the wall between the rooms: straight 0.4 m to the grown goal, the way leads through the doorway.
    goal = np.array([walk.bev.cell_of((4.4, 1.0))], np.int32)
    step = walk.planner.step(pose, goal, "confirmed")
    assert step.straight_m < 1.0
    assert step.distance_m is None or step.distance_m > 2.0 * step.straight_m
    assert step.action is Action.STOP
    # Further off, it is walked to.
    far = np.array([walk.bev.cell_of((5.2, 1.0))], np.int32)
    assert walk.planner.step(pose, far, "confirmed").action is not Action.STOP


@pytest.mark.parametrize(("bearing_deg", "action"), [(0, "MOVE_FORWARD"), (5, "MOVE_FORWARD"), (40, "TURN_RIGHT")])
def test_it_turns_towards_what_is_more_than_15_degrees_off(bearing_deg, action):
    for sign, expected in ((1, action), (-1, action.replace("RIGHT", "LEFT"))):
        _, planner = on_a_blank_map()
        pose = Pose(0.0, 0.9, 0.0, math.radians(100.0))
        yaw_rad = pose.yaw_rad + sign * math.radians(bearing_deg)
        planner.observe(pose)
        target_m = (4.0 * math.sin(yaw_rad), 4.0 * math.cos(yaw_rad))
        assert planner.step(pose, target_m, "exploration").action.value == expected


def bump(planner, pose, times):
    """Steps forward that get nowhere."""
    planner.observe(pose)
    for _ in range(times):
        planner.observe(pose, action=Action.MOVE_FORWARD)


def test_failed_moves_block_what_is_ahead_and_ever_more_of_it():
    bev, planner = on_a_blank_map()
    pose = Pose(0.025, 0.9, 0.025, 0.0)  # the middle of a cell
    widths = []
    for _ in range(3):
        planner.observe(pose, action=Action.TURN_LEFT)
        planner.observe(pose, action=Action.MOVE_FORWARD)
        rows, cols = np.nonzero(bev.core.collisions)
        widths.append((np.ptp(rows) + 1, np.ptp(cols) + 1))
        centres = np.array([bev.map_frame.centre_m(int(r), int(c)) for r, c in zip(rows, cols, strict=True)])
        assert centres[:, 1].min() > 0.1
    # Three cells across, then five, then four cells deep: and it is stuck.
    assert widths == [(2, 3), (2, 5), (4, 5)]
    assert planner.is_stuck
    assert planner.counters["collisions"] == 3
    # What it has bumped into is walked around from now on.
    ahead_m = (0.0, 3.0)
    step = planner.step(pose, np.array([bev.cell_of(ahead_m)], np.int32), "confirmed")
    assert step.distance_m is not None
    assert step.distance_m > 2.5 + 0.02
    assert abs(step.short_term_m[0]) > 0.1


def test_a_move_that_gets_on_is_no_collision():
    bev, planner = on_a_blank_map()
    for z_m in (0.0, 0.25, 0.5):
        planner.observe(Pose(0.0, 0.9, z_m, 0.0), action=Action.MOVE_FORWARD)
    assert not bev.core.collisions.any()
    rows = np.flatnonzero(bev.core.visited.any(axis=1))
    assert np.array_equal(rows, np.arange(rows[0], rows[0] + 11))
    planner.observe(Pose(0.0, 0.9, 0.6, 0.0), action=Action.MOVE_FORWARD)  # only 0.1 m on: a strip of width 1
    assert bev.core.collisions.sum() == 2


def test_moves_that_were_not_its_own_tell_nothing_of_obstacles():
    bev, planner = on_a_blank_map()
    for _ in range(4):
        planner.observe(START, action=None)
    assert not bev.core.collisions.any()
    assert not planner.is_stuck


def test_a_stuck_agent_heads_for_where_it_has_been_until_it_moves():
    bev, planner = on_a_blank_map(seed=3)
    bev.core.visit((0.0, 0.0), (0.0, -2.0))
    pose = Pose(0.0, 0.9, 0.0, 0.0)
    bump(planner, pose, 3)
    assert planner.is_stuck
    step = planner.step(pose, (0.0, 3.0), "exploration")
    assert step.goal == "stuck"
    assert step.action is not Action.MOVE_FORWARD  # what is behind it comes first
    again = planner.step(pose, (0.0, 3.0), "exploration")
    assert again.short_term_m == step.short_term_m
    # To the grown goal, which is farther than 0.8 m.
    assert 0.7 < step.distance_m <= 2.0
    assert step.short_term_m[1] < 0.0
    planner.observe(Pose(0.0, 0.9, -0.25, math.pi))
    assert not planner.is_stuck
    assert planner.step(Pose(0.0, 0.9, -0.25, math.pi), (0.0, 3.0), "exploration").goal == "exploration"


def test_a_loop_of_failed_moves_is_left():
    """A thin post that no camera height sees: only bumping tells of it."""
    walk = Walk()
    real_free = walk.simulator.is_free
    walk.simulator.is_free = lambda p: real_free(p) and math.dist((p[0], p[2]), (2.6, 2.9)) > 0.35
    for _ in range(12):
        walk.planner.observe(walk.simulator.pose)
        walk.bev.integrate(look(walk.simulator))
        walk.simulator.step(Action.TURN_RIGHT)
    goal = np.array([walk.bev.cell_of((3.6, 2.8))], np.int32)
    for _ in range(80):
        step = walk.step(goal, "confirmed")
        if step.action is Action.STOP:
            break
    assert step.action is Action.STOP
    assert 1 <= walk.num_bumps <= 12
    assert walk.bev.core.collisions.any()


@pytest.mark.parametrize("kind", ["exploration", "confirmed"])
def test_shut_in_by_its_own_bumps_it_feels_its_way_out(kind):
    walk = Walk()
    for yaw in np.arange(0.0, 2 * math.pi, 0.02):
        walk.bev.core.collide(walk.here, float(yaw), start=3, length=3, width=3)
    walk.bev.core.visit(walk.here, (3.0, 2.9))
    goal = np.array([walk.bev.cell_of((3.6, 2.8))], np.int32)
    start_m, real_step = walk.here, walk.simulator.step
    # Something keeps it from going anywhere but to the east.
    walk.simulator.step = lambda action: (
        (action is not Action.MOVE_FORWARD or math.sin(walk.simulator.pose.yaw_rad) > 0.9) and real_step(action)
    )
    for _ in range(60):
        walk.step(goal, kind)
        if walk.here != start_m:
            break
    assert walk.here[0] > start_m[0] + 0.2
    assert walk.num_bumps <= 25


class AsNearAsItGets:
    """A map on which the goal cannot be approached, and all that was visited is `to_visited_m` away."""

    def __init__(self, core):
        self.core, self.to_visited_m, self.destinations = core, 1.2, []

    def __getattr__(self, name):
        return getattr(self.core, name)

    def plan(self, here, goal, *, goal_radius, **_):
        if goal_radius != 1:  # not a place where the agent has been
            return None, 3.0, None
        self.destinations.append(goal.tolist())
        return self.to_visited_m, 1.0, (0.2, 0.0)


def test_without_a_way_it_goes_as_near_as_it_gets_and_from_there_to_where_it_has_been():
    bev, planner = on_a_blank_map()
    bev.core.visit((0.0, 0.0), (1.5, 0.0))
    # Bumps all around the goal, wider than its growth.
    for yaw in np.arange(0.0, 2 * math.pi, 0.02):
        bev.core.collide((-3.0, 0.0), float(yaw), start=20, length=3, width=3)
    goal = np.array([bev.cell_of((-3.0, 0.0))], np.int32)
    pose = Pose(0.0, 0.9, 0.0, -math.pi / 2)
    planner.observe(pose)
    assert planner.distance_m(pose, goal) is None
    step = planner.step(pose, goal, "confirmed")
    assert (step.goal, step.distance_m, step.short_term_m is None) == ("confirmed", None, False)
    assert planner.counters["unreachable"] == 1
    # Where it cannot get any nearer, it turns back to where it has been, and comes again from there.
    planned = bev.core = AsNearAsItGets(bev.core)
    back = planner.step(pose, goal, "temporary")
    assert (back.goal, back.distance_m) == ("stuck", 1.2)
    assert planner.step(pose, goal, "temporary").goal == "stuck"
    planned.to_visited_m = 0.2
    planner.step(pose, goal, "temporary")
    there, again, arrived = planned.destinations
    assert there == again == arrived
    planner.step(pose, goal, "temporary")
    assert planned.destinations[-1] != there  # it was reached: the next time it is another
    bev.core = planned.core
    planner.exploration_target(pose)
    planner.step(pose, (-3.0, 0.0), "exploration")
    assert planner.needs_target(pose)


def test_what_is_blacklisted_is_no_goal_until_the_next_stage():
    _, planner = on_a_blank_map()
    cells = np.array([[120, 120], [120, 123], [120, 124]], np.int32)
    planner.blacklist(cells[:1])
    assert planner.allowed(cells).tolist() == [[120, 124]]
    assert len(planner.allowed(cells[:0])) == 0
    planner.begin_stage()
    assert planner.allowed(cells).tolist() == cells.tolist()


def test_targets_are_chosen_anew_after_40_steps_or_half_a_metre_off():
    walk = Walk()
    walk.step("explore", "exploration")
    target_m = walk.planner.target_m
    assert target_m is not None
    assert math.dist(target_m, walk.here) >= 1.2 - 0.1
    assert not walk.planner.needs_target(walk.simulator.pose)
    assert walk.planner.needs_target(replace(START, x_m=target_m[0] + 0.4, z_m=target_m[1]))
    for _ in range(40):
        assert not walk.planner.needs_target(START)
        walk.planner.observe(START)
    assert walk.planner.needs_target(START)


def test_nowhere_to_go_is_a_turn_to_the_right():
    walk = Walk()
    step = walk.step(None, "exploration")
    assert (step.action, step.goal) == (Action.TURN_RIGHT, "none")
    assert walk.planner.distance_m(START, np.empty((0, 2), np.int32)) is None
    off = np.array([[-5, 3]], np.int32)
    assert walk.step(off, "confirmed").goal == "none"
