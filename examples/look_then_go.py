"""A small agent of one's own: explores until the asked-for category is in view, walks there and stops.

    PYTHONPATH=examples evonav evaluate --agents look_then_go:LookThenGo,fu --limit 5 --out out/mine

An agent is any class with these three methods; there is nothing to inherit from. It remembers nothing between rounds
but its occupancy map, so it shows how far a plain search gets.
"""

import math

import numpy as np

from evonav.agents.agent import AgentAction, NavigateTo, Sensing, Stop
from evonav.memory import OccupancyMap
from evonav.sensors.observation import Observation, View
from evonav.tasks.public import StageInput, TaskInfo
from evonav.world.camera import unproject


class LookThenGo:
    """Goes to the nearest object of the asked-for category that it sees, whichever that is."""

    def __init__(self) -> None:
        self.sensing = Sensing()

    def begin_task(self, task: TaskInfo) -> None:
        """A new house: a new map."""
        self.map = OccupancyMap(task.map_frame)

    def begin_stage(self, stage: StageInput) -> None:
        """A new goal."""
        self.category = stage.category
        self.target_m: tuple[float, float] | None = None

    def act(self, observation: Observation) -> AgentAction:
        """One decision round."""
        here = (observation.pose.x_m, observation.pose.z_m)
        for view in observation.views:
            self.map.integrate(view.occupancy, (view.pose.x_m, view.pose.z_m))
        found = [place for view in observation.views for place in _places(view, self.category)]
        if found:
            self.target_m = min(found, key=lambda place: math.dist(place, here))
        if self.target_m is not None:
            if observation.has_arrived or math.dist(self.target_m, here) < 1.5:
                return Stop()
            return NavigateTo(self.target_m)
        frontiers = self.map.update_frontiers(here)
        if not frontiers:
            return Stop("nothing left to explore")
        nearest = min(frontiers, key=lambda frontier: math.dist(frontier.position_m, here))
        return NavigateTo(nearest.position_m)


def _places(view: View, category: str) -> list[tuple[float, float]]:
    """`(x, z)` of the middle of what is seen of each object of `category`."""
    points_m = unproject(view.depth_m, view.pose, view.intrinsics)
    seen = [points_m[view.detections.masks == i] for i, label in enumerate(view.detections.labels) if label == category]
    return [(float(x), float(z)) for x, _, z in (np.median(points, axis=0) for points in seen)]
