"""UniGoal (Yin et al., CVPR 2025) on this protocol (paper, Sec. C.3; docs/agents.md).

It explores frontiers with single actions, goes to what its detector takes for the goal, and lets the match of goal
graph and scene graph attract exploration a little. An obstacle stays one for ever: the map takes nothing back.
"""

import math
import random
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from evonav.agents.agent import AgentAction, EntryBelief, Move, SensorConfig, Stop, ViewSchedule
from evonav.agents.explanation import Explanation, FrontierBelief, MapBelief
from evonav.agents.unigoal.bev import BevConfig, BevMap, Cells
from evonav.agents.unigoal.goals import GoalWatch
from evonav.agents.unigoal.graphs import Advice, GraphConfig, GraphReasoner
from evonav.agents.unigoal.object_graph import Node
from evonav.agents.unigoal.planner import PlannedStep, PlannerConfig, UniGoalPlanner
from evonav.decision.goal_input import goal_as_given
from evonav.decision.query import QuerySession
from evonav.decision.question import DecisionModel
from evonav.decision.rules import TextMatch
from evonav.points import Point2
from evonav.sensors.observation import MapFrame, Observation
from evonav.tasks.public import Goal, TaskInfo
from evonav.tasks.vocabulary import MAP_CATEGORIES, category_image
from evonav.world.pose import Pose
from evonav.world.simulator import Action

_BELIEF_STRIDE = 2
"""Number of cells of the map in one cell of a picture, along each axis."""
_NUM_DRAWS = 10
"""Number of random places to try until one has a path to it."""


@dataclass(frozen=True, slots=True)
class UniGoalConfig:
    """UniGoal's constants, and those on which its paper and its code disagree."""

    graph: GraphConfig = field(default_factory=GraphConfig)
    bev: BevConfig = field(default_factory=BevConfig)
    planner: PlannerConfig = field(default_factory=PlannerConfig)
    num_tries: int = 3
    """Number of tries before a question counts as failed, where UniGoal has no rule of its own."""


class UniGoal:
    """Maps, relates, explores, and walks up to what looks like the goal."""

    sensors = SensorConfig(first_round=ViewSchedule(1, 0.0), later_rounds=ViewSchedule(1, 0.0), motion="actions")

    def __init__(self, config: UniGoalConfig | None = None, decision: DecisionModel | None = None) -> None:
        self.config = config or UniGoalConfig()
        model: DecisionModel = decision or TextMatch()
        self._goal_input = model.goal_input
        self._queries = QuerySession(model, num_tries=self.config.num_tries)
        self._round = Explanation()
        self._task: TaskInfo | None = None

    def begin_task(self, task: TaskInfo) -> None:
        """Forget everything; the map begins where the agent first stands."""
        self._task = task
        self._queries.counters.clear()
        is_shown = self._goal_input == "image"
        graph = replace(self.config.graph, goal_input="image") if is_shown else self.config.graph
        self._graphs = GraphReasoner(graph, self._queries)
        self._random = random.Random(f"unigoal wander {task.seed}")  # noqa: S311 - not for secrets
        self._bev: BevMap | None = None
        self._num_given_up = 0

    def begin_stage(self, goal: Goal) -> None:
        """Drop the goal graph and all goals; map, visited cells, collisions and scene graph stay."""
        self._graphs.begin_stage(goal_as_given(goal, self._goal_input))
        self._advice: Advice | None = None
        self._wander_m: Point2 | None = None
        self._num_steps = 0
        self._num_explored = 0
        self._last_action: Action | None = None
        self._watch: GoalWatch | None = None

    def act(self, observation: Observation) -> AgentAction:
        """Return one primitive action."""
        self._queries.begin_round()
        view, pose = observation.views[-1], observation.pose
        bev, planner, watch = self._ready(pose)
        planner.observe(pose, action=None if observation.is_guided else self._last_action)
        bev.integrate(view, category_image(view.detections))
        if self._graphs.goal_graph is None:
            self._graphs.understand()
        if self._num_steps % self.config.graph.steps_per_update == 0:
            self._graphs.observe(view)
        self._num_steps += 1
        watch.look(view, self._graphs.category, self._graphs.scene.seen_ids)
        watch.judge(pose)
        step = self._step(bev, planner, watch, pose)
        self._last_action = step.action
        self._record_round(planner, watch, step)
        if step.action is Action.STOP:
            return Stop("arrived")
        return Move(step.action)

    def _ready(self, pose: Pose) -> tuple[BevMap, UniGoalPlanner, GoalWatch]:
        """Return the task's map and planner and the stage's goals, made when first needed."""
        assert self._task is not None, "begin_task comes first"
        if self._bev is None:
            self._bev = BevMap((pose.x_m, pose.z_m), len(MAP_CATEGORIES), self.config.bev)
            self._planner = UniGoalPlanner(self._bev, self._task.seed, self.config.planner)
        if self._watch is None:
            self._planner.begin_stage()
            self._watch = GoalWatch(self._bev, self._planner)
        return self._bev, self._planner, self._watch

    def _step(self, bev: BevMap, planner: UniGoalPlanner, watch: GoalWatch, pose: Pose) -> PlannedStep:
        """Go towards the confirmed goal, else the temporary one, else an exploration target."""
        if watch.goal is None:
            target_m = self._exploration_target(bev, planner, watch, pose)
        if watch.confirmed is not None:
            return planner.step(pose, watch.confirmed.cells, "confirmed")
        if watch.temporary is not None:
            return planner.step(pose, watch.temporary.cells, "temporary")
        return planner.step(pose, target_m, "exploration")

    def _exploration_target(self, bev: BevMap, planner: UniGoalPlanner, watch: GoalWatch, pose: Pose) -> Point2 | None:
        """Return a frontier, chosen again when due, after another match of the graphs.

        Without a frontier left, it is a random explored place: the house may look different there by now.
        """
        here = (pose.x_m, pose.z_m)
        reached_m, wander_m = planner.config.reached_m, self._wander_m
        self._num_explored += 1
        if wander_m is None:
            is_due = planner.needs_target(pose)
        else:
            is_due = self._num_explored >= planner.config.replan_steps or math.dist(wander_m, here) < reached_m
        if is_due:
            self._num_explored = 0
            self._advice = advice = self._graphs.advise(self._is_given_up)
            if advice.target is not None:
                watch.pursue(advice.target.entry_id, self._cells_of(bev, advice.target))
            num_targets = planner.counters["targets"]
            planner.exploration_target(pose, advice.mid_term_m)
            is_new = planner.counters["targets"] > num_targets
            self._wander_m = None if is_new else self._somewhere(bev, planner, pose)
        return self._wander_m or planner.target_m

    def _somewhere(self, bev: BevMap, planner: UniGoalPlanner, pose: Pose) -> Point2 | None:
        """Return a random place to go to when nothing is left to explore; `None` if ten draws give no reachable one."""
        open_cells = bev.core.explored
        blocked = bev.core.grown(
            np.ascontiguousarray(np.argwhere(bev.core.obstacles), np.int32), planner.config.obstacle_radius
        )
        open_cells[blocked[:, 0], blocked[:, 1]] = False
        rows, cols = np.nonzero(open_cells)
        for _ in range(_NUM_DRAWS if len(rows) else 0):
            index = self._random.randrange(len(rows))
            place_m = bev.map_frame.centre_m(int(rows[index]), int(cols[index]))
            cell = np.array([[rows[index], cols[index]]], np.int32)
            is_far = math.dist(place_m, (pose.x_m, pose.z_m)) >= planner.config.reached_m
            if is_far and planner.distance_m(pose, cell) is not None:
                return place_m
        return None

    def _cells_of(self, bev: BevMap, node: Node) -> Cells:
        """Return the cells under a node's points."""
        points_m = self._graphs.scene.objects.points_m(node.entry_id)
        at_m = np.array([node.ground_m]) if points_m is None else points_m[:, [0, 2]].astype(np.float64)
        return np.unique(bev.map_frame.cells_at(at_m).astype(np.int32), axis=0)

    def _is_given_up(self, node: Node) -> bool:
        """Return whether all of a node lies where the goal was searched in vain."""
        assert self._bev is not None, "there is a map whenever goals are matched"
        if not self._planner.num_blacklisted:
            return False
        return len(self._planner.allowed(self._cells_of(self._bev, node))) == 0

    def _record_round(self, planner: UniGoalPlanner, watch: GoalWatch, step: PlannedStep) -> None:
        """Store the choice of a round for `explain`."""
        advice, goal = self._advice, watch.goal
        node = None if goal is None or goal.node_id is None else self._graphs.scene.node(goal.node_id)
        details: dict[str, object] = {"category": self._graphs.category, "step": step.goal}
        if advice is not None:
            details |= {"match": advice.stage, "score": round(advice.score, 4), "anchors": advice.num_anchors}
            details |= {"reason": advice.reason, "mid_term_m": advice.mid_term_m}
        if goal is not None:
            details |= {"goal": "temporary" if watch.confirmed is None else "confirmed", "goal_m": goal.centre_m}
        if step.distance_m is not None:
            details["distance_m"] = round(step.distance_m, 3)
        self._round = Explanation(
            choice=step.goal if goal is None else f"{details['goal']} {goal.source}",
            chosen_entry=None if node is None else self._entry(node),
            num_entries=len(self._graphs.scene.nodes),
            counters={
                **self._queries.counters,
                **planner.counters,
                "given_up": watch.num_given_up,
                "blacklisted_cells": planner.num_blacklisted,
                "edges": len(self._graphs.scene.relations),
            },
            details=details,
        )

    def explain(self) -> Explanation:
        """Return the goal of the last action, the match of the graphs, and how to describe the scene graph."""
        node_id = None if self._watch is None or self._watch.goal is None else self._watch.goal.node_id
        return replace(
            self._round,
            map=self._map_belief,
            objects=lambda: [self._entry(node) for node in self._graphs.scene.nodes],
            candidate_ids=() if node_id is None else (node_id,),
            questions=tuple(self._queries.log),
        )

    def _map_belief(self) -> MapBelief | None:
        """Return the map at half its resolution, and the exploration target."""
        if self._bev is None:
            return None
        target_m = self._wander_m or self._planner.target_m
        cells, frame = _coarser(self._bev.cells, self._bev.map_frame, _BELIEF_STRIDE)
        return MapBelief(cells, frame, [] if target_m is None else [FrontierBelief(0, target_m, 0.0)])

    def _entry(self, node: Node) -> EntryBelief:
        kind = self._graphs.scene.type_of(node.entry_id)
        return EntryBelief(node.entry_id, kind, node.centre_m, node.size_m, node.num_detections)


def _coarser(cells: NDArray[np.uint8], frame: MapFrame, stride: int) -> tuple[NDArray[np.uint8], MapFrame]:
    """Return a map of larger cells around the known ones: blocked if any of theirs is, else free if any is."""
    known = np.argwhere(cells)
    low, high = (known.min(axis=0), known.max(axis=0) + 1) if len(known) else (np.zeros(2, int), np.ones(2, int))
    low = low // stride * stride
    rows, cols = (-(-(high - low) // stride)).tolist()
    padded = np.zeros((rows * stride, cols * stride), np.uint8)
    part = cells[low[0] : low[0] + rows * stride, low[1] : low[1] + cols * stride]
    padded[: part.shape[0], : part.shape[1]] = part
    coarse = padded.reshape(rows, stride, cols, stride).max(axis=(1, 3))  # blocked is more than free, free than unknown
    corner_m = (frame.corner_m[0] + int(low[1]) * frame.cell_m, frame.corner_m[1] + int(low[0]) * frame.cell_m)
    return coarse, MapFrame(rows, cols, frame.cell_m * stride, corner_m)
