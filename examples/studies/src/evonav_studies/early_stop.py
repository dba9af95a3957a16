"""Fail-then-Update that stops as soon as it is near enough to an object that it sees."""

import math
from dataclasses import dataclass
from typing import ClassVar

from evonav.agents.frontier_update.fail_then_update import FailThenUpdate, FailThenUpdateConfig
from evonav.agents.navigator import NavigationTarget
from evonav.sensors.observation import Observation


@dataclass(frozen=True, slots=True)
class EarlyStopConfig(FailThenUpdateConfig):
    """Fail-then-Update's values, and when it is near enough."""

    stop_within_m: float = 1.8
    """A little less than the success radius of 2.0 m, since boxes of parts are off-centre."""


class FailThenUpdateEarlyStop(FailThenUpdate):
    """Asks within a distance of the chosen entry if a view of the round detects it, not only where it would stand."""

    config: EarlyStopConfig = EarlyStopConfig()
    _counted: ClassVar[tuple[str, ...]] = (*FailThenUpdate._counted, "early_looks")

    def _in_reach(self, observation: Observation) -> NavigationTarget | None:
        """Return the committed target if it is near and this round's views detect it."""
        target, here = self._navigator.target, (observation.pose.x_m, observation.pose.z_m)
        if target is None or math.dist(target.centre_m, here) >= self.config.stop_within_m:
            return None
        if not self._navigator.is_detected(target.entry_id):
            return None
        self._counters["early_looks"] += 1
        return target
