"""An agent that walks step by step, whose process dies once, in the second stage."""

import os
from pathlib import Path

from evonav.agents.agent import AgentAction, Move, SensorConfig, Stop
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal, TaskInfo
from evonav.world.simulator import Action


class DyingWalker:
    def __init__(self) -> None:
        self.sensors = SensorConfig(motion="actions")
        self._stage = 0
        self._num_steps = 0

    def begin_task(self, task: TaskInfo) -> None:
        pass

    def begin_stage(self, goal: Goal) -> None:
        self._stage, self._num_steps = goal.stage, 0

    def act(self, observation: Observation) -> AgentAction:
        died = Path(os.environ["EVONAV_TEST_DIED"])
        if self._stage == 2 and not died.exists():
            died.touch()
            os._exit(3)
        self._num_steps += 1
        if self._num_steps > 12:
            return Stop("tired")
        return Move(Action.MOVE_FORWARD if observation.is_action_success else Action.TURN_LEFT)
