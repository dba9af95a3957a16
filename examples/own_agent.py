"""A whole agent of one's own: it maps, remembers objects, goes to the nearest of the asked-for kind, or explores.

    evonav check-agent ./examples/own_agent.py:OwnAgent
    evonav evaluate --agent ./examples/own_agent.py:OwnAgent --agent fu --out out/mine

An agent has these three methods, and `explain` for pictures. This one uses nothing of the instruction but the category,
and believes what it remembers: it stops where it last saw the object.
"""

import math

from evonav import Agent, Explanation, Goal, NavigateTo, ObjectMap, Observation, OccupancyMap, Stop, TaskInfo


class OwnAgent(Agent):
    """Goes to the nearest object of the asked-for category that it knows of, and explores until it knows one."""

    def begin_task(self, task: TaskInfo) -> None:
        """A new house: forget everything."""
        self.map, self.objects = OccupancyMap(task.map_frame), ObjectMap()

    def begin_stage(self, goal: Goal) -> None:
        """A new goal in the same house: what is remembered stays."""
        self.category = goal.category
        self.target_m: tuple[float, float] | None = None

    def act(self, observation: Observation) -> NavigateTo | Stop:
        """One decision round."""
        here = (observation.pose.x_m, observation.pose.z_m)
        for view in observation.views:
            self.map.update(view)
            self.objects.update(view)
        if self.target_m is not None:
            is_there = observation.has_arrived or not observation.is_action_success
            return Stop() if is_there else NavigateTo(self.target_m)
        places = [(e.centre_m[0], e.centre_m[2]) for e in self.objects.entries if e.label == self.category]
        if places:
            self.target_m = min(places, key=lambda place: math.dist(place, here))
            return NavigateTo(self.target_m)
        frontiers = self.map.update_frontiers(here)
        if not frontiers:
            return Stop("nothing left to explore")
        nearest = min(frontiers, key=lambda frontier: math.dist(frontier.position_m, here))
        return NavigateTo(nearest.position_m)

    def explain(self) -> Explanation:
        """What `evonav view` draws: the map and the remembered objects."""
        return Explanation(map=self.map, objects=self.objects)
