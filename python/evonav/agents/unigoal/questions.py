"""Questions of UniGoal about the goal: its objects, their relations, subgraphs, its category.

The rules know words; like a language model without images, they look at none.
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from evonav.agents.unigoal.goal_graph import MAX_GOAL_NODES, GoalEdge, GoalGraph
from evonav.decision.pictures import Picture
from evonav.decision.prompts import Prompt
from evonav.decision.question import AnswerError, ClosedQuestion, Question, first_line, lines_of
from evonav.decision.text.language import canonical, parse_goal
from evonav.decision.text.matcher import Matcher
from evonav.tasks.public import Goal
from evonav.tasks.vocabulary import (
    ASSOCIATED_CATEGORY,
    CATEGORY_OF_TYPE,
    FALLBACK_CATEGORY,
    MAP_CATEGORIES,
    NO_CATEGORY,
)

_LIST = re.compile(r"\[([^\[\]]*)\]\.?")
_RELATION = re.compile(r"(?P<a>.+?) and (?P<b>.+?): (?P<rest>.+)")
_CATEGORY_OF_NOUN = {
    **{canonical(category): category for category in MAP_CATEGORIES},
    **{canonical(kind): category for kind, category in CATEGORY_OF_TYPE.items()},
}
_ASSOCIATED_CATEGORY_OF_NOUN = {canonical(kind): category for kind, category in ASSOCIATED_CATEGORY.items()}


def relation_line(a: str, b: str, subject: str, relation: str, object_: str) -> str:
    """Return `A and B: A is <relation> B`."""
    return f"{a} and {b}: {subject} is {relation} {object_}"


def parse_relation(line: str) -> tuple[str, str, str] | None:
    """Read `A and B: A is <relation> B`.

    Returns:
        Subject, relation and object; `None` if the line has another form, or relates anything but A and B.
    """
    match = _RELATION.fullmatch(line.strip().rstrip("."))
    if match is None:
        return None
    for subject, other in ((match["a"], match["b"]), (match["b"], match["a"])):
        found = re.fullmatch(rf"{re.escape(subject)} is (.+) {re.escape(other)}", match["rest"], re.IGNORECASE)
        if found is not None:
            return subject.lower(), found[1].lower(), other.lower()
    return None


@dataclass(frozen=True, slots=True)
class DescribeQuestion(Question[str]):
    """Ask what the goal image shows in its middle, and how that relates to its surroundings."""

    kind: ClassVar[str] = "describe"
    goal: Goal
    image: Picture = field(compare=False, repr=False)

    def prompt(self) -> Prompt:
        """Show the reference image."""
        return Prompt.of(
            self.image,
            "A robot is to find the object in the middle of this image. Describe it and how it stands to the "
            "things around it, in one sentence on one line.",
        )

    def parse(self, text: str) -> str:
        """Read the first line, which must contain a letter."""
        line = first_line(text)
        if re.search(r"[A-Za-z]", line) is None:
            raise AnswerError("invalid", "no description", text)
        return line

    def by_rule(self, matcher: Matcher) -> tuple[str, str]:
        """Return the category alone: rules do not see images."""
        return f"the {canonical(self.goal.category)}", "images are not looked at"


@dataclass(frozen=True, slots=True)
class ObjectsQuestion(Question[tuple[str, ...]]):
    """Ask which objects the goal mentions."""

    kind: ClassVar[str] = "goal-objects"
    goal: Goal
    text: str
    """The goal in words: the instruction, or the description of the goal image."""

    def prompt(self) -> Prompt:
        """Show the goal in words."""
        return Prompt.of(
            f"A robot is told: {self.text}\nWhich objects does this speak of? Rooms are no objects. Answer on the "
            f"first line with exactly [a, b, ...]: nouns without adjectives, the object to find first, at most "
            f"{MAX_GOAL_NODES}.",
        )

    def parse(self, text: str) -> tuple[str, ...]:
        """Read `[a, b, ...]`; the first five different words count."""
        match = _LIST.fullmatch(first_line(text))
        if match is None:
            raise AnswerError("invalid", f"no list in brackets: {first_line(text)[:80]!r}", text)
        names = [name.strip().strip("'\"").strip().lower() for name in match[1].split(",")]
        objects = tuple(dict.fromkeys(name for name in names if name))[:MAX_GOAL_NODES]
        if not objects:
            raise AnswerError("invalid", "an empty list", text)
        return objects

    def answer_text(self, answer: tuple[str, ...]) -> str:
        """Return `[a, b, ...]`."""
        return f"[{', '.join(answer)}]"

    def by_rule(self, matcher: Matcher) -> tuple[tuple[str, ...], str]:
        """Name the target, and the objects that it should be on or near."""
        goal = parse_goal(self.text, self.goal.category)
        nouns = (goal.noun, *(relation.noun for relation in goal.relations if relation.kind != "in"))
        return tuple(dict.fromkeys(nouns))[:MAX_GOAL_NODES], "read by rule"


@dataclass(frozen=True, slots=True)
class GoalRelationsQuestion(Question[tuple[GoalEdge, ...]]):
    """Ask for the relations between the goal's objects."""

    kind: ClassVar[str] = "goal-relations"
    goal: Goal
    text: str
    objects: tuple[str, ...]

    def prompt(self) -> Prompt:
        """Show the goal in words, and its objects."""
        return Prompt.of(
            f"A robot is told: {self.text}\nThe objects are [{', '.join(self.objects)}]. How do they stand to each "
            "other? Write one line for each relation that is said, exactly of the form\n"
            "A and B: A is <relation> B\nwith A and B from the list, such as "
            '"mug and table: mug is on table". If none is said, answer "none".',
        )

    def parse(self, text: str) -> tuple[GoalEdge, ...]:
        """Read lines of the form `A and B: A is <relation> B`; lines about objects off the list are left out."""
        lines = lines_of(text)
        if lines and lines[0].lower().rstrip(".") == "none":
            return ()
        edges: list[GoalEdge] = []
        for line in lines:
            read = parse_relation(line)
            if read is None:
                raise AnswerError("invalid", f"no relation: {line[:80]!r}", text)
            edge = GoalEdge(*read)
            if {edge.subject, edge.object} <= set(self.objects) and edge.subject != edge.object and edge not in edges:
                edges.append(edge)
        if not lines:
            raise AnswerError("invalid", "no line", text)
        return tuple(edges)

    def answer_text(self, answer: tuple[GoalEdge, ...]) -> str:
        """Return one line an edge."""
        lines = [relation_line(e.subject, e.object, e.subject, e.relation, e.object) for e in answer]
        return "\n".join(lines) or "none"

    def by_rule(self, matcher: Matcher) -> tuple[tuple[GoalEdge, ...], str]:
        """Return all relations of the target that the goal states."""
        goal = parse_goal(self.text, self.goal.category)
        stated = {"on": "on", "near": "next to"}
        edges = [
            GoalEdge(goal.noun, stated[relation.kind], relation.noun)
            for relation in goal.relations
            if relation.kind in stated and {goal.noun, relation.noun} <= set(self.objects)
        ]
        return tuple(dict.fromkeys(edges)), "read by rule"


@dataclass(frozen=True, slots=True)
class DecomposeQuestion(Question[tuple[GoalGraph, ...]]):
    """Ask into which parts the goal graph falls."""

    kind: ClassVar[str] = "decompose"
    goal: Goal
    graph: GoalGraph

    def prompt(self) -> Prompt:
        """Show the graph as JSON."""
        return Prompt.of(
            f"This is a graph of objects and relations: {_json_of(self.graph)}\nDivide it into subgraphs of "
            "objects that stand together. Answer with one line of JSON and nothing before it, exactly of the form\n"
            '{"subgraph_1": {"nodes": ["a", "b"], "edges": [["a", "on", "b"]]}, "subgraph_2": ...}\n'
            "Use only nodes and edges of the graph; the object to find belongs to subgraph_1.",
        )

    def parse(self, text: str) -> tuple[GoalGraph, ...]:
        """Read JSON at the beginning: numbered subgraphs of the graph's nodes and edges, the target in the first."""
        try:
            value, _ = json.JSONDecoder().raw_decode(text.strip())
        except ValueError as error:
            raise AnswerError("invalid", f"no JSON: {error}", text) from error
        if not isinstance(value, dict) or list(value) != [f"subgraph_{i + 1}" for i in range(len(value))] or not value:
            raise AnswerError("invalid", "no object of subgraph_1, subgraph_2, ...", text)
        subgraphs = tuple(self._subgraph(name, part, text) for name, part in value.items())
        if self.graph.nodes[0] not in subgraphs[0].nodes:
            raise AnswerError("invalid", f"subgraph_1 is without {self.graph.nodes[0]}", text)
        return subgraphs

    def _subgraph(self, name: str, part: object, text: str) -> GoalGraph:
        """Read one part, its nodes in the graph's order."""
        if not isinstance(part, dict) or set(part) != {"nodes", "edges"}:
            raise AnswerError("invalid", f"{name} is not nodes and edges", text)
        nodes, edges = part["nodes"], part["edges"]
        if not isinstance(nodes, list) or not nodes or not all(node in self.graph.nodes for node in nodes):
            raise AnswerError("invalid", f"{name} has other nodes than the graph, or none", text)
        if not isinstance(edges, list):
            raise AnswerError("invalid", f"{name} has no list of edges", text)
        known = {(edge.subject, edge.relation, edge.object): edge for edge in self.graph.edges}
        edges_inside: list[GoalEdge] = []
        for edge in edges:
            key = tuple(edge) if isinstance(edge, list) else ()
            if not all(isinstance(word, str) for word in key) or key not in known:
                raise AnswerError("invalid", f"{name} has an edge that the graph has not: {str(edge)[:80]}", text)
            if key[0] not in nodes or key[2] not in nodes:
                raise AnswerError("invalid", f"{name} has an edge that leaves it", text)
            edges_inside.append(known[key])
        return GoalGraph(tuple(node for node in self.graph.nodes if node in nodes), tuple(edges_inside))

    def answer_text(self, answer: tuple[GoalGraph, ...]) -> str:
        """Return JSON on one line."""
        parts = {f"subgraph_{i + 1}": json.loads(_json_of(graph)) for i, graph in enumerate(answer)}
        return json.dumps(parts)

    def answer_schema(self) -> Mapping[str, Any]:
        """Return the schema of a JSON text."""
        return {"type": "string"}

    def by_rule(self, matcher: Matcher) -> tuple[tuple[GoalGraph, ...], str]:
        """Return the connected components, the target's first."""
        graph = self.graph
        left, parts = list(graph.nodes), []
        while left:
            inside: set[str] = set()
            reached = {left[0]}
            while not reached <= inside:
                inside |= reached
                touching = [edge for edge in graph.edges if inside & {edge.subject, edge.object}]
                reached = {word for edge in touching for word in (edge.subject, edge.object)}
            left = [word for word in left if word not in inside]
            edges = tuple(edge for edge in graph.edges if edge.subject in inside)
            parts.append(GoalGraph(tuple(word for word in graph.nodes if word in inside), edges))
        return tuple(parts), "connected components"


def _json_of(graph: GoalGraph) -> str:
    edges = [[edge.subject, edge.relation, edge.object] for edge in graph.edges]
    return json.dumps({"nodes": list(graph.nodes), "edges": edges})


@dataclass(frozen=True, slots=True)
class CategoryQuestion(ClosedQuestion[str]):
    """Ask which of its detector's categories the goal is."""

    kind: ClassVar[str] = "category"
    goal: Goal
    text: str
    target: str
    """The object to find, as the goal graph calls it."""
    categories: tuple[str, ...]
    may_decline: bool
    """`none` is an answer, too; in the released code it is not."""

    def prompt(self) -> Prompt:
        """Show the goal in words, and the categories."""
        form = f'one of them, or with "{NO_CATEGORY}" if it is none of them.'
        if not self.may_decline:
            form = "one of them, the closest if it is something else."
        return Prompt.of(
            f"A robot is told: {self.text}\nIt is to find: {self.target}. Its detector knows "
            f"[{', '.join(self.categories)}]. Which of these is the object? Answer on the first line with exactly "
            f"{form}",
        )

    def choices(self) -> Sequence[str]:
        """Return the categories, and `none` where it is allowed."""
        return (*self.categories, NO_CATEGORY) if self.may_decline else self.categories

    def by_rule(self, matcher: Matcher) -> tuple[str, str]:
        """Return the category of the target's noun; without one, `none` or the one thought of first."""
        noun = canonical(self.target)
        found = _CATEGORY_OF_NOUN.get(noun)
        if found in self.categories:
            return found, "looked up"
        if self.may_decline:
            return NO_CATEGORY, "looked up"
        return _ASSOCIATED_CATEGORY_OF_NOUN.get(noun, FALLBACK_CATEGORY), "the closest"
