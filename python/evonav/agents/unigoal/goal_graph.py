"""UniGoal's goal graph, and its match with the scene graph."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from evonav.agents.unigoal.object_graph import Node, Relations, name_of
from evonav.points import Point2

MatchMode = Literal["code", "paper"]
"""The names of scene nodes that are compared with a goal's words.

`code`: names with a number, as released, so that they never equal a word; `paper`: captions."""

MAX_GOAL_NODES = 5
"""Largest number of objects that a goal graph has."""

_ON = frozenset({"on", "atop", "upon", "in", "inside", "within"})
_UNDER = frozenset({"under", "below", "beneath", "underneath"})
_NEAR = frozenset({"next", "near", "nearby", "beside", "by", "close", "adjacent", "alongside", "against"})


@dataclass(frozen=True, slots=True)
class GoalEdge:
    """`subject` is `relation` `object`."""

    subject: str
    relation: str
    object: str


@dataclass(frozen=True, slots=True)
class GoalGraph:
    """Words for objects, the target first, and their relations."""

    nodes: tuple[str, ...]
    edges: tuple[GoalEdge, ...] = ()

    def degree(self, node: str) -> int:
        """Return the number of edges at a node."""
        return sum(node in (edge.subject, edge.object) for edge in self.edges)


@dataclass(frozen=True, slots=True)
class Match:
    """The part of a goal graph that is found in the scene graph."""

    score: float
    """The score S, 0 to 1."""
    anchors: Mapping[str, int]
    """Ids of the matched scene nodes by goal node, in the goal graph's order."""


def relation_kind(relation: str) -> str:
    """Return `on`, `under` or `near`; any other relation is a kind of its own."""
    tokens = relation.lower().split()
    first = tokens[0] if tokens else ""
    for kind, known in (("on", _ON), ("under", _UNDER), ("near", _NEAR)):
        if first in known:
            return kind
    return " ".join(tokens)


def is_edge_in(goal: GoalEdge, subject_id: int, object_id: int, relations: Relations) -> bool:
    """Return whether the scene relates two nodes as the goal does, in either direction (`on` is `under` mirrored)."""
    wanted = relation_kind(goal.relation)
    forward = relations.get((subject_id, object_id))
    if forward is not None and relation_kind(forward) == wanted:
        return True
    backward = relations.get((object_id, subject_id))
    mirrored = {"on": "under", "under": "on"}.get(wanted, wanted)
    return backward is not None and relation_kind(backward) == mirrored


def match_graphs(
    goal: GoalGraph, nodes: Sequence[Node], relations: Relations, mode: MatchMode, spell: Callable[[str], str]
) -> Match:
    """Score how well the scene graph matches a goal graph.

    S is the mean of node and edge similarity. Node similarity: mean of the share of goal nodes found and of how well
    their degrees agree (less over more; 0 if none is found). Edge similarity: share of goal edges found, 1 if there is
    none. A scene node's degree counts edges to other found nodes that the goal relates too: the scene graph joins every
    pair of nodes, so that its full degree would agree with no goal.

    Args:
        mode: The names of scene nodes.
        spell: Returns one spelling for a word, such as `sofa` for "couch".
    """
    spelt = {word: spell(word) for word in goal.nodes}
    by_name: dict[str, list[Node]] = {}
    for node in nodes:
        name = name_of(node) if mode == "code" else spell(node.label)
        by_name.setdefault(name, []).append(node)
    anchors = _assigned(goal, {word: by_name.get(name, []) for word, name in spelt.items()}, relations)
    found = [edge for edge in goal.edges if _holds(edge, anchors, relations)]
    edge_similarity = len(found) / len(goal.edges) if goal.edges else 1.0
    agreements = []
    for word in anchors:
        wanted, matched = goal.degree(word), sum(word in (edge.subject, edge.object) for edge in found)
        agreements.append(1.0 if wanted == matched else min(wanted, matched) / max(wanted, matched))
    share = len(anchors) / len(goal.nodes)
    agreement = math.fsum(agreements) / len(agreements) if agreements else 0.0
    return Match(((share + agreement) / 2.0 + edge_similarity) / 2.0, anchors)


def _holds(edge: GoalEdge, anchors: Mapping[str, int], relations: Relations) -> bool:
    subject, other = anchors.get(edge.subject), anchors.get(edge.object)
    return subject is not None and other is not None and is_edge_in(edge, subject, other, relations)


def _assigned(goal: GoalGraph, candidates: Mapping[str, Sequence[Node]], relations: Relations) -> dict[str, int]:
    """Assign scene nodes to goal nodes: around each candidate of the first one, those that satisfy most edges."""
    found = [word for word in goal.nodes if candidates[word]]
    best: tuple[tuple[int, int, int], dict[str, int]] | None = None
    for first in candidates[found[0]] if found else ():
        anchors = {found[0]: first.entry_id}
        for word in found[1:]:
            free = [node for node in candidates[word] if node.entry_id not in anchors.values()]
            costs = [
                (
                    -_num_matched(goal, {**anchors, word: one.entry_id}, relations),
                    math.dist(one.ground_m, first.ground_m),
                )
                for one in free
            ]
            if free:
                anchors[word] = free[costs.index(min(costs))].entry_id
        key = (_num_matched(goal, anchors, relations), first.num_detections, -first.entry_id)
        if best is None or key > best[0]:
            best = (key, anchors)
    return {} if best is None else best[1]


def _num_matched(goal: GoalGraph, anchors: Mapping[str, int], relations: Relations) -> int:
    return sum(_holds(edge, anchors, relations) for edge in goal.edges)


def similarity_transform(layout: Sequence[Point2], places_m: Sequence[Point2], point: Point2) -> Point2 | None:
    """Return where a point of a layout is, given two others at known places: turned, scaled and shifted.

    Args:
        layout: Two places in the layout's frame.
        places_m: The same two places, `(x, z)` in the world.
        point: A place in the layout's frame.

    Returns:
        `(x, z)`; `None` if the two coincide in the layout.
    """
    a, b = (complex(*place) for place in layout)
    to_a, to_b = (complex(*place) for place in places_m)
    if abs(b - a) < 1e-9:
        return None
    there = to_a + (to_b - to_a) / (b - a) * (complex(*point) - a)
    return (there.real, there.imag)
