"""DualMap in the words of its rule: furniture stays with what lay on it, everything else is forgotten."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from cup_views import GONE, a_cup
from scripted_model import scripted
from toy_episode import rounds_of, run
from toy_house import OBJECTS, stage_case

from evonav.agents.rivals.dualmap import AbstractMap, DualMap, DualMapConfig, main_plane_m
from evonav.decision.home_statistics import is_furniture
from evonav.sensors.observation import MapFrame, Observation
from evonav.tasks.public import TaskInfo

FRAME = MapFrame(rows=80, cols=80, cell_m=0.1, corner_m=(-4.0, -1.0))
TABLE_TOP = np.array([[0, 0.71, 0], [0.1, 0.71, 0], [0, 0.71, 0.1], [0, 0.1, 0]], np.float32)


def entry(entry_id, label, centre_m, size_m):
    return SimpleNamespace(id=entry_id, label=label, centre_m=centre_m, size_m=size_m, feature=None)


def table(entry_id=1, x_m=0.0, label="DiningTable"):
    return entry(entry_id, label, (x_m, 0.35, 0.0), (1.2, 0.72, 0.8))


def mug(entry_id=2, x_m=0.3, bottom_m=0.72):
    return entry(entry_id, "Mug", (x_m, bottom_m + 0.05, 0.1), (0.1, 0.1, 0.1))


def map_with_table():
    abstract = AbstractMap(DualMapConfig())
    abstract.add(table(), TABLE_TOP)
    return abstract


def test_the_main_plane_is_where_most_points_are():
    assert main_plane_m(TABLE_TOP, 0.02) == pytest.approx(0.71)


@pytest.mark.parametrize(
    ("thing", "is_on"),
    [
        (mug(), True),
        (mug(bottom_m=0.80), True),  # the plane is at most 0.1 m below its bottom
        (mug(bottom_m=0.83), False),
        (mug(bottom_m=0.53), True),  # or at most 0.2 m above it
        (mug(bottom_m=0.50), False),
        (mug(x_m=0.56), True),  # nine tenths of its footprint are over the table
        (mug(x_m=0.58), False),  # seven tenths are
    ],
)
def test_a_thing_lies_on_furniture_if_it_is_over_it_and_at_the_height_of_its_plane(thing, is_on):
    abstract = map_with_table()
    assert abstract.put(thing) is is_on
    assert [one.label for one in abstract.anchors[1].contents] == (["Mug"] if is_on else [])


def test_contents_are_added_and_never_removed():
    abstract = map_with_table()
    abstract.put(mug())
    abstract.put(entry(3, "Bowl", (0.0, 0.8, 0.0), (0.2, 0.1, 0.2)))
    abstract.add(table(7, x_m=0.05), TABLE_TOP)  # the same table, seen again without anything on it
    (anchor,) = abstract.anchors.values()
    assert (anchor.entry_id, anchor.centre_m[0]) == (1, 0.05)
    assert [one.label for one in anchor.contents] == ["Mug", "Bowl"]


def test_furniture_elsewhere_or_of_another_kind_is_another_anchor():
    abstract = map_with_table()
    abstract.add(table(7, x_m=0.5), TABLE_TOP)
    abstract.add(table(8, label="Desk"), TABLE_TOP)
    assert list(abstract.anchors) == [1, 7, 8]


class Watching:
    """An agent that looks and does not move."""

    def __init__(self, label):
        self.agent = DualMap()
        task = TaskInfo(task_id="t", num_stages=2, map_frame=FRAME, max_rounds=50, seed=0)
        self.agent.begin_task(task)
        self.agent.begin_stage(stage_case(1, "GarbageCan|1").public)
        self.label = label

    def see(self, *views):
        for view in views:
            navigator = self.agent._navigator
            navigator.observe(Observation((view,), view.pose, is_action_success=True, num_rounds_left=50))
            self.agent._after_look(None)
        return self

    @property
    def known(self):
        return [one.label for one in self.agent._navigator.objects.entries], [
            one.label for one in self.agent._abstract.anchors.values()
        ]


@pytest.mark.parametrize(("label", "anchors"), [("Sofa", ["Sofa"]), ("Cup", [])])
def test_the_anchor_stays_and_everything_else_is_forgotten_when_it_is_out_of_the_window(label, anchors):
    watching = Watching(label).see(*[a_cup(label)] * 4, *[GONE] * 14)
    assert watching.known == ([label], [])
    watching.see(GONE)
    assert watching.known == ([], anchors)
    told = [one.label for one in watching.agent.explain().entries()]
    assert told == anchors


def test_what_was_seen_too_seldom_is_dropped_though_it_is_furniture():
    assert Watching("Sofa").see(*[a_cup("Sofa")] * 2, *[GONE] * 15).known == ([], [])


def test_a_new_goal_begins_a_new_local_map():
    watching = Watching("Sofa").see(*[a_cup("Sofa")] * 4)
    watching.agent.begin_stage(stage_case(2, "Fridge|1").public)
    assert watching.known == ([], ["Sofa"])


def mug_on_table(**moves):
    """The mug is seen on the table in stage 1, and is the goal of stage 3."""
    return (
        stage_case(1, "Mug|1"),
        stage_case(2, "GarbageCan|1"),
        stage_case(3, "Mug|1", moves=moves or None, mode="SALIENT_OBJECT" if moves else None),
    )


def test_it_goes_to_the_anchor_on_which_the_goal_lay_and_finds_it_there():
    agent = DualMap()
    records, told = rounds_of(agent, *mug_on_table(), size_px=120)
    assert records[-1].state == "success"
    contents = {one.label: [content.label for content in one.contents] for one in agent._abstract.anchors.values()}
    assert "Mug" in contents["DiningTable"]
    last = [said for stage, _, said, _ in told if stage == 3]
    assert last[-1].counters["anchors_failed"] == 0


def test_a_failed_anchor_is_ignored_for_this_goal_and_open_again_for_the_next():
    away = {"Mug|1": (4.6, 1.07, 4.6)}  # on the dresser, in the other room
    agent = DualMap()
    stages = (*mug_on_table(**away), stage_case(4, "Fridge|1", moves=away, before=away))
    _, rounds = rounds_of(agent, *stages, size_px=120)
    told = {stage: said.details.get("failed_anchors", []) for stage, _, said, _ in rounds}
    table_id = next(key for key, one in agent._abstract.anchors.items() if one.label == "DiningTable")
    assert table_id in told[3]
    assert told[4] == []
    chosen = [said.choice for stage, _, said, _ in rounds if stage == 3]
    assert any(choice.startswith(("frontier", "object")) for choice in chosen)


def test_after_a_failure_only_anchors_that_are_as_good_or_of_the_same_kind_are_left():
    agent = DualMap()
    run(agent, stage_case(1, "Fridge|1"))
    abstract = agent._abstract = AbstractMap(DualMapConfig())
    for number, (label, x_m) in enumerate([("DiningTable", 0), ("DiningTable", 3), ("Desk", 6), ("Desk", 9)], 1):
        abstract.add(table(number, float(x_m), label), TABLE_TOP)
    abstract.put(entry(20, "Fridge", (0.3, 0.8, 0.1), (0.1, 0.1, 0.1)))
    abstract.put(entry(21, "Fridge", (6.3, 0.8, 0.1), (0.1, 0.1, 0.1)))
    assert [one.entry_id for one in agent._open_anchors()] == [1, 2, 3, 4]
    agent._failed = [1]
    assert [one.entry_id for one in agent._open_anchors()] == [3]
    agent._failed = [1, 3]
    assert [one.entry_id for one in agent._open_anchors()] == [2]
    agent._failed = [1, 3, 2]
    assert agent._open_anchors() == []


def test_a_question_offers_what_lay_on_an_anchor_by_its_name_on_the_anchor():
    model = scripted()
    run(DualMap(decision=model), *mug_on_table(), size_px=120)
    asked = [question for question in model.questions if question.goal.stage == 3]
    mugs = [one for one in asked[0].objects if one.label == "Mug"]
    assert mugs
    x_m, _, z_m = OBJECTS["DiningTable|1"][1]
    assert all(math.dist(one.ground_m, (x_m, z_m)) < 0.6 for one in mugs)


def test_furniture_is_what_hardly_moves():
    assert all(is_furniture(label) for label in ("Sofa", "CounterTop", "TVStand", "couch"))
    assert not any(is_furniture(label) for label in ("Mug", "Chair", "Box", "Laptop"))
