"""Fail-then-Update that stops as soon as it is near enough to an object that it sees."""

import math

from evonav.agents.frontier_update.fail_then_update import FailThenUpdate, FailThenUpdateConfig
from evonav.agents.navigator import NavigationTarget
from evonav.decision.question import DecisionModel
from evonav.sensors.observation import Observation
from evonav.tasks.public import TaskInfo

EARLY_STOP_M = 1.8
"""A little less than the success radius of 2.0 m, since boxes of parts are off-centre."""


class FailThenUpdateEarlyStop(FailThenUpdate):
    """Asks within a distance of the chosen entry if a view of the round detects it, not only where it would stand."""

    def __init__(
        self,
        config: FailThenUpdateConfig | None = None,
        decision: DecisionModel | None = None,
        *,
        stop_within_m: float = EARLY_STOP_M,
    ) -> None:
        super().__init__(config, decision)
        self._stop_within_m = stop_within_m

    def begin_task(self, task: TaskInfo) -> None:
        """Forget everything."""
        super().begin_task(task)
        self._counters.update(early_looks=0)

    def _in_reach(self, observation: Observation) -> NavigationTarget | None:
        """Return the committed target if it is near and this round's views detect it."""
        target, here = self._navigator.target, (observation.pose.x_m, observation.pose.z_m)
        if target is None or math.dist(target.centre_m, here) >= self._stop_within_m:
            return None
        if not self._navigator.is_detected(target.entry_id):
            return None
        self._counters["early_looks"] += 1
        return target
