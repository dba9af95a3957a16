"""Yardsticks that know more than an agent may. They bound what agents can reach; no agent can become one by asking.

Privilege is to be one of the classes of `YARDSTICKS`: neither methods of the same names nor inheriting from
`PrivilegedAgent` hands a plug-in anything.
"""

import math
from dataclasses import dataclass

from evonav.agents.agent import AgentAction, EntryBelief, NavigateTo, RoundDiagnostics, Sensing, Stop
from evonav.agents.nearest_frontier import NearestFrontier
from evonav.errors import InvalidArgumentError
from evonav.evaluation.records import Point3
from evonav.sensors.observation import Observation
from evonav.tasks.public import StageInput, TaskInfo

STOP_DISTANCE_M = 1.0
"""A yardstick stops this near the target: well inside the success radius, so that no rounding decides."""


@dataclass(frozen=True, slots=True)
class Sighting:
    """What perfect recognition tells about a round's views."""

    is_target_visible: bool
    is_target_seen: bool
    """In this or an earlier round of the episode, from near enough to be remembered; it may have been elsewhere."""


class PrivilegedAgent:
    """A yardstick: an agent that the evaluator also tells where the target is and when it is in view."""

    description = ""
    sensing: Sensing = Sensing()

    def __init__(self) -> None:
        self._target_m: tuple[float, float] = (math.nan, math.nan)
        self._is_target_visible = False
        self._is_target_seen = False

    def reveal_target(self, position_m: Point3) -> None:
        """Where the target is, at the start of a stage."""
        self._target_m = (position_m[0], position_m[2])

    def reveal_sighting(self, sighting: Sighting) -> None:
        """Whether the target is in view, before each `act`."""
        self._is_target_visible = sighting.is_target_visible
        self._is_target_seen = sighting.is_target_seen

    def begin_task(self, task: TaskInfo) -> None:
        """Nothing to forget."""

    def begin_stage(self, stage: StageInput) -> None:
        """Nothing to read."""

    def act(self, observation: Observation) -> AgentAction:
        """One decision round."""
        raise NotImplementedError

    def _approach(self, observation: Observation) -> AgentAction:
        pose = observation.pose
        if observation.has_arrived or math.dist((pose.x_m, pose.z_m), self._target_m) <= STOP_DISTANCE_M:
            return Stop()
        return NavigateTo(self._target_m)


class ShortestPath(PrivilegedAgent):
    """Walks the planner's path to the target: SR and SPL are 1 by construction, or the harness is wrong."""

    description = "the planner's path to the target, SR = SPL = 1 by construction"

    def act(self, observation: Observation) -> AgentAction:
        """Follows the path until the target is near."""
        return self._approach(observation)


class PerfectRecognition(PrivilegedAgent):
    """Nearest-frontier exploration that recognises the target instance at first sight: what search alone can reach."""

    description = "nearest-frontier exploration that recognises the target at first sight"

    def __init__(self) -> None:
        super().__init__()
        self._explorer = NearestFrontier()
        self.sensing = self._explorer.sensing
        self._has_seen_target = False

    def begin_task(self, task: TaskInfo) -> None:
        """Forgets the map."""
        self._explorer.begin_task(task)

    def begin_stage(self, stage: StageInput) -> None:
        """A new target, not yet seen; the map stays."""
        self._explorer.begin_stage(stage)
        self._has_seen_target = False

    def act(self, observation: Observation) -> AgentAction:
        """Explores until the target has been in view, then goes there."""
        action = self._explorer.act(observation)
        if self._is_target_visible and not self._has_seen_target:
            self._has_seen_target = True
            return self._approach_from_anywhere(observation)
        return self._approach(observation) if self._has_seen_target else action

    def _approach_from_anywhere(self, observation: Observation) -> AgentAction:
        # `has_arrived` still speaks of the last frontier.
        pose = observation.pose
        is_near = math.dist((pose.x_m, pose.z_m), self._target_m) <= STOP_DISTANCE_M
        return Stop() if is_near else NavigateTo(self._target_m)

    def diagnostics(self) -> RoundDiagnostics:
        """The explorer's."""
        return self._explorer.diagnostics()

    def entries(self) -> tuple[EntryBelief, ...]:
        """It remembers no objects."""
        return ()


YARDSTICKS: dict[str, type[PrivilegedAgent]] = {
    "shortest-path": ShortestPath,
    "nearest-frontier": PerfectRecognition,
}
"""By name, for `evonav evaluate --agents`."""


def privileges_of(agent: object) -> PrivilegedAgent | None:
    """The agent, if it is one of this module's own yardsticks."""
    return agent if isinstance(agent, PrivilegedAgent) and type(agent) in YARDSTICKS.values() else None


def yardstick(name: str) -> PrivilegedAgent:
    """A privileged yardstick by name.

    Raises:
        InvalidArgumentError: There is none of this name.
    """
    if name not in YARDSTICKS:
        raise InvalidArgumentError(f"no yardstick `{name}`; there are {', '.join(sorted(YARDSTICKS))}")
    return YARDSTICKS[name]()
