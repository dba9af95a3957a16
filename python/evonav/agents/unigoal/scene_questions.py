"""Questions of UniGoal about the scene graph: relations, groups, layout, corrections."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from evonav.agents.unigoal import rules
from evonav.agents.unigoal.goal_graph import GoalGraph
from evonav.agents.unigoal.object_graph import Group, SceneEdge, SceneNode, Verdict
from evonav.agents.unigoal.questions import parse_relation, relation_line
from evonav.decision.candidates import Point2
from evonav.decision.prompts import Prompt, Text
from evonav.decision.question import AnswerError, ClosedQuestion, Question, first_line, lines_of
from evonav.decision.text.matcher import Matcher
from evonav.tasks.public import StageInput

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
_PLACE = re.compile(rf"(.+?): \(({_NUMBER}), ({_NUMBER})\)\.?")
_VERDICT = re.compile(r"(keep|delete|rename to ([a-z][a-z -]*))\.?", re.IGNORECASE)


def describe_graph(graph: GoalGraph) -> str:
    """Return a goal graph in words."""
    relations = "; ".join(f"{edge.subject} is {edge.relation} {edge.object}" for edge in graph.edges)
    return f"objects [{', '.join(graph.nodes)}]" + (f", relations: {relations}" if relations else "")


@dataclass(frozen=True, slots=True)
class RelationLinesQuestion(Question[tuple[str, ...]]):
    """Ask for the relations of new nodes of the scene graph to the others, in one call for all pairs."""

    kind: ClassVar[str] = "scene-relations"
    goal: StageInput
    pairs: Sequence[tuple[SceneNode, SceneNode]]

    def prompt(self) -> Prompt:
        """Show the pairs by name; the model is shown no image, as in the original."""
        pairs = "\n".join(f"{a.name} and {b.name}" for a, b in self.pairs)
        return Prompt.of(
            Text(
                f"These are pairs of objects in a home:\n{pairs}\nHow do they most likely stand to each other? Answer "
                f"with exactly {len(self.pairs)} lines, one a pair in the same order, exactly of the form\n"
                'A and B: A is <relation> B\nsuch as "mug_1 and table_2: mug_1 is on table_2".'
            )
        )

    def parse(self, text: str) -> tuple[str, ...]:
        """Read one line for each pair, in the order of the pairs."""
        lines = lines_of(text)
        if len(lines) != len(self.pairs):
            raise AnswerError("invalid", f"{len(lines)} lines for {len(self.pairs)} pairs", text)
        relations = []
        for line, (a, b) in zip(lines, self.pairs, strict=True):
            read = parse_relation(line)
            if read is None or (read[0], read[2]) != (a.name, b.name):
                raise AnswerError("invalid", f"no relation of {a.name} to {b.name}: {line[:80]!r}", text)
            relations.append(read[1])
        return tuple(relations)

    def answer_text(self, answer: tuple[str, ...]) -> str:
        """Return one line a pair."""
        named = [(a.name, b.name, relation) for (a, b), relation in zip(self.pairs, answer, strict=True)]
        return "\n".join(relation_line(a, b, a, relation, b) for a, b, relation in named)

    def answer_schema(self) -> Mapping[str, Any]:
        """Return the schema of an array with a line for each pair."""
        num = len(self.pairs)
        return {"type": "array", "items": {"type": "string"}, "minItems": num, "maxItems": num}

    def by_rule(self, matcher: Matcher) -> tuple[tuple[str, ...], str]:
        """Return the text matcher's answer and the reason for it."""
        return rules.scene_relations(matcher, self)


@dataclass(frozen=True, slots=True)
class RoomQuestion(ClosedQuestion[str]):
    """Ask in which room the goal likely is."""

    kind: ClassVar[str] = "room"
    goal: StageInput
    subgraph: GoalGraph
    rooms: tuple[str, ...]
    """Rooms that have nodes."""

    def prompt(self) -> Prompt:
        """Show the goal's subgraph, and the rooms."""
        return Prompt.of(
            Text(
                f"A robot looks for {self.subgraph.nodes[0]}: {describe_graph(self.subgraph)}. In which of these rooms "
                f"is it most likely: [{', '.join(self.rooms)}]? Answer on the first line with exactly one of them."
            )
        )

    def parse(self, text: str) -> str:
        """Read the first line, which must name exactly one of the rooms."""
        line = first_line(text).lower()
        named = [room for room in self.rooms if re.search(rf"\b{re.escape(room)}\b", line)]
        if len(named) != 1:
            raise AnswerError("invalid", f"names {len(named)} of the rooms: {line[:80]!r}", text)
        return named[0]

    def answer_text(self, answer: str) -> str:
        """Return the room."""
        return answer

    def choices(self) -> Sequence[str]:
        """Return the rooms."""
        return self.rooms

    def by_rule(self, matcher: Matcher) -> tuple[str, str]:
        """Return the text matcher's answer and the reason for it."""
        return rules.room(matcher, self)


@dataclass(frozen=True, slots=True)
class GroupScoreQuestion(Question[float]):
    """Ask how likely the goal is near this group; the original asks in a dialogue of four turns."""

    kind: ClassVar[str] = "group-score"
    goal: StageInput
    subgraph: GoalGraph
    group: Group
    edges: Sequence[SceneEdge]
    """Edges within the group."""
    nodes: Sequence[SceneNode]
    """All nodes, for rules that judge by surroundings. Not part of the prompt."""

    def prompt(self) -> Prompt:
        """Show the goal's subgraph, and the group."""
        name = {node.id: node.name for node in self.group.nodes}
        relations = [f"{name[e.subject_id]} is {e.relation} {name[e.object_id]}" for e in self.edges]
        return Prompt.of(
            Text(
                f"A robot looks for {self.subgraph.nodes[0]}: {describe_graph(self.subgraph)}.\nIt knows a group of "
                f"objects that stand together: [{', '.join(name.values())}]"
                + (f", relations: {'; '.join(relations)}" if relations else "")
                + ".\nHow likely is it to find the goal near this group? Answer on the first line with exactly one "
                "number from 0 to 1."
            )
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
        return {"type": "string", "pattern": r"^(0(\.\d+)?|1(\.0+)?)$"}

    def alternatives(self, answer: float) -> Sequence[float]:
        """Return the other end of the scale."""
        return [0.0 if answer >= 0.5 else 1.0]

    def by_rule(self, matcher: Matcher) -> tuple[float, str]:
        """Return the text matcher's answer and the reason for it."""
        return rules.group_score(matcher, self)


@dataclass(frozen=True, slots=True)
class LayoutQuestion(Question[Mapping[str, Point2]]):
    """Ask how the goal's objects lie to each other, seen from above."""

    kind: ClassVar[str] = "layout"
    goal: StageInput
    subgraph: GoalGraph
    anchors: Mapping[str, SceneNode]
    """Goal nodes that the scene graph has. Their places are not part of the prompt."""

    def prompt(self) -> Prompt:
        """Show the goal's subgraph; the first two anchors fix scale and direction."""
        return Prompt.of(
            Text(
                f"This is a goal of a robot: {describe_graph(self.subgraph)}. Guess where the objects lie, seen from "
                f"above, in metres. Answer with exactly {len(self.subgraph.nodes)} lines, one an object in the same "
                'order, exactly of the form\nobject: (x, y)\nsuch as "table: (0, 1.5)". '
                f"No two of [{', '.join(self.anchors)}] may be at the same place."
            )
        )

    def parse(self, text: str) -> Mapping[str, Point2]:
        """Read `object: (x, y)` for each object in order; no two anchors may be at the same place."""
        lines = lines_of(text)
        if len(lines) != len(self.subgraph.nodes):
            raise AnswerError("invalid", f"{len(lines)} lines for {len(self.subgraph.nodes)} objects", text)
        places: dict[str, Point2] = {}
        for line, word in zip(lines, self.subgraph.nodes, strict=True):
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
        """Return the schema of an array with a line for each object."""
        num = len(self.subgraph.nodes)
        return {"type": "array", "items": {"type": "string"}, "minItems": num, "maxItems": num}

    def by_rule(self, matcher: Matcher) -> tuple[Mapping[str, Point2], str]:
        """Return the text matcher's answer and the reason for it."""
        return rules.layout(matcher, self)


@dataclass(frozen=True, slots=True)
class CorrectionQuestion(Question[tuple[Verdict, ...]]):
    """Ask which parts of the scene graph around the goal are right."""

    kind: ClassVar[str] = "correction"
    goal: StageInput
    subgraph: GoalGraph
    nodes: Sequence[SceneNode]
    """Nodes within two hops of the match."""
    edges: Sequence[SceneEdge]
    """Edges between the nodes."""

    def prompt(self) -> Prompt:
        """Show nodes and edges, numbered."""
        name = {node.id: node.name for node in self.nodes}
        things = [
            *(node.name for node in self.nodes),
            *(f"{name[e.subject_id]} is {e.relation} {name[e.object_id]}" for e in self.edges),
        ]
        listed = "\n".join(f"{index}: {thing}" for index, thing in enumerate(things))
        return Prompt.of(
            Text(
                f"A robot looks for {describe_graph(self.subgraph)}. It has found this, objects first, then "
                f"relations:\n{listed}\nSome may be wrong. Answer with exactly {len(things)} lines, one a number in "
                'the same order: the number, a colon, and exactly "keep", "delete" or "rename to <word>" (for a '
                "relation: what it is)."
            )
        )

    def parse(self, text: str) -> tuple[Verdict, ...]:
        """Read `<number>: keep | delete | rename to <word>`, a line for each node, then for each edge."""
        lines, num = lines_of(text), len(self.nodes) + len(self.edges)
        if len(lines) != num:
            raise AnswerError("invalid", f"{len(lines)} lines for {num} nodes and edges", text)
        verdicts = []
        for index, line in enumerate(lines):
            number, _, decision = line.partition(":")
            match = _VERDICT.fullmatch(decision.strip())
            if number.strip() != str(index) or match is None:
                raise AnswerError("invalid", f"no verdict on {index}: {line[:80]!r}", text)
            if match[2] is not None:
                verdicts.append(Verdict("rename", match[2].strip().lower()))
            else:
                verdicts.append(Verdict("delete" if match[1].lower() == "delete" else "keep"))
        return tuple(verdicts)

    def answer_text(self, answer: tuple[Verdict, ...]) -> str:
        """Return one line a verdict."""
        return "\n".join(f"{index}: {verdict}" for index, verdict in enumerate(answer))

    def answer_schema(self) -> Mapping[str, Any]:
        """Return the schema of an array with a line for each node and edge."""
        num = len(self.nodes) + len(self.edges)
        return {"type": "array", "items": {"type": "string"}, "minItems": num, "maxItems": num}

    def by_rule(self, matcher: Matcher) -> tuple[tuple[Verdict, ...], str]:
        """Return the text matcher's answer and the reason for it."""
        return rules.correct(matcher, self)
