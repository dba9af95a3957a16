"""Hold the constants of the paper's evaluation protocol (Sec. C.1)."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import ConfigDict, Field, with_config

from evonav.agents.agent import SensorConfig
from evonav.errors import InvalidArgumentError
from evonav.evaluation.metrics.scoring import SUCCESS_RADIUS_M

_Count = Annotated[int, Field(ge=1)]
_Metres = Annotated[float, Field(gt=0.0)]


@with_config(ConfigDict(strict=True, extra="forbid", allow_inf_nan=False))
@dataclass(frozen=True, slots=True)
class ProtocolConfig:
    """The rules that all agents of a run share. Values that a file gives are checked by these limits."""

    max_rounds: _Count = 50
    """Decision rounds per stage."""
    max_actions: _Count = 500
    """Discrete actions per stage, for agents whose `SensorConfig.motion` is `actions`."""
    success_radius_m: _Metres = SUCCESS_RADIUS_M
    waypoint_m: _Metres = 0.25
    """Longest teleport while following planner waypoints."""
    max_travel_m: _Metres = 1.0
    max_views: _Count = 7
    """Largest number of views per round that an agent may request."""
    max_occupancy_range_m: _Metres = 3.0
    min_visible_px: Annotated[int, Field(ge=0)] = 25
    """Number of visible pixels from which the target counts as seen in a view (diagnostics and oracle baselines)."""

    def budget(self, sensors: SensorConfig) -> int:
        """Return the number of rounds per stage: decisions, or single actions."""
        return self.max_actions if sensors.motion == "actions" else self.max_rounds

    def step_of_round(self, number: int, sensors: SensorConfig) -> int:
        """Return the round of an agent that stands for a decision round, from 0: single actions are ten a round."""
        return number * self.budget(sensors) // self.max_rounds

    def check(self, sensors: SensorConfig) -> None:
        """Reject sensors that the protocol does not grant.

        Raises:
            InvalidArgumentError: The motion is neither `waypoints` nor `actions`, a schedule has no views, too many or
                more than a full turn between two, or travel or range exceed the caps.
        """
        if sensors.motion not in ("waypoints", "actions"):
            raise InvalidArgumentError(f"sensors.motion = {sensors.motion!r}: must be `waypoints` or `actions`")
        for name, schedule in (("first_round", sensors.first_round), ("later_rounds", sensors.later_rounds)):
            if not 1 <= schedule.count <= self.max_views:
                raise InvalidArgumentError(f"sensors.{name}.count = {schedule.count}: must be 1..{self.max_views}")
            if not abs(schedule.spacing_deg) <= 360.0:
                raise InvalidArgumentError(
                    f"sensors.{name}.spacing_deg = {schedule.spacing_deg}: must be at most 360 degrees"
                )
        if not 0.0 < sensors.max_travel_m <= self.max_travel_m:
            raise InvalidArgumentError(
                f"sensors.max_travel_m = {sensors.max_travel_m}: must be in (0, {self.max_travel_m}]"
            )
        if not 0.0 < sensors.occupancy_range_m <= self.max_occupancy_range_m:
            raise InvalidArgumentError(
                f"sensors.occupancy_range_m = {sensors.occupancy_range_m}: must be in (0, {self.max_occupancy_range_m}]"
            )
