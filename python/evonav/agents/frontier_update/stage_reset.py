"""Stage-Reset (paper, Sec. C.4): Frontier-Update that searches from scratch in every stage."""

import math
from dataclasses import dataclass
from typing import Literal

from evonav.agents.agent import AgentAction, NavigateTo
from evonav.agents.frontier_update.agent import FrontierUpdate, FrontierUpdateConfig
from evonav.agents.viewpoint import widest_direction_rad
from evonav.decision.question import DecisionModel
from evonav.memory.occupancy import FREE
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal


@dataclass(frozen=True, slots=True)
class StageResetConfig(FrontierUpdateConfig):
    """Values that the paper leaves open about a search from scratch."""

    on_nothing_found: Literal["widest_direction", "end"] = "widest_direction"
    """The action if a stage's first look finds neither objects nor frontiers: go where most floor is free, or end."""


class StageReset(FrontierUpdate):
    """Gains nothing from earlier stages, and loses nothing to stale entries."""

    def __init__(self, config: StageResetConfig | None = None, decision: DecisionModel | None = None) -> None:
        config = config or StageResetConfig()
        super().__init__(config, decision)
        self._on_nothing_found = config.on_nothing_found

    def begin_stage(self, goal: Goal) -> None:
        """Forget entries, map, frontiers, views and ids; counters count over the whole task."""
        before = self._navigator.explorer
        self._navigator = self._new_navigator()
        explorer = self._navigator.explorer
        explorer.num_conflicts = before.num_conflicts
        explorer.num_cells_cleared = before.num_cells_cleared
        explorer.num_frontiers_reset = before.num_frontiers_reset
        super().begin_stage(goal)

    def _without_candidates(self, observation: Observation) -> AgentAction:
        """Go where most floor is free if the stage's first look found nothing, as one into a corner does."""
        navigator = self._navigator
        if navigator.round == 0 and self._on_nothing_found == "widest_direction":
            here, travel_m = (observation.pose.x_m, observation.pose.z_m), self.sensors.max_travel_m
            occupancy = navigator.explorer.map
            bearing_rad = widest_direction_rad(occupancy.cells == FREE, occupancy.map_frame, here, travel_m)
            if bearing_rad is not None:
                self._record_round("widest direction", "neither objects nor frontiers in sight")
                return NavigateTo(
                    (here[0] + travel_m * math.sin(bearing_rad), here[1] + travel_m * math.cos(bearing_rad))
                )
        return super()._without_candidates(observation)
