"""The lowest floor: what a stage gives to an agent that does nothing."""

from evonav.agents.agent import AgentAction, Sensing, Stop, ViewSchedule
from evonav.sensors.observation import Observation
from evonav.tasks.public import StageInput, TaskInfo


class StayStill:
    """Stops at once: it succeeds where the stage before has ended within the success radius of the next target."""

    sensing = Sensing(first_round=ViewSchedule(1, 0.0), later_rounds=ViewSchedule(1, 0.0))

    def begin_task(self, task: TaskInfo) -> None:
        """Nothing to forget."""

    def begin_stage(self, stage: StageInput) -> None:
        """Nothing to read."""

    def act(self, observation: Observation) -> AgentAction:
        """Stops."""
        return Stop("stays")
