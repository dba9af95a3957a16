"""An agent that maps the house, remembers objects, and stops where it saw one again in this stage.

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
        self.target: int | None = None  # id of the remembered object that the agent goes to
        self.objects.begin_stage(goal.stage)

    def act(self, observation: evonav.Observation) -> evonav.NavigateTo | evonav.Stop:
        """Update the memory, then decide where to go next, or to stop."""
        here = (observation.pose.x_m, observation.pose.z_m)
        for view in observation.views:
            self.map.update(view)
            self.objects.update(view)
        if self.target is not None and (observation.has_arrived or not observation.is_action_success):
            entry = self.objects.entry(self.target)
            if entry is not None:
                if entry.last_seen_stage == self.goal.stage:
                    return evonav.Stop()
                self.objects.remove(entry.id)  # not seen on the way: somebody has moved it
            self.target = None
        place = self.place_to_go(here)
        if place is not None:
            return evonav.NavigateTo(place)
        frontiers = [frontier.position_m for frontier in self.map.update_frontiers(here)]
        if not frontiers:
            return evonav.Stop("nothing left to explore")
        return evonav.NavigateTo(min(frontiers, key=lambda point: math.dist(point, here)))

    def explain(self) -> evonav.Explanation:
        """Return what the agent believes, which `evonav view` draws."""
        return evonav.Explanation(map=self.map, objects=self.objects)

    def place_to_go(self, here: Point) -> Point | None:
        """Return the place of the target; without one, choose the nearest remembered object of the goal's category."""
        places = {e.id: (e.centre_m[0], e.centre_m[2]) for e in self.objects.entries if e.label == self.goal.category}
        if self.target not in places:
            self.target = min(places, key=lambda entry_id: math.dist(places[entry_id], here), default=None)
        return None if self.target is None else places[self.target]
