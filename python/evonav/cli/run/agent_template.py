"""An agent that maps the house, remembers objects, and looks again before it stops.

    evonav check-agent ./my_agent.py:MyAgent
    evonav evaluate --agent ./my_agent.py:MyAgent --agent fu --out out/mine

Change whatever you like. Points are (x, z) in metres.
"""

import math

import evonav

Point = tuple[float, float]


class MyAgent(evonav.Agent):
    """Goes to the nearest remembered object of the goal's category, and explores if there is none."""

    sensors = evonav.SensorConfig()  # needs_rgb=True also gives view.rgb

    def begin_task(self, task: evonav.TaskInfo) -> None:
        """Start in a new house: forget everything."""
        self.map = evonav.OccupancyMap(task.map_frame)
        self.objects = evonav.ObjectMap()

    def begin_stage(self, goal: evonav.Goal) -> None:
        """Start the search for a new goal in the same house: keep the memory, but objects may have been moved."""
        self.goal = goal  # goal.instruction is the whole sentence, goal.category the kind of object
        self.target: Point | None = None

    def act(self, observation: evonav.Observation) -> evonav.NavigateTo | evonav.Stop:
        """Update the memory, then decide where to go next, or to stop."""
        here = (observation.pose.x_m, observation.pose.z_m)
        for view in observation.views:
            self.map.integrate(view.occupancy, (view.pose.x_m, view.pose.z_m))
            self.objects.update(view)
        if self.target is not None:
            if not observation.has_arrived and observation.is_action_success:
                return evonav.NavigateTo(self.target)
            if any(self.goal.category in view.detections.labels for view in observation.views):
                return evonav.Stop()
            self.forget(self.target)  # it is not here any more
        self.target = self.nearest_remembered(here)
        if self.target is not None:
            return evonav.NavigateTo(self.target)
        frontiers = [frontier.position_m for frontier in self.map.update_frontiers(here)]
        if not frontiers:
            return evonav.Stop("nothing left to explore")
        return evonav.NavigateTo(min(frontiers, key=lambda point: math.dist(point, here)))

    def explain(self) -> evonav.Explanation:
        """Return what the agent believes, which `evonav view` draws."""
        return evonav.Explanation(map=self.map, objects=self.objects)

    def nearest_remembered(self, here: Point) -> Point | None:
        """Return the place of the nearest remembered object of the goal's category, if there is one."""
        known = [entry for entry in self.objects.entries if entry.label == self.goal.category]
        places = [(entry.centre_m[0], entry.centre_m[2]) for entry in known]
        return min(places, key=lambda point: math.dist(point, here), default=None)

    def forget(self, place: Point) -> None:
        """Remove the remembered objects of a place where the goal was not found."""
        for entry in list(self.objects.entries):
            if entry.label == self.goal.category and (entry.centre_m[0], entry.centre_m[2]) == place:
                self.objects.remove(entry.id)
