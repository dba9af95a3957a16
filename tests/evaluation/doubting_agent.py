"""An agent that looks for what it remembers and forgets what is gone, and one that crashes when it forgets."""

import math

import evonav


class Doubter(evonav.Agent):
    """Goes to the nearest remembered object of the right kind, and stops there if one is in view."""

    def begin_task(self, task):
        self.map = evonav.OccupancyMap(task.map_frame)
        self.objects = evonav.ObjectMap()

    def begin_stage(self, goal):
        self.goal = goal
        self.target = None

    def act(self, observation):
        here = (observation.pose.x_m, observation.pose.z_m)
        for view in observation.views:
            self.map.integrate(view.occupancy, (view.pose.x_m, view.pose.z_m))
            self.objects.update(view)
        if self.target is not None and (observation.has_arrived or not observation.is_action_success):
            if any(self.goal.category in view.detections.labels for view in observation.views):
                return evonav.Stop()
            self.forget()
        known = [entry for entry in self.objects.entries if entry.label == self.goal.category]
        if known and self.target is None:
            self.target = known[0]
            return evonav.NavigateTo((self.target.centre_m[0], self.target.centre_m[2]))
        places = [frontier.position_m for frontier in self.map.update_frontiers(here)]
        return evonav.NavigateTo(min(places, key=lambda at: math.dist(at, here))) if places else evonav.Stop("explored")

    def forget(self):
        self.objects.remove(self.target.id)
        self.target = None


class Faulty(Doubter):
    """Names a field that entries do not have, in a branch that no easy stage reaches."""

    def forget(self):
        self.objects.remove(self.target.entry_id)
