"""`check_agent` forces the situations in which agents under development crash."""

import math
import re
from pathlib import Path

import evonav
from evonav.agents.baselines import NearestFrontier
from evonav.evaluation.contract.situations import check_situations, place_of
from evonav.evaluation.run.components import Backend


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


def situations(agent):
    return {found.name: found for found in check_situations(Backend(), "mine", agent, 0)}


def test_an_agent_that_handles_every_situation_passes():
    found = situations(Doubter)
    assert {check.verdict for check in found.values()} == {"pass"}, found


def test_a_fault_in_the_branch_of_a_remembered_entry_is_found():
    found = situations(Faulty)
    assert {"target gone", "failed search"} <= {name for name, check in found.items() if check.verdict == "fail"}
    lines = Path(__file__).read_text().splitlines()
    line = next(number for number, text in enumerate(lines, 1) if "target.entry_id" in text)
    assert found["target gone"].finding.startswith(f"{Path(__file__).name}:{line}: AttributeError: ")
    assert "has no attribute 'entry_id'" in found["target gone"].finding


class Fragile(NearestFrontier):
    """Raises in each of the branches that easy stages do not reach."""

    def act(self, observation):
        is_first = observation.num_rounds_left == 12
        sees_nothing = not any(view.detections.labels for view in observation.views)
        self.raise_if(observation.is_guided, "guided")
        self.raise_if(not observation.is_action_success, "failed action")
        self.raise_if(is_first and sees_nothing, "nothing there")
        action = super().act(observation)
        self.raise_if(not is_first and self.explain().num_frontiers == 0, "no frontier")
        self.raise_if(observation.num_rounds_left == 1, "no rounds left")
        return action

    def raise_if(self, is_wrong, reason):
        if is_wrong:
            raise LookupError(reason)


def test_each_situation_is_reached():
    found = situations(Fragile)
    reasons = {"guided stage": "guided", "failed actions": "failed action", "no detections": "nothing there"}
    reasons |= {"never found": "no rounds left", "all explored": "no frontier"}
    for name, reason in reasons.items():
        assert found[name].verdict == "fail"
        assert f"LookupError: {reason}" in found[name].finding
        assert re.match(r"test_agent_situations\.py:\d+: ", found[name].finding)


def test_what_the_agents_own_choices_do_not_reach_is_said():
    class Resting(NearestFrontier):
        def act(self, observation):
            from evonav.agents.agent import Stop

            return Stop()

    found = situations(Resting)
    assert found["target gone"].verdict == "skip"
    assert found["target gone"].finding == "not reached: the agent did not go back to where it had seen the target"
    assert found["failed actions"].finding == "not reached: the agent did not try to move"
    assert found["guided stage"].verdict == "pass"


def test_the_place_of_a_traceback_is_the_agents_own():
    trace = 'Traceback\n  File "/home/me/mine.py", line 7, in act\n    x\n  File "<string>", line 2, in f\nError'
    assert place_of(trace) == "mine.py:7"
    assert place_of("no traceback") == ""
