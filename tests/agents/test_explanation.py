"""An agent that hands its map and its objects over is recorded and drawn like those that come with evonav."""

import numpy as np
from toy_episode import belief_of, run
from toy_house import stage_case

from evonav import Agent, Explanation, NavigateTo, ObjectMap, OccupancyMap, Stop
from evonav.agents.explanation import explains


class Explained(Agent):
    """Goes to the first object that it remembers, and explains that."""

    def __init__(self):
        self.beliefs = []

    def begin_task(self, task):
        self.map, self.objects, self.chosen = OccupancyMap(task.map_frame), ObjectMap(), None

    def begin_stage(self, goal):
        pass

    def act(self, observation):
        for view in observation.views:
            self.map.update(view)
            self.objects.update(view)
        self.map.update_frontiers((observation.pose.x_m, observation.pose.z_m))
        self.beliefs.append(belief_of(self))
        self.chosen = next(iter(self.objects.entries), None)
        if self.chosen is None or observation.has_arrived:
            return Stop()
        return NavigateTo((self.chosen.centre_m[0], self.chosen.centre_m[2]))

    def explain(self):
        chosen = None if self.chosen is None else self.chosen.id
        return Explanation(map=self.map, objects=self.objects, chosen_id=chosen, reason="near", counters={"rounds": 1})


def test_an_explanation_becomes_records_and_beliefs():
    agent = Explained()
    (record,) = run(agent, stage_case(1, "Mug|1"))
    first, entries = record.trace[0], record.entries
    assert first.choice == f"object {first.chosen_entry.entry_id}"
    assert first.num_entries >= 1
    assert (first.counters, first.details) == ({"rounds": 1}, {"reason": "near"})
    assert first.chosen_entry.label in {entry.label for entry in entries}
    belief = agent.beliefs[-1]
    assert np.array_equal(belief.cells, agent.map.cells)
    assert [entry.entry_id for entry in belief.entries] == [entry.id for entry in agent.objects.entries]
    assert [frontier.frontier_id for frontier in belief.frontiers] == [one.id for one in agent.map.frontiers]


def test_parts_of_an_explanation_may_be_missing():
    silent = Explanation(choice="wait")
    assert silent.map_belief() is None
    assert silent.entries() == []
    said = silent.diagnostics(is_first=True)
    assert (said.choice, said.chosen_entry, said.num_entries, said.num_frontiers) == ("wait", None, 0, 0)


def test_functions_are_called_only_where_their_value_is_needed():
    called = []
    lazy = Explanation(
        map=lambda: called.append("map"),
        objects=lambda: called.append("objects") or [],
        places=lambda: called.append("places"),
    )
    lazy.diagnostics(is_first=False)
    assert called == []
    lazy.diagnostics(is_first=True)
    lazy.entries()
    lazy.map_belief()
    assert called == ["places", "objects", "map"]


def test_an_agent_without_explanation_has_none():
    assert not explains(Agent)
    assert not explains(object())


class Helpful(Explained):
    """Has helper methods whose names say nothing to the evaluator."""

    def belief(self, place):
        raise AssertionError("not the evaluator's")

    def entries(self, label):
        raise AssertionError("not the evaluator's")

    def diagnostics(self, verbose):
        raise AssertionError("not the evaluator's")


def test_helper_methods_of_any_name_change_nothing():
    records = [run(agent, stage_case(1, "Mug|1"))[0] for agent in (Explained(), Helpful())]
    assert records[0] == records[1]
    assert records[0].entries
