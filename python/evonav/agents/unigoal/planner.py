"""UniGoal's movement: exploration targets, paths by fast marching, single actions, and ways to get unstuck.

The planner has no goal of its own but the one to get unstuck; the agent decides which goal counts.
"""

import math
import random
from collections import Counter
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from evonav.agents.unigoal.bev import BevMap, Cells
from evonav.points import Point2
from evonav.world.pose import Pose
from evonav.world.simulator import Action

GoalKind = Literal["confirmed", "temporary", "exploration"]


@dataclass(frozen=True, slots=True)
class PlannerConfig:
    """UniGoal's constants."""

    object_radius: int = 10
    """Cells by which confirmed and temporary goals are grown."""
    exploration_radius: int = 3
    """The same for exploration targets."""
    stuck_radius: int = 1
    """The same for the goal to get unstuck."""
    blacklist_radius: int = 3
    """Cells by which a rejected goal is grown."""
    obstacle_radius: int = 3
    """Cells by which obstacles are grown for paths."""
    margin_m: float = 1.0
    """Paths may leave the known part of the map by this much."""
    circle: int = 5
    """Radius in cells of the circle that short-term goals lie on ..."""
    small_circle: int = 2
    """... and of the one that is tried where the first has none."""
    turn_deg: float = 15.0
    """A larger error of bearing is turned away."""
    stop_m: float = 0.25
    """A confirmed goal nearer than this is reached."""
    detour_straight_m: float = 1.0
    """A confirmed goal nearer than this as the crow flies ..."""
    detour_ratio: float = 2.0
    """... whose way is longer than this many times that is reached too: it is behind something."""
    frontier_obstacle_radius: int = 4
    """Cells by which obstacles are grown before frontiers are sought."""
    min_frontier_cells: int = 20
    """Fewest cells of a frontier (8-connected)."""
    min_frontier_m: float = 1.2
    """Nearer frontiers do not count."""
    frontier_span_m: float = 10.0
    """Ways longer than `min_frontier_m` by this and more count alike."""
    replan_steps: int = 40
    """Steps after which an exploration target is chosen again ..."""
    reached_m: float = 0.5
    """... or when it is this near."""
    collision_m: float = 0.20
    """A move forward by less has failed."""
    still_m: float = 0.05
    """A move by less along both axes has not got anywhere."""
    stuck_cells: int = 16
    """The goal to get unstuck is farther than this (0.8 m)."""


@dataclass(frozen=True, slots=True)
class PlannedStep:
    """A single action, and what it was read off."""

    action: Action
    """`STOP`: a confirmed goal is reached."""
    goal: GoalKind | Literal["stuck", "none"]
    """The goal that the action serves; `none` without any goal."""
    distance_m: float | None = None
    """Path length to the grown goal; `None` if there is no path."""
    straight_m: float = math.inf
    """Straight distance to it."""
    short_term_m: Point2 | None = None
    """`(x, z)` that the action heads for."""


class UniGoalPlanner:
    """Plans on a `BevMap`, and marks there where the agent has been and where it collided."""

    def __init__(self, bev: BevMap, seed: int, config: PlannerConfig | None = None) -> None:
        """Create the planner of one task.

        Args:
            bev: The agent's map; the planner adds visited cells and collisions.
        """
        self.bev = bev
        self.config = config or PlannerConfig()
        self.counters = Counter(collisions=0, stuck=0, unreachable=0, targets=0)
        """Counts since the task began."""
        self._random = random.Random(f"unigoal {seed}")  # noqa: S311 - not for secrets
        self.begin_stage()

    def begin_stage(self) -> None:
        """Keep the map; drop the exploration target, the blacklist and the stuck state."""
        self._last: Pose | None = None
        self._last_action: Action | None = None
        self.is_stuck = False
        """True if the agent has to leave its place before anything else."""
        self._stuck_width = 1
        self._stuck_goal_m: Point2 | None = None
        self._detour_m: Point2 | None = None
        self.target_m: Point2 | None = None
        """The present exploration target."""
        self._num_target_steps = 0
        self._blacklist: set[tuple[int, int]] = set()

    def observe(self, pose: Pose, *, action: Action | None = None) -> None:
        """Note the present pose; call this once before each `step`.

        Args:
            action: The agent's own action that has led there. `None`, as at the beginning of a stage or after a guided
                move, reveals no obstacles.
        """
        here = (pose.x_m, pose.z_m)
        last = self._last or pose
        there = (last.x_m, last.z_m)
        self.bev.core.visit(there, here)
        is_still = abs(here[0] - there[0]) < self.config.still_m and abs(here[1] - there[1]) < self.config.still_m
        if not is_still:
            self.is_stuck, self._stuck_goal_m = False, None
        if self._last is not None and action is Action.MOVE_FORWARD:
            self._learn_from_move(last, math.dist(here, there), is_still)
        self._last = pose
        self._last_action = action
        self._num_target_steps += 1

    def _learn_from_move(self, start: Pose, moved_m: float, is_still: bool) -> None:
        """Block a strip ahead of a move that failed; after repeated failures the agent is stuck."""
        length, buffer = 2, 4
        if is_still:
            self._stuck_width += 2
            if self._stuck_width >= 7:
                length, buffer = 4, 3
                self.counters["stuck"] += not self.is_stuck
                self.is_stuck = True
            self._stuck_width = min(self._stuck_width, 5)
        else:
            self._stuck_width = 1
        if moved_m < self.config.collision_m:
            self.counters["collisions"] += 1
            width = self._stuck_width
            self.bev.core.collide((start.x_m, start.z_m), start.yaw_rad, start=buffer, length=length, width=width)

    def blacklist(self, cells: Cells) -> None:
        """Reject goal cells, grown by `blacklist_radius`, for the rest of the stage."""
        grown = self.bev.core.grown(cells, self.config.blacklist_radius)
        self._blacklist.update((int(row), int(col)) for row, col in grown)

    @property
    def num_blacklisted(self) -> int:
        """Number of cells in which no goal may lie in this stage."""
        return len(self._blacklist)

    def allowed(self, cells: Cells) -> Cells:
        """Return the goal cells that are not blacklisted."""
        if not self._blacklist:
            return cells
        keep = [(int(row), int(col)) not in self._blacklist for row, col in cells]
        return cells[np.array(keep, np.bool_)] if len(cells) else cells

    def needs_target(self, pose: Pose) -> bool:
        """Return whether an exploration target is due: none yet, reached, or `replan_steps` old."""
        return (
            self.target_m is None
            or self._num_target_steps >= self.config.replan_steps
            or math.dist(self.target_m, (pose.x_m, pose.z_m)) < self.config.reached_m
        )

    def exploration_target(self, pose: Pose, mid_term_goal_m: Point2 | None = None) -> Point2 | None:
        """Choose an exploration target, which stays until the next choice.

        Args:
            mid_term_goal_m: `(x, z)` that decides among frontiers about as near; ignored off the map.

        Returns:
            The target `(x, z)`. Without a frontier to go to, the last one stays; `None` if there was none.
        """
        config, bev = self.config, self.bev
        if mid_term_goal_m is not None and bev.cell_of(mid_term_goal_m) is None:
            mid_term_goal_m = None
        chosen = None
        if bev.cell_of((pose.x_m, pose.z_m)) is not None:
            chosen = bev.core.choose_frontier(
                (pose.x_m, pose.z_m),
                mid_term_goal_m,
                frontier_obstacle_radius=config.frontier_obstacle_radius,
                min_cells=config.min_frontier_cells,
                min_distance_m=config.min_frontier_m,
                span_m=config.frontier_span_m,
                path_obstacle_radius=config.obstacle_radius,
                margin=self._margin,
            )
        self._num_target_steps = 0
        if chosen is not None:
            self.counters["targets"] += 1
            self.target_m = bev.map_frame.centre_m(*chosen[0])
        return self.target_m

    def distance_m(self, pose: Pose, goal: Cells) -> float | None:
        """Return the path length from the agent to goal cells grown by `object_radius`.

        Returns:
            Metres, 0 on the goal; `None` if there is no path, or nothing of it is on the map.
        """
        plan = self._plan(pose, goal, self.config.object_radius)
        return None if plan is None else plan[0]

    def step(self, pose: Pose, goal: Cells | Point2 | None, kind: GoalKind) -> PlannedStep:
        """Return the next action towards a goal; call `observe` first.

        A stuck agent heads for a random place where it has been, until it moves, unless its goal is confirmed. Where
        the map shows no path to the goal, the agent goes to the reachable place nearest to it, from there to one where
        it has been, and back; an exploration target is dropped. An agent with nothing to head for turns right, one that
        is shut in by what it has bumped into tries in turn to move and to turn.

        Args:
            goal: Cells, or a point `(x, z)`; `None` for nowhere.
            kind: The kind of goal, which decides how it is grown; only a `confirmed` one ends in `STOP`.
        """
        if self.is_stuck and kind != "confirmed":
            if self._stuck_goal_m is None:
                self._stuck_goal_m = self._visited_place(pose)
            step = self._step_to(pose, self._stuck_goal_m, "stuck")
            return step if step.distance_m is not None else self._feel(step)
        step = self._step_to(pose, goal, kind)
        if step.goal == "none" or step.action is Action.STOP:
            return step
        if step.distance_m is not None:
            self._detour_m = None
            return step
        self.counters["unreachable"] += 1
        self.target_m = None
        if self.is_stuck:
            return self._feel(step)
        if self._detour_m is None and step.short_term_m is None:
            self._detour_m = self._visited_place(pose)
        if self._detour_m is None:
            return step
        detour = self._step_to(pose, self._detour_m, "stuck")
        if detour.distance_m is None or detour.distance_m < self.config.stop_m:
            self._detour_m = None
        return detour

    def _feel(self, step: PlannedStep) -> PlannedStep:
        """Return a move or a turn in alternation, so that an agent shut in by collisions tries all directions."""
        has_tried = self._last_action is Action.MOVE_FORWARD
        return replace(step, action=Action.TURN_RIGHT if has_tried else Action.MOVE_FORWARD)

    def _step_to(
        self, pose: Pose, goal: Cells | Point2 | None, kind: Literal["confirmed", "temporary", "exploration", "stuck"]
    ) -> PlannedStep:
        config = self.config
        radii = {"exploration": config.exploration_radius, "stuck": config.stuck_radius}
        plan = self._plan(pose, self._cells(goal), radii.get(kind, config.object_radius))
        if plan is None:
            return PlannedStep(Action.TURN_RIGHT, "none")
        distance_m, straight_m, short_term_m = plan
        if kind == "confirmed":
            way_m = math.inf if distance_m is None else distance_m
            is_behind = straight_m < config.detour_straight_m and way_m > config.detour_ratio * straight_m
            if way_m < config.stop_m or is_behind:
                return PlannedStep(Action.STOP, kind, distance_m, straight_m, short_term_m)
        action = self._steer(pose, short_term_m)
        return PlannedStep(action, kind, distance_m, straight_m, short_term_m)

    def _steer(self, pose: Pose, point_m: Point2 | None) -> Action:
        if point_m is None:
            return Action.TURN_RIGHT
        bearing_rad = math.atan2(point_m[0] - pose.x_m, point_m[1] - pose.z_m)
        error_rad = math.remainder(bearing_rad - pose.yaw_rad, math.tau)
        if abs(error_rad) <= math.radians(self.config.turn_deg) + 1e-9:
            return Action.MOVE_FORWARD
        return Action.TURN_RIGHT if error_rad > 0 else Action.TURN_LEFT

    def _cells(self, goal: Cells | Point2 | None) -> Cells:
        if isinstance(goal, np.ndarray):
            return goal
        cell = None if goal is None else self.bev.cell_of(goal)
        return np.array([] if cell is None else [cell], np.int32).reshape(-1, 2)

    def _plan(self, pose: Pose, goal: Cells, radius: int) -> tuple[float | None, float, Point2 | None] | None:
        """Return path length, straight distance and short-term goal; `None` if agent or goal are off the map."""
        here = (pose.x_m, pose.z_m)
        if not len(goal) or self.bev.cell_of(here) is None:
            return None
        config = self.config
        plan = self.bev.core.plan(
            here,
            goal,
            goal_radius=radius,
            obstacle_radius=config.obstacle_radius,
            margin=self._margin,
            circle=config.circle,
            small_circle=config.small_circle,
        )
        return None if math.isinf(plan[1]) else plan

    def _visited_place(self, pose: Pose) -> Point2 | None:
        """Return a random place where the agent has been, farther than `stuck_cells` away if there is one."""
        cells = np.argwhere(self.bev.core.visited)
        here = self.bev.cell_of((pose.x_m, pose.z_m))
        if here is None or not len(cells):
            return None
        far = cells[np.hypot(*(cells - here).T) > self.config.stuck_cells]
        row, col = self._random.choice((far if len(far) else cells).tolist())
        return self.bev.map_frame.centre_m(row, col)

    @property
    def _margin(self) -> int:
        return round(self.config.margin_m / self.bev.config.cell_m)
