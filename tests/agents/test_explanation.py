"""An agent that hands its map and its objects over is recorded and drawn like those that come with evonav."""

import numpy as np
from toy_episode import run
from toy_house import stage_case

from evonav import Agent, Explanation, NavigateTo, ObjectMap, OccupancyMap, Stop
from evonav.agents.explanation import explaining, inspectable


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
        self.beliefs.append(inspectable(self).belief())
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
    class Silent(Agent):
        def explain(self):
            return Explanation(choice="wait")

    belief = inspectable(Silent()).belief()
    assert not belief.cells.any()
    assert belief.entries == []
    assert explaining(Silent()).diagnostics().choice == "wait"
    assert explaining(Silent()).entries() == []


def test_an_agent_without_explanation_has_none():
    assert explaining(Agent) is None
    assert inspectable(object()) is None
