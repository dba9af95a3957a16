"""Exploration alone: the agent always goes to the nearest frontier."""

from evonav.agents.agent import AgentAction, NavigateTo, SensorConfig, Stop
from evonav.agents.explanation import Explanation
from evonav.agents.explorer import Explorer, nearest_frontier
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal, TaskInfo


class NearestFrontier:
    """Explores the nearest frontier first and recognises nothing: the search half of an oracle baseline.

    Each stage starts with a blank map: what was seen on the way to another goal was not looked at for this one.
    """

    def __init__(self) -> None:
        self.sensors = SensorConfig()
        self._explorer: Explorer | None = None
        self._choice = ""

    def begin_task(self, task: TaskInfo) -> None:
        """Start with a blank map."""
        self._explorer = Explorer(task.map_frame)

    def begin_stage(self, goal: Goal) -> None:
        """Start with a blank map."""
        if self._explorer is not None:
            self._explorer.clear()

    def act(self, observation: Observation) -> AgentAction:
        """Go towards the nearest frontier."""
        explorer = self._explorer
        assert explorer is not None, "begin_task comes first"
        explorer.observe(observation)
        here = (observation.pose.x_m, observation.pose.z_m)
        frontier = nearest_frontier(explorer.frontiers, here)
        if frontier is None:
            self._choice = "none"
            return Stop("nothing left to explore")
        self._choice = f"frontier {frontier.id}"
        position_m, face_m = explorer.go_to(frontier)
        return NavigateTo(position_m, face_m)

    def explain(self) -> Explanation:
        """Return the choice and the counters of the last round; the agent remembers no objects."""
        explorer = self._explorer
        if explorer is None:
            return Explanation()
        return Explanation(
            choice=self._choice,
            num_frontiers=len(explorer.frontiers),
            counters={"conflicts": explorer.num_conflicts, "cells_cleared": explorer.num_cells_cleared},
        )
