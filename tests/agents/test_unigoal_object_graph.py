"""UniGoal's matching of goal graph and scene graph, and the scene graph itself."""

from dataclasses import replace

import numpy as np
import pytest
from cup_views import a_view

from evonav.agents.unigoal.goal_graph import (
    GoalEdge,
    GoalGraph,
    is_edge_in,
    match_graphs,
    relation_kind,
    similarity_transform,
)
from evonav.agents.unigoal.object_graph import Node, ObjectGraph, middle_of, name_of
from evonav.decision.text.language import canonical
from evonav.tasks.language import noun_of
from evonav.tasks.vocabulary import CATEGORY_OF_TYPE, LABEL_OF_TYPE, MAP_CATEGORIES, category_image, relabelled

CHAIR_BY_TABLE = GoalGraph(("chair", "table"), (GoalEdge("chair", "next to", "table"),))


def node(node_id, caption, x=0.0, z=0.0):
    return Node(node_id, caption, (x, 0.5, z), (0.5, 0.5, 0.5), 5)


def match(goal, nodes, relations=None, mode="paper"):
    return match_graphs(goal, nodes, relations or {}, mode, canonical)


def test_as_published_a_goal_found_whole_scores_one():
    found = match(CHAIR_BY_TABLE, [node(1, "chair"), node(2, "table")], {(2, 1): "near"})
    assert found.score == 1.0
    assert list(found.anchors.items()) == [("chair", 1), ("table", 2)]
    assert match(GoalGraph(("couch",)), [node(1, "sofa")]).score == 1.0


def test_score_is_the_mean_of_node_and_edge_similarity():
    goal = GoalGraph(
        ("vase", "table", "chair"), (GoalEdge("vase", "on", "table"), GoalEdge("vase", "next to", "chair"))
    )
    nodes = [node(1, "vase"), node(2, "table")]
    found = match(goal, nodes, {(1, 2): "on"})
    # Two of three nodes; the vase has one of its two relations, the table its only one; one of two edges.
    assert found.score == pytest.approx(((2 / 3 + (1 / 2 + 1) / 2) / 2 + 1 / 2) / 2)
    apart = match(goal, nodes, {(1, 2): "away from"})
    assert apart.score == pytest.approx(((2 / 3 + 0.0) / 2 + 0.0) / 2)


def test_the_goal_among_many_chairs_is_the_one_by_the_table():
    nodes = [node(1, "chair", 5.0), node(2, "table"), node(3, "chair", 0.5)]
    relations = {(1, 2): "away from", (3, 1): "away from", (3, 2): "next to"}
    assert match(CHAIR_BY_TABLE, nodes, relations).anchors["chair"] == 3


def test_edges_hold_in_both_directions():
    edge = GoalEdge("vase", "on", "table")
    assert is_edge_in(edge, 1, 2, {(1, 2): "on top of"})
    assert is_edge_in(edge, 1, 2, {(2, 1): "under"})
    assert not is_edge_in(edge, 1, 2, {(2, 1): "on"})
    assert not is_edge_in(edge, 1, 2, {(1, 2): "next to"})
    assert [relation_kind(words) for words in ("Beside", "in", "held by", "")] == ["near", "on", "held by", ""]


def test_similarity_transform_turns_scales_and_shifts():
    # A layout of unit distances, turned by 90 degrees, doubled, and moved to (10, 20).
    ends = ((10.0, 20.0), (10.0, 22.0))
    assert similarity_transform(((0.0, 0.0), (1.0, 0.0)), ends, (1.0, 1.0)) == pytest.approx((8.0, 22.0))
    assert similarity_transform(((3.0, 1.0), (4.0, 1.0)), ends, (3.5, 1.0)) == pytest.approx((10.0, 21.0))
    # Turned the other way in the layout: its y axis is the scene's z axis, its x axis the scene's x axis.
    assert similarity_transform(((0.0, 0.0), (0.0, 1.0)), ends, (1.0, 0.0)) == pytest.approx((12.0, 20.0))
    assert similarity_transform(((1.0, 1.0), (1.0, 1.0)), ends, (0.0, 0.0)) is None


def wall_of(labels):
    """A view of square panels side by side, one a label, seen from the front."""
    masks = np.full((60, 60), -1, np.int32)
    for index in range(len(labels)):
        masks[20:32, 4 + 14 * index : 14 + 14 * index] = index
    return a_view(np.full((60, 60), 2.0), masks, tuple(labels))


def test_a_node_takes_three_detections_and_is_related_to_every_other():
    graph = ObjectGraph()
    assert graph.update(wall_of(["Chair"])) == []
    assert graph.update(wall_of(["Chair"])) == []
    assert graph.nodes == []
    assert graph.update(wall_of(["Chair"])) == []
    assert [name_of(n) for n in graph.nodes] == ["chair_1"]
    graph.update(wall_of(["Chair", "Sofa", "Desk"]))
    graph.update(wall_of(["Chair", "Sofa", "Desk"]))
    pairs = graph.update(wall_of(["Chair", "Sofa", "Desk"]))
    assert [(name_of(a), name_of(b)) for a, b in pairs] == [
        ("sofa_2", "chair_1"),
        ("sofa_2", "table_3"),
        ("table_3", "chair_1"),
    ]
    graph.relate(pairs, ["next to", "next to", "away from"])
    assert list(graph.relations.values()) == ["next to", "next to", "away from"]
    assert graph.update(wall_of(["Chair", "Sofa", "Desk"])) == []
    assert graph.type_of(3) == "Desk"


def test_windows_have_a_word_in_the_scene_graph_and_doors_have_none():
    graph = ObjectGraph()
    for _ in range(3):
        graph.update(wall_of(["Doorway", "Window", "Doorframe"]))
    assert [(one.label, graph.type_of(one.entry_id)) for one in graph.nodes] == [("windows", "Window")]
    assert not {"Doorway", "Doorframe", "Window"} & CATEGORY_OF_TYPE.keys(), "none triggers a goal"


def test_without_an_answer_the_pairs_get_no_edge():
    graph = ObjectGraph()
    pairs = [graph.update(wall_of(["Chair", "Sofa"])) for _ in range(3)][-1]
    assert len(pairs) == 1
    graph.relate(pairs, None)
    assert graph.relations == {}
    with pytest.raises(ValueError, match="zip"):
        graph.relate(pairs, ["next to", "on"])


def test_overlap_alone_associates_and_another_caption_drops_the_edges():
    graph = ObjectGraph()
    pairs = [graph.update(wall_of(["Chair", "Sofa"])) for _ in range(3)][-1]
    graph.relate(pairs, ["next to"])
    for _ in range(3):  # as often a bed as a chair: the first word stays
        assert graph.update(wall_of(["Bed", "Sofa"])) == []
    assert len(graph.relations) == 1
    pairs = graph.update(wall_of(["Bed", "Sofa"]))
    assert [name_of(n) for n in graph.nodes] == ["bed_1", "sofa_2"]
    assert graph.relations == {}
    assert [(name_of(a), name_of(b)) for a, b in pairs] == [("bed_1", "sofa_2")]


def test_corrections_rename_until_detections_change_and_delete_until_detected_again():
    graph = ObjectGraph()
    pairs = [graph.update(wall_of(["Chair", "Sofa"])) for _ in range(3)][-1]
    graph.relate(pairs, ["next to"])
    graph.rename(1, "stool")
    graph.update(wall_of(["Chair", "Sofa"]))
    assert graph.node(1).label == "stool"
    graph.delete(1)
    assert [n.entry_id for n in graph.nodes] == [2]
    assert graph.relations == {}
    for _ in range(3):
        graph.update(wall_of(["Chair", "Sofa"]))
    assert [name_of(n) for n in graph.nodes] == ["sofa_2", "chair_3"]


def test_groups_are_connected_within_half_a_metre():
    graph = ObjectGraph()
    places = {1: (0.0, 0.0), 2: (0.45, 0.0), 3: (0.9, 0.0), 4: (2.0, 0.0)}
    for i, (x, z) in places.items():
        graph.add(node(i, "chair", x, z))
    groups = graph.groups(lambda n: "bedroom" if n.entry_id != 2 else "kitchen")
    assert {room: [[n.entry_id for n in group] for group in part] for room, part in groups.items()} == {
        "bedroom": [[1], [3], [4]],
        "kitchen": [[2]],
    }
    (whole, far) = graph.groups(lambda _: "bedroom")["bedroom"]
    assert [n.entry_id for n in whole] == [1, 2, 3]
    assert middle_of(whole) == pytest.approx((0.45, 0.0))
    assert [n.entry_id for n in far] == [4]


def test_neighbourhood_is_two_hops_along_short_edges():
    graph = ObjectGraph()
    for i in (3, 1, 2, 5, 4):
        graph.add(node(i, "chair", 1.5 * i))
    assert [n.entry_id for n in graph.nodes] == [1, 2, 3, 4, 5]
    graph.relate([(graph.node(a), graph.node(b)) for a in range(1, 6) for b in range(a + 1, 6)], ["next to"] * 10)
    assert [n.entry_id for n in graph.neighbourhood([1], 2, 2.0)] == [1, 2, 3]
    assert [n.entry_id for n in graph.neighbourhood([1], 1, 99.0)] == [1, 2, 3, 4, 5]


def test_unmapped_types_are_invisible():
    found = wall_of(["Chair", "Mug", "Desk"]).detections
    seen = relabelled(found, LABEL_OF_TYPE)
    assert seen.labels == ("chair", "table")
    assert np.array_equal(seen.masks == 0, found.masks == 0)
    assert np.array_equal(seen.masks == 1, found.masks == 2)
    assert not (seen.masks[found.masks == 1] >= 0).any()
    image = category_image(found)
    assert set(np.unique(image)) == {-1, MAP_CATEGORIES.index("chair"), MAP_CATEGORIES.index("cup")}
    assert relabelled(replace(found, labels=("Mug",) * 3), LABEL_OF_TYPE).labels == ()


def test_tables_name_existing_types():
    from evonav.decision.text.language import _NOUNS

    for kind in {*CATEGORY_OF_TYPE, *LABEL_OF_TYPE} - {"SinkBasin", "Cabinet", "Mirror", "Curtains", "Cup"}:
        assert canonical(noun_of(kind)) in _NOUNS, kind
    assert set(CATEGORY_OF_TYPE.values()) <= set(MAP_CATEGORIES)
    assert len(MAP_CATEGORIES) == 15
