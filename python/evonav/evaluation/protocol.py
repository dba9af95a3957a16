"""Hold the constants of the paper's evaluation protocol (Sec. C.1)."""

from dataclasses import dataclass

from evonav.agents.agent import Sensing
from evonav.errors import InvalidArgumentError
from evonav.evaluation.metrics.scoring import SUCCESS_RADIUS_M


@dataclass(frozen=True, slots=True)
class ProtocolConfig:
    """The rules that all agents of a run share."""

    max_rounds: int = 50
    """Decision rounds per stage."""
    max_actions: int = 500
    """Discrete actions per stage, for agents whose `Sensing.motion` is `actions`."""
    success_radius_m: float = SUCCESS_RADIUS_M
    waypoint_m: float = 0.25
    """Longest teleport while following planner waypoints."""
    max_travel_m: float = 1.0
    max_views: int = 7
    """Largest number of views per round that an agent may request."""
    max_occupancy_range_m: float = 3.0
    min_visible_px: int = 25
    """Number of visible pixels from which the target counts as seen in a view (diagnostics and oracle baselines)."""

    def budget(self, sensing: Sensing) -> int:
        """Return the number of rounds per stage: decisions, or single actions."""
        return self.max_actions if sensing.motion == "actions" else self.max_rounds

    def check(self, sensing: Sensing) -> None:
        """Reject a sensing request that the protocol does not grant.

        Raises:
            InvalidArgumentError: The motion is neither `waypoints` nor `actions`, a schedule has no views or too many,
                or travel or range exceed the caps.
        """
        if sensing.motion not in ("waypoints", "actions"):
            raise InvalidArgumentError(f"sensing.motion = {sensing.motion!r}: must be `waypoints` or `actions`")
        for name, schedule in (("first_round", sensing.first_round), ("later_rounds", sensing.later_rounds)):
            if not 1 <= schedule.count <= self.max_views:
                raise InvalidArgumentError(f"sensing.{name}.count = {schedule.count}: must be 1..{self.max_views}")
        if not 0.0 < sensing.max_travel_m <= self.max_travel_m:
            raise InvalidArgumentError(
                f"sensing.max_travel_m = {sensing.max_travel_m}: must be in (0, {self.max_travel_m}]"
            )
        if not 0.0 < sensing.occupancy_range_m <= self.max_occupancy_range_m:
            raise InvalidArgumentError(
                f"sensing.occupancy_range_m = {sensing.occupancy_range_m}: must be in (0, {self.max_occupancy_range_m}]"
            )
