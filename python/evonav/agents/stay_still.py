"""The lowest bound: the score of an agent that does nothing."""

from evonav.agents.agent import AgentAction, SensorConfig, Stop, ViewSchedule
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal, TaskInfo


class StayStill:
    """Stops at once. It succeeds where the last stage has ended within the success radius of the next target."""

    sensors = SensorConfig(first_round=ViewSchedule(1, 0.0), later_rounds=ViewSchedule(1, 0.0))

    def begin_task(self, task: TaskInfo) -> None:
        """Do nothing: there is nothing to forget."""

    def begin_stage(self, goal: Goal) -> None:
        """Ignore the goal."""

    def act(self, observation: Observation) -> AgentAction:
        """Stop."""
        return Stop("stays")
