"""Lower bounds of every metric: agents that recognise nothing."""

import math
import random

from evonav.agents.agent import Agent, AgentAction, NavigateTo, SensorConfig, Stop, ViewSchedule
from evonav.agents.explanation import Explanation
from evonav.agents.explorer import Explorer, nearest_frontier
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal, TaskInfo

TURN_PROBABILITY = 0.25
"""Probability that `RandomWalk` turns although the way is free."""


class StayStill(Agent):
    """Stops at once. It succeeds where the last stage has ended within the success radius of the next target."""

    sensors = SensorConfig(first_round=ViewSchedule(1, 0.0), later_rounds=ViewSchedule(1, 0.0))

    def act(self, observation: Observation) -> AgentAction:
        """Stop."""
        return Stop("stays")


class RandomWalk(Agent):
    """Goes straight on, or in a new direction now and then and whenever the way was blocked."""

    sensors = StayStill.sensors

    def begin_task(self, task: TaskInfo) -> None:
        """Start the task's own random stream."""
        self._random = random.Random(f"random-walk {task.seed}")  # noqa: S311 - not for secrets
        self._heading_rad = self._random.uniform(-math.pi, math.pi)

    def act(self, observation: Observation) -> AgentAction:
        """Go one metre further."""
        if not observation.is_action_success or self._random.random() < TURN_PROBABILITY:
            self._heading_rad = self._random.uniform(-math.pi, math.pi)
        pose = observation.pose
        reach_m = self.sensors.max_travel_m
        return NavigateTo(
            (pose.x_m + reach_m * math.sin(self._heading_rad), pose.z_m + reach_m * math.cos(self._heading_rad))
        )


class NearestFrontier(Agent):
    """Explores the nearest frontier first and recognises nothing: the search half of an oracle baseline.

    Each stage starts with a blank map: what was seen on the way to another goal was not looked at for this one.
    """

    def begin_task(self, task: TaskInfo) -> None:
        """Start with a blank map."""
        self._explorer, self._choice = Explorer(task.map_frame), ""

    def begin_stage(self, goal: Goal) -> None:
        """Start with a blank map."""
        self._explorer.clear()

    def act(self, observation: Observation) -> AgentAction:
        """Go towards the nearest frontier."""
        explorer = self._explorer
        explorer.observe(observation)
        here = (observation.pose.x_m, observation.pose.z_m)
        frontier = nearest_frontier(explorer.frontiers, here)
        if frontier is None:
            self._choice = "none"
            return Stop("nothing left to explore")
        self._choice = f"frontier {frontier.id}"
        position_m, face_m = explorer.go_to(frontier)
        return NavigateTo(position_m, face_m)

    def explain(self) -> Explanation:
        """Return the choice and the counters of the last round; the agent remembers no objects."""
        counters = self._explorer.counters
        return Explanation(
            choice=self._choice,
            num_frontiers=len(self._explorer.frontiers),
            counters={name: counters[name] for name in ("conflicts", "cells_cleared")},
        )
