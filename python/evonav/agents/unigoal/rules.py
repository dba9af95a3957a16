"""Rules for what UniGoal asks. Like a language model without images they know words; unlike one, also boxes.

Relations of scene nodes are judged by their boxes, not guessed from their names. Corrections touch relations alone:
what a node is and whether it is there, no box can tell.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from evonav.agents.unigoal.goal_graph import MAX_GOAL_NODES, GoalEdge, GoalGraph, relation_kind
from evonav.agents.unigoal.object_graph import SceneNode, Verdict
from evonav.decision.candidates import ObjectCandidate, Point2
from evonav.decision.text.language import canonical, parse_goal
from evonav.decision.text.matcher import ROOM_SIGNS, Matcher, gap_m
from evonav.tasks.vocabulary import CATEGORY_OF_TYPE, MAP_CATEGORIES, NO_CATEGORY

if TYPE_CHECKING:
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

_CATEGORY_OF_NOUN = {
    **{canonical(category): category for category in MAP_CATEGORIES},
    **{canonical(kind): category for kind, category in CATEGORY_OF_TYPE.items()},
}
_APART = "away from"
_BESIDE_M = 0.7
"""Distance of the layout between an object and one next to it."""


def describe(_: Matcher, question: "DescribeQuestion") -> tuple[str, str]:
    """Return the category alone: rules do not see images."""
    return f"the {canonical(question.goal.category)}", "images are not looked at"


def objects(_: Matcher, question: "ObjectsQuestion") -> tuple[tuple[str, ...], str]:
    """Name the target, and the objects that it should be on or near."""
    goal = parse_goal(question.text, question.goal.category)
    nouns = (goal.noun, *(relation.noun for relation in goal.relations if relation.kind != "in"))
    return tuple(dict.fromkeys(nouns))[:MAX_GOAL_NODES], "read by rule"


def goal_relations(_: Matcher, question: "GoalRelationsQuestion") -> tuple[tuple[GoalEdge, ...], str]:
    """Return all relations of the target that the goal states."""
    goal = parse_goal(question.text, question.goal.category)
    stated = {"on": "on", "near": "next to"}
    edges = [
        GoalEdge(goal.noun, stated[relation.kind], relation.noun)
        for relation in goal.relations
        if relation.kind in stated and {goal.noun, relation.noun} <= set(question.objects)
    ]
    return tuple(dict.fromkeys(edges)), "read by rule"


def decompose(_: Matcher, question: "DecomposeQuestion") -> tuple[tuple[GoalGraph, ...], str]:
    """Return the connected components, the target's first."""
    graph = question.graph
    left, parts = list(graph.nodes), []
    while left:
        inside = {left[0]}
        while True:
            reached = {
                word
                for edge in graph.edges
                if inside & {edge.subject, edge.object}
                for word in (edge.subject, edge.object)
            }
            if reached <= inside:
                break
            inside |= reached
        left = [word for word in left if word not in inside]
        edges = tuple(edge for edge in graph.edges if edge.subject in inside)
        parts.append(GoalGraph(tuple(word for word in graph.nodes if word in inside), edges))
    return tuple(parts), "connected components"


def category(_: Matcher, question: "CategoryQuestion") -> tuple[str, str]:
    """Return the category of the target's noun."""
    found = _CATEGORY_OF_NOUN.get(canonical(question.target), NO_CATEGORY)
    return (found if found in question.categories else NO_CATEGORY), "looked up"


def scene_relations(matcher: Matcher, question: "RelationLinesQuestion") -> tuple[tuple[str, ...], str]:
    """Relate nodes by their boxes: on, under, next to, or apart."""
    known: dict[int, ObjectCandidate] = {}
    for pair in question.pairs:
        for node in pair:
            known.setdefault(node.id, _candidate(node))
    return tuple(_relation(matcher, known[a.id], known[b.id]) for a, b in question.pairs), "judged by boxes"


def room(matcher: Matcher, question: "RoomQuestion") -> tuple[str, str]:
    """Choose the room that the instruction names; else the one where the target usually is; else the first."""
    stated = matcher.parsed(question.goal).room
    usual = next((kind for kind, signs in ROOM_SIGNS.items() if canonical(question.subgraph.nodes[0]) in signs), None)
    for found, reason in ((stated, "named"), (usual, "where it mostly stands")):
        if found in question.rooms and found is not None:
            return found, reason
    return question.rooms[0], "nothing tells"


def group_score(matcher: Matcher, question: "GroupScoreQuestion") -> tuple[float, str]:
    """Score how well the best member's caption fits the goal, with a bonus for the right room."""
    goal = matcher.parsed(question.goal)
    score = max(matcher.label_score(goal, node.caption) for node in question.group.nodes)
    if goal.room is not None:
        around = [_candidate(node) for node in question.nodes]
        score += 0.2 * float(matcher.room_around(question.group.centre_m, around) == goal.room)
    return round(min(1.0, score), 3), "words compared"


def layout(_: Matcher, question: "LayoutQuestion") -> tuple[Mapping[str, Point2], str]:
    """Place anchors where they are, objects on them there, and objects next to them a step towards the others."""
    at = {word: node.ground_m for word, node in question.anchors.items()}
    mean = (sum(x for x, _ in at.values()) / len(at), sum(z for _, z in at.values()) / len(at))
    places = dict(at)
    for word in question.subgraph.nodes:
        if word in at:
            continue
        offers = [
            _beside(at[other], mean, relation_kind(edge.relation))
            for edge in question.subgraph.edges
            for subject, other in ((edge.subject, edge.object), (edge.object, edge.subject))
            if subject == word and other in at
        ] or [mean]
        places[word] = (sum(x for x, _ in offers) / len(offers), sum(z for _, z in offers) / len(offers))
    return {word: (round(x, 3), round(z, 3)) for word, (x, z) in places.items()}, "from known places"


def correct(matcher: Matcher, question: "CorrectionQuestion") -> tuple[tuple[Verdict, ...], str]:
    """Relations as boxes have them now: they grow after an edge was made."""
    known = {node.id: _candidate(node) for node in question.nodes}
    verdicts = [Verdict("keep")] * len(question.nodes)
    for edge in question.edges:
        relation = _relation(matcher, known[edge.subject_id], known[edge.object_id])
        verdicts.append(Verdict("keep") if relation == edge.relation else Verdict("rename", relation))
    return tuple(verdicts), "judged by boxes"


def _candidate(node: SceneNode) -> ObjectCandidate:
    return ObjectCandidate(node.id, node.caption, node.centre_m, node.size_m, node.num_detections)


def _relation(matcher: Matcher, a: ObjectCandidate, b: ObjectCandidate) -> str:
    apart_m = gap_m(a, b)
    if apart_m > matcher.config.near_m:
        return _APART
    if apart_m == 0.0:
        # Of two things in one place the one with the higher bottom is on the other.
        a_bottom_m, b_bottom_m = (thing.centre_m[1] - thing.size_m[1] / 2.0 for thing in (a, b))
        if a_bottom_m > b_bottom_m and matcher.is_on(a, b):
            return "on"
        if b_bottom_m > a_bottom_m and matcher.is_on(b, a):
            return "under"
    return "next to"


def _beside(place: Point2, towards: Point2, kind: str) -> Point2:
    if kind != "near":
        return place
    dx, dz = towards[0] - place[0], towards[1] - place[1]
    length = (dx * dx + dz * dz) ** 0.5
    if length == 0.0:
        return (place[0] + _BESIDE_M, place[1])
    return (place[0] + _BESIDE_M * dx / length, place[1] + _BESIDE_M * dz / length)
