"""A lower bound for every metric: walk in random directions and recognise nothing."""

import math
import random

from evonav.agents.agent import AgentAction, NavigateTo, SensorConfig, ViewSchedule
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal, TaskInfo


class RandomWalk:
    """Goes straight on, or in a new direction now and then and whenever the way was blocked."""

    sensors = SensorConfig(first_round=ViewSchedule(1, 0.0), later_rounds=ViewSchedule(1, 0.0))

    def __init__(self, turn_probability: float = 0.25) -> None:
        self._turn_probability = turn_probability
        self._random = random.Random(0)  # noqa: S311 - not for secrets
        self._heading_rad = 0.0

    def begin_task(self, task: TaskInfo) -> None:
        """Start the task's own random stream."""
        self._random = random.Random(f"random-walk {task.seed}")  # noqa: S311
        self._heading_rad = self._random.uniform(-math.pi, math.pi)

    def begin_stage(self, goal: Goal) -> None:
        """Ignore the goal."""

    def act(self, observation: Observation) -> AgentAction:
        """Go one metre further."""
        if not observation.is_action_success or self._random.random() < self._turn_probability:
            self._heading_rad = self._random.uniform(-math.pi, math.pi)
        pose = observation.pose
        reach_m = self.sensors.max_travel_m
        return NavigateTo(
            (pose.x_m + reach_m * math.sin(self._heading_rad), pose.z_m + reach_m * math.cos(self._heading_rad))
        )
