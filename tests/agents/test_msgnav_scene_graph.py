"""MSGNav's graph of objects and the views that show its edges."""

import numpy as np

from evonav.agents.msgnav.scene_graph import SceneGraph


def test_cover_is_greedy_and_complete():
    rng = np.random.default_rng(0)
    for _ in range(50):
        graph = SceneGraph()
        for view_id in range(20):
            ids = rng.choice(12, rng.integers(1, 5), replace=False)
            graph.add_view(view_id, {int(entry_id): (0.0, 0.0) for entry_id in ids})
        selected = [int(entry_id) for entry_id in rng.choice(12, 4, replace=False)]
        part = graph.subgraph(selected)
        assert part.pairs == tuple(p for p in graph.pairs if set(p) & set(selected))
        left, expected = set(part.pairs), []
        while left:
            best = max(range(20), key=lambda view_id: (len(left & set(edges_of(graph, view_id))), -view_id))
            expected.append(best)
            left -= set(edges_of(graph, best))
        assert part.view_ids == tuple(expected)


def edges_of(graph, view_id):
    """Pairs whose edge the view shows, ascending."""
    return [pair for pair in graph.pairs if view_id in graph.views_of(pair)]


def test_edges_join_what_one_view_shows_near_each_other_and_follow_merges():
    graph = SceneGraph(max_edge_m=3.5)
    graph.add_view(0, {1: (0.0, 0.0), 2: (3.5, 0.0), 3: (3.6, 0.0)})
    assert graph.pairs == [(1, 1), (1, 2), (2, 2), (2, 3), (3, 3)]
    graph.add_view(1, {2: (0.0, 0.0), 3: (0.1, 0.0)})
    assert (graph.views_of((2, 3)), edges_of(graph, 1)) == ([0, 1], [(2, 2), (2, 3), (3, 3)])
    graph.follow({3: 2})
    assert graph.pairs == [(1, 1), (1, 2), (2, 2)]
    assert (graph.views_of((2, 2)), edges_of(graph, 1)) == ([0, 1], [(2, 2)])
    graph.prune([2])
    assert (graph.pairs, edges_of(graph, 0), graph.neighbours()) == ([(2, 2)], [(2, 2)], {2: set()})
