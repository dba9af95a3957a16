"""Define what an oracle baseline is; `oracle_baselines` has all that there are, and imports agents for them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from evonav.agents.agent import AgentAction, NavigateTo, SensorConfig, Stop
from evonav.points import Point3
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal, TaskInfo

STOP_DISTANCE_M = 1.0
"""An oracle baseline stops this near the target: well inside the success radius, so that no rounding decides."""


@dataclass(frozen=True, slots=True)
class Sighting:
    """The result of perfect recognition on a round's views."""

    is_target_visible: bool
    is_target_seen: bool
    """True if the target was seen in this or an earlier round of the episode, anywhere, near enough to remember."""


class OracleBaseline:
    """An agent that the evaluator also gives the target's place, and whether the target is in view."""

    description = ""
    sensors: SensorConfig = SensorConfig()

    def __init__(self) -> None:
        self._target_m: tuple[float, float] = (math.nan, math.nan)
        self._is_target_visible = False
        self._is_target_seen = False

    def reveal_target(self, position_m: Point3) -> None:
        """Receive the target's position at the start of a stage."""
        self._target_m = (position_m[0], position_m[2])

    def reveal_sighting(self, sighting: Sighting) -> None:
        """Receive the sighting of the target before each `act`."""
        self._is_target_visible = sighting.is_target_visible
        self._is_target_seen = sighting.is_target_seen

    def reveal_stale(self, entry_ids: Sequence[int]) -> None:
        """Receive the ids of its stale entries at the start of a stage."""

    def begin_task(self, task: TaskInfo) -> None:
        """Do nothing: there is no memory."""

    def begin_stage(self, goal: Goal) -> None:
        """Do nothing: the goal is not read."""

    def act(self, observation: Observation) -> AgentAction:
        """Answer one decision round."""
        raise NotImplementedError

    def _go_to_target(self, observation: Observation) -> AgentAction:
        pose = observation.pose
        if observation.has_arrived or math.dist((pose.x_m, pose.z_m), self._target_m) <= STOP_DISTANCE_M:
            return Stop()
        return NavigateTo(self._target_m)
