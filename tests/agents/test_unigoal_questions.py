"""UniGoal's questions: what their grammars let through, and what the text matcher answers."""

import numpy as np
import pytest

from evonav.agents.unigoal.goal_graph import GoalEdge, GoalGraph
from evonav.agents.unigoal.object_graph import Node
from evonav.agents.unigoal.questions import (
    CategoryQuestion,
    DecomposeQuestion,
    DescribeQuestion,
    GoalRelationsQuestion,
    ObjectsQuestion,
)
from evonav.agents.unigoal.scene_questions import (
    CorrectionQuestion,
    GroupScoreQuestion,
    LayoutQuestion,
    RelationLinesQuestion,
    RoomQuestion,
)
from evonav.decision.question import AnswerError
from evonav.decision.rules import TextMatch
from evonav.tasks.public import Goal
from evonav.tasks.vocabulary import CODE_CATEGORIES, MAP_CATEGORIES

TEXT = "Please navigate to the small red chair in the bedroom next to the bed and the dining table."
GOAL = Goal(1, "Chair", TEXT, TEXT, TEXT, np.zeros((300, 300, 3), np.uint8))
GRAPH = GoalGraph(
    ("chair", "bed", "dining table"),
    (GoalEdge("chair", "next to", "bed"), GoalEdge("chair", "next to", "dining table")),
)


def node(node_id, caption, x=0.0, z=0.0, y=0.4, size=(0.6, 0.8, 0.6)):
    return Node(node_id, caption, (x, y, z), size, 4)


CHAIR, TABLE, BED = node(1, "chair"), node(2, "table", 1.0, size=(1.2, 0.8, 0.8)), node(3, "bed", 5.0)
VASE = node(4, "plant", 1.0, y=0.95, size=(0.2, 0.3, 0.2))
PAIRS = ((CHAIR, TABLE), (CHAIR, BED), (VASE, TABLE), (TABLE, VASE))
GROUP = (CHAIR, TABLE)
ANCHORS = {"chair": CHAIR, "bed": BED}

ASKED = {
    "describe": DescribeQuestion(GOAL, GOAL.reference_image),
    "objects": ObjectsQuestion(GOAL, TEXT),
    "relations": GoalRelationsQuestion(GOAL, TEXT, GRAPH.nodes),
    "decompose": DecomposeQuestion(GOAL, GRAPH),
    "category": CategoryQuestion(GOAL, TEXT, "chair", CODE_CATEGORIES, may_decline=False),
    "lines": RelationLinesQuestion(GOAL, PAIRS),
    "room": RoomQuestion(GOAL, GRAPH, ("bedroom", "kitchen", "other room")),
    "score": GroupScoreQuestion(GOAL, GRAPH, GROUP, {}, (CHAIR, TABLE, BED)),
    "layout": LayoutQuestion(GOAL, GRAPH, ANCHORS),
    "correction": CorrectionQuestion(GOAL, GRAPH, (CHAIR, TABLE), {(1, 2): "on"}),
}
TWO_PARTS = (
    '{"subgraph_1": {"nodes": ["chair", "bed"], "edges": [["chair", "next to", "bed"]]},'
    ' "subgraph_2": {"nodes": ["dining table"], "edges": []}}'
)


@pytest.mark.parametrize("name", ASKED)
def test_rules_answer_within_the_grammar(name):
    asked = ASKED[name]
    reply = TextMatch().answer(asked)
    assert asked.parse(asked.answer_text(reply.answer)) == reply.answer
    text = " ".join(part for part in asked.prompt().turns[0].parts if isinstance(part, str))
    assert text
    for other in asked.alternatives(reply.answer):
        assert asked.parse(asked.answer_text(other)) == other != reply.answer


def answer(name):
    return TextMatch().answer(ASKED[name]).answer


def test_the_goal_is_read_by_rule():
    assert answer("objects") == GRAPH.nodes
    assert answer("relations") == GRAPH.edges
    assert answer("decompose") == (GRAPH,)
    assert answer("describe") == "the chair"
    loose = GoalGraph((*GRAPH.nodes, "sofa"), GRAPH.edges)
    assert TextMatch().answer(DecomposeQuestion(GOAL, loose)).answer == (GRAPH, GoalGraph(("sofa",)))


@pytest.mark.parametrize(
    ("target", "released", "published"),
    [
        ("chair", "chair", "chair"),
        ("armchair", "chair", "chair"),
        ("sofa", "couch", "couch"),
        ("fridge", "chair", "refrigerator"),
        ("mug", "chair", "cup"),
        ("dog bed", "bed", "none"),
        ("soap bottle", "toilet", "bottle"),
        ("side table", "chair", "none"),
    ],
)
def test_as_released_a_goal_may_be_of_six_categories(target, released, published):
    found = [
        TextMatch().answer(CategoryQuestion(GOAL, TEXT, target, known, may_decline=is_published)).answer
        for known, is_published in ((CODE_CATEGORIES, False), (MAP_CATEGORIES, True))
    ]
    assert found == [released, published]


def test_scene_relations_are_judged_by_boxes():
    assert answer("lines") == ("next to", "away from", "on", "under")
    assert answer("correction") == ("keep", "keep", "rename to next to")


def test_rooms_and_groups_are_judged_by_words():
    assert answer("room") == "bedroom"
    with_goal = answer("score")
    without = TextMatch().answer(GroupScoreQuestion(GOAL, GRAPH, (VASE,), {}, (VASE,))).answer
    assert 0.0 <= without < with_goal <= 1.0


def test_layout_starts_from_where_things_are():
    places = answer("layout")
    assert places["chair"] == (0.0, 0.0)
    assert places["bed"] == (5.0, 0.0)
    assert places["dining table"] == (0.7, 0.0)  # next to the chair, towards the bed


@pytest.mark.parametrize(
    ("name", "text", "meant"),
    [
        ("objects", "[Chair, 'bed', chair, a, b, c, d]\nbecause", ("chair", "bed", "a", "b", "c")),
        ("relations", "bed and chair: chair is Near bed\nchair and cat: chair is on cat", None),
        ("relations", "none", ()),
        ("decompose", TWO_PARTS + "\nbecause they are apart", None),
        ("category", "TV.", "tv"),
        ("room", "It is in the Kitchen", "kitchen"),
        ("score", "0.25\nlikely", 0.25),
        ("score", "1", 1.0),
    ],
)
def test_answers_that_are_read(name, text, meant):
    found = ASKED[name].parse(text)
    expected = {
        "relations": (GoalEdge("chair", "near", "bed"),),
        "decompose": (
            GoalGraph(("chair", "bed"), (GoalEdge("chair", "next to", "bed"),)),
            GoalGraph(("dining table",)),
        ),
    }
    assert found == (expected[name] if meant is None else meant)


LINES = "chair_1 and table_2: chair_1 is next to table_2\nchair_1 and bed_3: chair_1 is far from bed_3\n"
LINES += "plant_4 and table_2: plant_4 is on table_2\ntable_2 and plant_4: table_2 is under plant_4"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("describe", "...\n"),
        ("objects", "chair, bed"),
        ("objects", "[]"),
        ("objects", "[chair]]"),
        ("relations", ""),
        ("relations", "the chair is next to the bed"),
        ("relations", "chair and bed: cat is next to bed"),
        ("decompose", "Here it is: {}"),
        ("decompose", "{}"),
        ("decompose", '{"subgraph_1": {"nodes": ["bed"], "edges": []}}'),
        ("decompose", '{"subgraph_2": {"nodes": ["chair"], "edges": []}}'),
        ("decompose", '{"subgraph_1": {"nodes": ["chair", "cat"], "edges": []}}'),
        ("decompose", '{"subgraph_1": {"nodes": ["chair"], "edges": [["chair", "next to", "bed"]]}}'),
        ("decompose", '{"subgraph_1": {"nodes": ["chair", "bed"], "edges": [["chair", "on", "bed"]]}}'),
        ("decompose", '{"subgraph_1": {"nodes": ["chair", "bed"], "edges": [["chair", ["next to"], "bed"]]}}'),
        ("decompose", '{"subgraph_1": {"nodes": [["chair"]], "edges": []}}'),
        ("decompose", TWO_PARTS[:40]),
        ("category", "refrigerator"),
        ("category", "a chair"),
        ("lines", LINES.rpartition("\n")[0]),
        ("lines", LINES + "\nchair_1 and table_2: chair_1 is next to table_2"),
        ("lines", LINES.replace("bed_3: chair_1 is far from bed_3", "bed_3: bed_3 is far from chair_1")),
        ("lines", LINES.replace("plant_4 is on", "it is on")),
        ("room", "attic"),
        ("room", "bedroom or kitchen"),
        ("score", "1.5"),
        ("score", "-0.1"),
        ("score", "nan"),
        ("score", "very likely: 0.9"),
        ("layout", "chair: (0, 0)\nbed: (1, 0)"),
        ("layout", "chair: (0, 0)\nbed: (0, 0)\ndining table: (1, 1)"),
        ("layout", "chair: (0, 0)\nbed: (1, inf)\ndining table: (1, 1)"),
        ("layout", "bed: (0, 0)\nchair: (1, 0)\ndining table: (1, 1)"),
        ("correction", "0: keep\n1: keep"),
        ("correction", "0: keep\n1: keep\n3: keep"),
        ("correction", "0: keep\n1: rename\n2: delete"),
    ],
)
def test_answers_against_the_grammar_are_none(name, text):
    with pytest.raises(AnswerError) as caught:
        ASKED[name].parse(text)
    assert caught.value.fault == "invalid"


def test_lines_are_read_in_the_order_of_the_pairs():
    assert ASKED["lines"].parse(LINES) == ("next to", "far from", "on", "under")
    assert ASKED["correction"].parse("0: keep\n1: Rename to Desk.\n2: delete") == ("keep", "rename to desk", "delete")
    assert ASKED["layout"].parse("chair: (0, 0)\nbed: (-1.5, 2)\ndining table: (.5, 1.)")["bed"] == (-1.5, 2.0)
