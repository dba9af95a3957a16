"""Questions of UniGoal about the scene graph: relations, groups, layout, corrections.

The rules judge relations of scene nodes by their boxes; they do not guess them from names. Corrections touch relations
alone: no box can tell what a node is, or whether it is there.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from evonav.agents.unigoal.goal_graph import GoalGraph, relation_kind
from evonav.agents.unigoal.object_graph import Node, Relations, middle_of, name_of
from evonav.agents.unigoal.questions import parse_relation, relation_line
from evonav.decision.prompts import Prompt
from evonav.decision.question import AnswerError, ClosedQuestion, Question, first_line, lines_of
from evonav.decision.text.language import canonical
from evonav.decision.text.matcher import ROOM_SIGNS, Matcher, gap_m
from evonav.points import Point2
from evonav.tasks.public import Goal

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
_PLACE = re.compile(rf"(.+?): \(({_NUMBER}), ({_NUMBER})\)\.?")
_VERDICT = re.compile(r"(keep|delete|rename to ([a-z][a-z -]*))\.?", re.IGNORECASE)
RENAME = "rename to "
"""Beginning of a verdict that has another word."""
_APART = "away from"
_BESIDE_M = 0.7
"""Distance of the layout between an object and one next to it."""


def describe_graph(graph: GoalGraph) -> str:
    """Return a goal graph in words."""
    relations = "; ".join(f"{edge.subject} is {edge.relation} {edge.object}" for edge in graph.edges)
    return f"objects [{', '.join(graph.nodes)}]" + (f", relations: {relations}" if relations else "")


def lines_for(things: Sequence[object], noun: str, text: str) -> list[str]:
    """Return the lines of an answer that has one for each of some things, which `noun` names; else `AnswerError`."""
    lines = lines_of(text)
    if len(lines) != len(things):
        raise AnswerError("invalid", f"{len(lines)} lines for {len(things)} {noun}", text)
    return lines


def lines_schema(num: int) -> Mapping[str, Any]:
    """Return the schema of an array of `num` lines."""
    return {"type": "array", "items": {"type": "string"}, "minItems": num, "maxItems": num}


@dataclass(frozen=True, slots=True)
class RelationLinesQuestion(Question[tuple[str, ...]]):
    """Ask for the relations of new nodes of the scene graph to the others, in one call for all pairs."""

    kind: ClassVar[str] = "scene-relations"
    goal: Goal
    pairs: Sequence[tuple[Node, Node]]

    def prompt(self) -> Prompt:
        """Show the pairs by name; the model is shown no image, as in the original."""
        pairs = "\n".join(f"{name_of(a)} and {name_of(b)}" for a, b in self.pairs)
        return Prompt.of(
            f"These are pairs of objects in a home:\n{pairs}\nHow do they most likely stand to each other? Answer "
            f"with exactly {len(self.pairs)} lines, one a pair in the same order, exactly of the form\n"
            'A and B: A is <relation> B\nsuch as "mug_1 and table_2: mug_1 is on table_2".',
        )

    def parse(self, text: str) -> tuple[str, ...]:
        """Read `A and B: A is <relation> B` for each pair."""
        relations = []
        for line, pair in zip(lines_for(self.pairs, "pairs", text), self.pairs, strict=True):
            a, b = map(name_of, pair)
            read = parse_relation(line)
            if read is None or (read[0], read[2]) != (a, b):
                raise AnswerError("invalid", f"no relation of {a} to {b}: {line[:80]!r}", text)
            relations.append(read[1])
        return tuple(relations)

    def answer_text(self, answer: tuple[str, ...]) -> str:
        """Return one line a pair."""
        named = [(name_of(a), name_of(b), relation) for (a, b), relation in zip(self.pairs, answer, strict=True)]
        return "\n".join(relation_line(a, b, a, relation, b) for a, b, relation in named)

    def answer_schema(self) -> Mapping[str, Any]:
        """Return the schema of a line for each pair."""
        return lines_schema(len(self.pairs))

    def by_rule(self, matcher: Matcher) -> tuple[tuple[str, ...], str]:
        """Relate nodes by their boxes: on, under, next to, or apart."""
        return tuple(_relation(matcher, a, b) for a, b in self.pairs), "judged by boxes"


@dataclass(frozen=True, slots=True)
class RoomQuestion(ClosedQuestion[str]):
    """Ask in which room the goal likely is."""

    kind: ClassVar[str] = "room"
    goal: Goal
    subgraph: GoalGraph
    rooms: tuple[str, ...]
    """Rooms that have nodes."""

    def prompt(self) -> Prompt:
        """Show the goal's subgraph, and the rooms."""
        return Prompt.of(
            f"A robot looks for {self.subgraph.nodes[0]}: {describe_graph(self.subgraph)}. In which of these rooms "
            f"is it most likely: [{', '.join(self.rooms)}]? Answer on the first line with exactly one of them.",
        )

    def parse(self, text: str) -> str:
        """Read the first line, which must name exactly one of the rooms."""
        line = first_line(text).lower()
        named = [room for room in self.rooms if re.search(rf"\b{re.escape(room)}\b", line)]
        if len(named) != 1:
            raise AnswerError("invalid", f"names {len(named)} of the rooms: {line[:80]!r}", text)
        return named[0]

    def choices(self) -> Sequence[str]:
        """Return the rooms."""
        return self.rooms

    def by_rule(self, matcher: Matcher) -> tuple[str, str]:
        """Choose the room that the instruction names; else the one where the target usually is; else the first."""
        stated = matcher.parsed(self.goal).room
        usual = next((kind for kind, signs in ROOM_SIGNS.items() if canonical(self.subgraph.nodes[0]) in signs), None)
        for found, reason in ((stated, "named"), (usual, "where it mostly stands")):
            if found in self.rooms and found is not None:
                return found, reason
        return self.rooms[0], "nothing tells"


@dataclass(frozen=True, slots=True)
class GroupScoreQuestion(Question[float]):
    """Ask how likely the goal is near this group; the original asks in a dialogue of four turns."""

    kind: ClassVar[str] = "group-score"
    goal: Goal
    subgraph: GoalGraph
    group: Sequence[Node]
    relations: Relations
    """Relations within the group."""
    nodes: Sequence[Node]
    """All nodes, for rules that judge by surroundings. Not part of the prompt."""

    def prompt(self) -> Prompt:
        """Show the goal's subgraph, and the group."""
        relations = _sentences(self.group, self.relations)
        return Prompt.of(
            f"A robot looks for {self.subgraph.nodes[0]}: {describe_graph(self.subgraph)}.\nIt knows a group of "
            f"objects that stand together: [{', '.join(map(name_of, self.group))}]"
            + (f", relations: {'; '.join(relations)}" if relations else "")
            + ".\nHow likely is it to find the goal near this group? Answer on the first line with exactly one "
            "number from 0 to 1.",
        )

    def parse(self, text: str) -> float:
        """Read a number from 0 to 1."""
        line = first_line(text)
        value = float(line) if re.fullmatch(_NUMBER, line) else math.nan
        if not 0.0 <= value <= 1.0:
            raise AnswerError("invalid", f"no number from 0 to 1: {line[:80]!r}", text)
        return value

    def answer_text(self, answer: float) -> str:
        """Return the number."""
        return f"{answer:.3f}"

    def answer_schema(self) -> Mapping[str, Any]:
        """Return the schema of a number as text."""
        return {"type": "string", "pattern": "^(0([.][0-9]{1,6})?|1([.]0{1,6})?)$"}

    def alternatives(self, answer: float) -> Sequence[float]:
        """Return the other end of the scale."""
        return [0.0 if answer >= 0.5 else 1.0]

    def by_rule(self, matcher: Matcher) -> tuple[float, str]:
        """Score how well the best member's caption fits the goal, with a bonus for the right room."""
        goal = matcher.parsed(self.goal)
        score = max(matcher.label_score(goal, node.label) for node in self.group)
        if goal.room is not None:
            score += 0.2 * float(matcher.room_around(middle_of(self.group), self.nodes) == goal.room)
        return round(min(1.0, score), 3), "words compared"


@dataclass(frozen=True, slots=True)
class LayoutQuestion(Question[Mapping[str, Point2]]):
    """Ask how the goal's objects lie to each other, seen from above."""

    kind: ClassVar[str] = "layout"
    goal: Goal
    subgraph: GoalGraph
    anchors: Mapping[str, Node]
    """Goal nodes that the scene graph has. Their places are not part of the prompt."""

    def prompt(self) -> Prompt:
        """Show the goal's subgraph; the first two anchors fix scale and direction."""
        return Prompt.of(
            f"This is a goal of a robot: {describe_graph(self.subgraph)}. Guess where the objects lie, seen from "
            f"above, in metres. Answer with exactly {len(self.subgraph.nodes)} lines, one an object in the same "
            'order, exactly of the form\nobject: (x, y)\nsuch as "table: (0, 1.5)". '
            f"No two of [{', '.join(self.anchors)}] may be at the same place.",
        )

    def parse(self, text: str) -> Mapping[str, Point2]:
        """Read `object: (x, y)` for each object; no two anchors may be at the same place."""
        places: dict[str, Point2] = {}
        words = self.subgraph.nodes
        for line, word in zip(lines_for(words, "objects", text), words, strict=True):
            match = _PLACE.fullmatch(line)
            if match is None or match[1].lower() != word:
                raise AnswerError("invalid", f"no place of {word}: {line[:80]!r}", text)
            places[word] = (float(match[2]), float(match[3]))
        at = [places[word] for word in self.anchors]
        if len(set(at)) < len(at):
            raise AnswerError("invalid", "two known objects at one place", text)
        return places

    def answer_text(self, answer: Mapping[str, Point2]) -> str:
        """Return one line an object."""
        return "\n".join(f"{word}: ({answer[word][0]:.3f}, {answer[word][1]:.3f})" for word in self.subgraph.nodes)

    def answer_schema(self) -> Mapping[str, Any]:
        """Return the schema of a line for each object."""
        return lines_schema(len(self.subgraph.nodes))

    def by_rule(self, matcher: Matcher) -> tuple[Mapping[str, Point2], str]:
        """Place anchors where they are, objects on them there, and objects next to them a step towards the others."""
        at = {word: node.ground_m for word, node in self.anchors.items()}
        mean = (sum(x for x, _ in at.values()) / len(at), sum(z for _, z in at.values()) / len(at))
        places = dict(at)
        for word in self.subgraph.nodes:
            if word in at:
                continue
            offers = [
                _beside(at[other], mean, relation_kind(edge.relation))
                for edge in self.subgraph.edges
                for subject, other in ((edge.subject, edge.object), (edge.object, edge.subject))
                if subject == word and other in at
            ] or [mean]
            places[word] = (sum(x for x, _ in offers) / len(offers), sum(z for _, z in offers) / len(offers))
        return {word: (round(x, 3), round(z, 3)) for word, (x, z) in places.items()}, "from known places"


@dataclass(frozen=True, slots=True)
class CorrectionQuestion(Question[tuple[str, ...]]):
    """Ask which parts of the scene graph around the goal are right: `keep`, `delete` or `rename to <word>`."""

    kind: ClassVar[str] = "correction"
    goal: Goal
    subgraph: GoalGraph
    nodes: Sequence[Node]
    """Nodes within two hops of the match."""
    relations: Relations
    """Relations between the nodes."""

    def prompt(self) -> Prompt:
        """Show nodes and edges, numbered."""
        things = [*map(name_of, self.nodes), *_sentences(self.nodes, self.relations)]
        listed = "\n".join(f"{index}: {thing}" for index, thing in enumerate(things))
        return Prompt.of(
            f"A robot looks for {describe_graph(self.subgraph)}. It has found this, objects first, then "
            f"relations:\n{listed}\nSome may be wrong. Answer with exactly {len(things)} lines, one a number in "
            'the same order: the number, a colon, and exactly "keep", "delete" or "rename to <word>" (for a '
            "relation: what it is).",
        )

    def parse(self, text: str) -> tuple[str, ...]:
        """Read `<number>: keep | delete | rename to <word>`, a line for each node, then for each edge."""
        verdicts = []
        for index, line in enumerate(lines_for([*self.nodes, *self.relations], "nodes and edges", text)):
            number, _, decision = line.partition(":")
            match = _VERDICT.fullmatch(decision.strip())
            if number.strip() != str(index) or match is None:
                raise AnswerError("invalid", f"no verdict on {index}: {line[:80]!r}", text)
            verdicts.append(match[1].strip().lower())
        return tuple(verdicts)

    def answer_text(self, answer: tuple[str, ...]) -> str:
        """Return one line a verdict."""
        return "\n".join(f"{index}: {verdict}" for index, verdict in enumerate(answer))

    def answer_schema(self) -> Mapping[str, Any]:
        """Return the schema of a line for each node and each edge."""
        return lines_schema(len(self.nodes) + len(self.relations))

    def by_rule(self, matcher: Matcher) -> tuple[tuple[str, ...], str]:
        """Judge relations as boxes have them now: boxes grow after an edge was made."""
        node_of = {node.entry_id: node for node in self.nodes}
        verdicts = ["keep"] * len(self.nodes)
        for (a, b), known in self.relations.items():
            relation = _relation(matcher, node_of[a], node_of[b])
            verdicts.append("keep" if relation == known else f"{RENAME}{relation}")
        return tuple(verdicts), "judged by boxes"


def _sentences(nodes: Sequence[Node], relations: Relations) -> list[str]:
    """Return each relation in words."""
    name = {node.entry_id: name_of(node) for node in nodes}
    return [f"{name[a]} is {relation} {name[b]}" for (a, b), relation in relations.items()]


def _relation(matcher: Matcher, a: Node, b: Node) -> str:
    """Return how a node stands to another, by their boxes."""
    apart_m = gap_m(a, b)
    if apart_m > matcher.near_m:
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
