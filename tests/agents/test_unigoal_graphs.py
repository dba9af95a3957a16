"""UniGoal's reasoning over goal graph and scene graph, with models that answer by a script."""

import pytest
from scripted_model import scripted
from toy_house import stage_case

from evonav.agents.unigoal.goal_graph import GoalEdge, GoalGraph
from evonav.agents.unigoal.graphs import GraphConfig, GraphReasoner
from evonav.agents.unigoal.object_graph import Node, name_of
from evonav.agents.unigoal.questions import DecomposeQuestion, DescribeQuestion, ObjectsQuestion
from evonav.agents.unigoal.scene_questions import CorrectionQuestion, LayoutQuestion
from evonav.decision.query import QuerySession

CHAIR_TEXT = "Please navigate to the chair next to the dining table."
OBJECTS_NAMED = "[vase, table, chair]"
RELATIONS = "vase and table: vase is on table\ntable and chair: table is next to chair"


def reasoner(model, target="Chair|1", instruction=CHAIR_TEXT, *, nodes=(), relations=(), **config):
    """Graphs at the beginning of a stage, whose scene has the given nodes and relations (two ids, and how)."""
    graphs = GraphReasoner(GraphConfig(**{"mode": "paper", **config}), QuerySession(model))
    graphs.begin_stage(stage_case(1, target, instruction=instruction).public)
    graphs.understand()
    for node in nodes:
        graphs.scene.add(node)
    pairs = [(graphs.scene.node(a), graphs.scene.node(b)) for a, b, _ in relations]
    graphs.scene.relate(pairs, [relation for _, _, relation in relations])
    return graphs


def node(node_id, caption, x, z):
    return Node(node_id, caption, (x, 0.4, z), (0.5, 0.8, 0.5), 5)


def test_decomposition_is_given_up_after_ten_tries():
    model = scripted(decompose="no JSON")
    graphs = reasoner(model)
    assert sum(isinstance(question, DecomposeQuestion) for question in model.questions) == 10
    graph = GoalGraph(("chair", "dining table"), (GoalEdge("chair", "next to", "dining table"),))
    assert graphs.subgraphs == (graph,) == (graphs.goal_graph,)


def test_a_new_stage_drops_the_goal_and_keeps_the_scene():
    graphs = reasoner(scripted(), nodes=[node(1, "table", 2.0, 1.0)])
    assert graphs.goal_graph is not None
    graphs.begin_stage(stage_case(2, "Bed|1").public)
    assert (graphs.goal_graph, graphs.subgraphs, graphs.category) == (None, (), None)
    assert [name_of(one) for one in graphs.scene.nodes] == ["table_1"]


def test_a_partly_found_goal_is_predicted_by_the_transform_of_two_anchors():
    layout = "vase: (1, 1)\ntable: (0, 0)\nchair: (1, 0)"
    model = scripted(goal_objects=OBJECTS_NAMED, goal_relations=RELATIONS, layout=layout)
    nodes = [node(1, "table", 2.0, 1.0), node(2, "chair", 2.0, 3.0)]
    advice = reasoner(model, nodes=nodes, relations=[(1, 2, "beside")]).advise(lambda _: False)
    # Two of three nodes, degrees 1 of 2 and 1 of 1, one of two edges.
    assert advice.score == pytest.approx(((2 / 3 + 0.75) / 2 + 0.5) / 2)
    assert advice.stage == "partial"
    # The layout's x axis is the way from table to chair: +z, twice as long. Its y axis then points to -x.
    assert advice.mid_term_m == pytest.approx((0.0, 3.0))
    assert any(isinstance(question, LayoutQuestion) for question in model.questions)


def test_a_goals_noun_is_compared_as_the_word_that_it_goes_under():
    # The chair next to the dining table.
    nodes = [node(1, "table", 2.0, 1.0), node(2, "chair", 2.0, 2.0)]
    advice = reasoner(scripted(), nodes=nodes, relations=[(2, 1, "next to")]).advise(lambda _: False)
    assert (advice.stage, advice.score, name_of(advice.target)) == ("perfect", 1.0, "chair_2")


def perfect(correction):
    model = scripted(
        goal_objects="[chair, table]", goal_relations="chair and table: chair is on table", correction=correction
    )
    nodes = [
        node(1, "table", 2.0, 1.0),
        node(2, "chair", 2.0, 2.0),
        node(3, "plant", 2.5, 2.5),
        node(4, "tv", 7.9, 4.0),
    ]
    relations = [(2, 1, "on"), (2, 3, "next to"), (2, 4, "under"), (1, 3, "next to")]
    return model, reasoner(model, nodes=nodes, relations=relations)


def test_a_goal_found_whole_is_corrected_and_gone_to():
    verdicts = "0: keep\n1: keep\n2: delete\n3: rename to near\n4: keep\n5: delete"
    model, graphs = perfect(lambda q: verdicts if len(q.relations) == 3 else "")
    advice = graphs.advise(lambda _: False)
    assert (advice.stage, advice.score) == ("zero", 0.25)  # the relation is not the goal's any more
    (correction,) = [question for question in model.questions if isinstance(question, CorrectionQuestion)]
    assert [name_of(n) for n in correction.nodes] == ["table_1", "chair_2", "plant_3"]  # the television is too far away
    assert [name_of(n) for n in graphs.scene.nodes] == ["table_1", "chair_2", "tv_4"]
    assert graphs.scene.relations == {(2, 1): "near", (2, 4): "under"}
    model, graphs = perfect("\n".join(f"{i}: keep" for i in range(6)))
    advice = graphs.advise(lambda _: False)
    assert (advice.stage, advice.score, name_of(advice.target)) == ("perfect", 1.0, "chair_2")
    # What was visited in vain does not match.
    assert graphs.advise(lambda n: n.entry_id == 2).target is None


def test_a_corrected_name_is_not_the_goals_any_more():
    _, graphs = perfect("0: keep\n1: rename to stool\n2: keep\n3: keep\n4: keep\n5: keep")
    assert graphs.advise(lambda _: False).stage == "zero"
    assert graphs.scene.node(2).label == "stool"


@pytest.mark.parametrize(("goal_input", "kinds"), [("category", set()), ("image", {DescribeQuestion, ObjectsQuestion})])
def test_goals_may_be_categories_or_images(goal_input, kinds):
    model = scripted()
    graphs = reasoner(model, "Bed|1", None, mode="code", goal_input=goal_input)
    assert graphs.goal_graph == GoalGraph(("bed",))
    assert {type(question) for question in model.questions} & {DescribeQuestion, ObjectsQuestion} == kinds
    assert graphs.category == "bed"
