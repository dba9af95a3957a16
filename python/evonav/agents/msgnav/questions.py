"""Questions of MSGNav (arXiv 2511.10376): a subgraph, the next place, a frontier, and whether the target is reached.

docs/agents/msgnav.md lists where these questions differ from the original's.
Images are at most 512 px (`MsgNavConfig`); evonav's views have 300 px, so that they are shown as they were seen.

The rules look at no image. They know an image by the labels that were recorded with it, and the surroundings of an
agent that has arrived by the points of the last rounds' detections; size, shape and colour are never judged.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from evonav.agents.msgnav.memory import GraphChoice, GraphImage, GraphObject, PastChoice
from evonav.decision.candidates import FrontierCandidate, ObjectCandidate
from evonav.decision.pictures import Picture
from evonav.decision.prompts import Prompt, goal_prompt
from evonav.decision.question import AnswerError, ClosedQuestion, Question, YesNoQuestion, first_line, lines_of
from evonav.decision.text.language import ParsedGoal, canonical, is_structure, similarity
from evonav.decision.text.matcher import Matcher, gap_m
from evonav.decision.text.ranking import rank_entries
from evonav.points import Point2
from evonav.tasks.public import Goal

_ID = re.compile(r"(?:object\s+)?(\d+)[.,:;]?", re.IGNORECASE)
_OBJECT = re.compile(r"object\s+(\d+)[.]?", re.IGNORECASE)
_IMAGE = re.compile(r"image\s+(\d+)\s*,\s*([^,.;:\n]*[^\s,.;:])[.]?", re.IGNORECASE)
_EXPLORE = re.compile(r"continue\s+exploration[.]?", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class SubgraphQuestion(Question[tuple[int, ...]]):
    """Ask which objects help to find the goal (key subgraph selection)."""

    kind: ClassVar[str] = "subgraph"
    goal: Goal
    objects: Sequence[GraphObject]
    """The whole graph."""
    position_m: Point2
    """`(x, z)` of the agent. Not part of the prompt."""
    max_ids: int = 20

    def prompt(self) -> Prompt:
        """Show the whole graph as text, one line an object."""
        lines = [
            f"{node.entry_id}: {node.candidate.label}, {node.room}, "
            f"beside {', '.join(map(str, node.neighbour_ids)) or 'nothing'}"
            for node in self.objects
        ]
        graph = "\n".join(lines)
        return goal_prompt(
            self.goal,
            "The robot remembers a home as a graph. Its objects, one a line: id, class, room, ids of the objects "
            f"beside it.\n{graph}\nWhich objects help most to find the goal? Choose different ones, and rather none "
            "that are beside each other: what is beside a chosen object will be shown as well. Answer with ids, one "
            f"a line, the most helpful one first, at most {self.max_ids}, and with nothing else.",
        )

    def parse(self, text: str) -> tuple[int, ...]:
        """Read one id a line; lines that name no object of the graph are left out, and so are ids after `max_ids`."""
        known = {node.entry_id for node in self.objects}
        ids: list[int] = []
        for line in lines_of(text):
            match = _ID.fullmatch(line)
            if match is not None and int(match[1]) in known and int(match[1]) not in ids:
                ids.append(int(match[1]))
        if not ids:
            raise AnswerError("invalid", f"no line is the id of an object: {first_line(text)[:80]!r}", text)
        return tuple(ids[: self.max_ids])

    def answer_text(self, answer: tuple[int, ...]) -> str:
        """Return one id a line."""
        return "\n".join(map(str, answer))

    def answer_schema(self) -> Mapping[str, Any]:
        """Return the schema of an array of ids."""
        ids = [str(node.entry_id) for node in self.objects]
        return {"type": "array", "items": {"type": "string", "enum": ids}, "maxItems": self.max_ids}

    def alternatives(self, answer: tuple[int, ...]) -> Sequence[tuple[int, ...]]:
        """Return each other object alone."""
        return [(node.entry_id,) for node in _things(self.objects) if (node.entry_id,) != answer]

    def by_rule(self, matcher: Matcher) -> tuple[tuple[int, ...], str]:
        """Select the entries that the instruction mentions; then others, one a label, none beside a selected one."""
        if not self.objects:
            raise AnswerError("invalid", "there is no object")
        goal = matcher.parsed(self.goal)
        candidates = [node.candidate for node in self.objects]
        chosen: list[int] = []
        labels: set[str] = set()
        covered: set[int] = set()
        ranked = rank_entries(matcher, self.goal, candidates, self.position_m)
        # A door is shown with what is beside it, and helps little by itself.
        for index in [i for i in ranked if not is_structure(candidates[i].label)] or ranked:
            node = self.objects[index]
            label = canonical(node.candidate.label)
            is_mentioned = matcher.label_score(goal, node.candidate.label) > 0.0
            if is_mentioned or (label not in labels and node.entry_id not in covered):
                chosen.append(node.entry_id)
                labels.add(label)
                covered.update(node.neighbour_ids)
        reason = f"of {len(self.objects)} objects those that have most to do with a {goal.noun}"
        return tuple(chosen[: self.max_ids]), reason


@dataclass(frozen=True, slots=True)
class GraphQuestion(Question[GraphChoice]):
    """Ask where to go: to an object of the graph, to something that an image shows, or on exploring."""

    kind: ClassVar[str] = "graph"
    goal: Goal
    objects: Sequence[GraphObject]
    """Selected objects and their neighbours."""
    edges: Sequence[tuple[int, int, tuple[int, ...]]]
    """Ids of two objects, and numbers of images that show both."""
    images: Sequence[GraphImage]
    """Images that cover the edges, then those of this round."""
    history: Sequence[PastChoice]
    """Earlier choices of this stage, oldest first."""
    round: int
    """The round, from 0."""
    max_rounds: int
    num_frontiers: int
    """Number of frontiers. Not part of the prompt."""
    unseen_m2: float = 0.0
    """Area that the map does not know, for rules that look. Not part of the prompt."""

    def prompt(self) -> Prompt:
        """Show objects and edges as text, images with numbers, and earlier choices."""
        objects = [_object_line(node) for node in self.objects]
        edges = [f"{a}, {b}, [{', '.join(map(str, numbers))}]" for a, b, numbers in self.edges]
        past = [self._past_line(choice) for choice in self.history]
        what = {True: "what the robot sees now", False: "from its memory"}
        return goal_prompt(
            self.goal,
            "The robot searches a home. Objects that it remembers, one a line: id, class, x, y and z in metres, room.\n"
            + ("\n".join(objects) or "none")
            + "\nPairs of objects that were seen together, one a line: id, id, [numbers of the images].\n"
            + ("\n".join(edges) or "none"),
            *((f"Image {i}, {what[image.is_egocentric]}:", image.picture) for i, image in enumerate(self.images)),
            "What it chose before in this search:\n" + ("\n".join(past) or "nothing") + "\n"
            f"This is round {self.round + 1} of {self.max_rounds}. Do not repeat what was not correct. Answer on "
            'the first line with exactly one of "Object id", if this object is the goal; "Image i, category", if '
            'image i shows the goal and no object above is it, category being a word for it; or "Continue '
            'Exploration". Give your reason on the second line.',
        )

    def parse(self, text: str) -> GraphChoice:
        """Read `Object id`, `Image i, category` or `Continue Exploration`, of an object or image of the question."""
        line = first_line(text)
        if (match := _OBJECT.fullmatch(line)) is not None:
            if int(match[1]) not in {node.entry_id for node in self.objects}:
                raise AnswerError("invalid", f"there is no {line[:80]}", text)
            return GraphChoice("object", int(match[1]))
        if (match := _IMAGE.fullmatch(line)) is not None:
            if int(match[1]) >= len(self.images):
                raise AnswerError("invalid", f"there is no image {match[1]}", text)
            return GraphChoice("image", int(match[1]), match[2].strip())
        if _EXPLORE.fullmatch(line) is not None:
            return GraphChoice("explore")
        expected = "neither `Object id`, `Image i, category` nor `Continue Exploration`"
        raise AnswerError("invalid", f"{expected}: {line[:80]!r}", text)

    def answer_text(self, answer: GraphChoice) -> str:
        """Return the answer in the form that `parse` reads."""
        if answer.kind == "object":
            return f"Object {answer.id}"
        return f"Image {answer.id}, {answer.category}" if answer.kind == "image" else "Continue Exploration"

    def answer_schema(self) -> Mapping[str, Any]:
        """Return the schema of the three forms, with the numbers that the question has."""
        # Servers compile this to a grammar; some know no `\d`, and without bounds small models go on for ever.
        forms = ["Continue Exploration"]
        if self.objects:
            forms.append(f"Object ({'|'.join(str(node.entry_id) for node in self.objects)})")
        if self.images:
            forms.append(f"Image ({'|'.join(map(str, range(len(self.images))))}), [A-Za-z][A-Za-z ]{{0,40}}")
        return {"type": "string", "pattern": f"^({'|'.join(forms)})$"}

    def alternatives(self, answer: GraphChoice) -> Sequence[GraphChoice]:
        """Return every other object, and exploration."""
        choices = [*(GraphChoice("object", node.entry_id) for node in _things(self.objects)), GraphChoice("explore")]
        return [choice for choice in choices if choice != answer]

    def _past_line(self, choice: PastChoice) -> str:
        if choice.kind == "explore":
            return f"Round {choice.round + 1}: chose a frontier."
        if choice.kind == "object":
            return f"Round {choice.round + 1}: chose object {choice.id} - not correct."
        number = next((i for i, image in enumerate(self.images) if image.view_id == choice.id), None)
        what = "an image that is not shown now" if number is None else f"image {number}"
        return f"Round {choice.round + 1}: chose {what}, {choice.category} - not correct."

    def namesakes(self, answer: GraphChoice, matcher: Matcher) -> Sequence[tuple[GraphChoice, float]]:
        """Return the other objects with the goal's name that were not rejected."""
        goal = matcher.parsed(self.goal)
        named = [candidate for candidate in self._not_rejected() if matcher.names_goal(goal, candidate)]
        scores = matcher.scores(goal, named, [node.candidate for node in self.objects], self.unseen_m2)
        rated = [(GraphChoice("object", one.entry_id), score) for one, score in zip(named, scores, strict=True)]
        return [(choice, score) for choice, score in rated if choice != answer]

    def exploring(self, answer: GraphChoice, matcher: Matcher) -> GraphChoice | None:
        """Return `Continue Exploration`, if there is a frontier."""
        return GraphChoice("explore") if self.num_frontiers and answer.kind != "explore" else None

    def _not_rejected(self) -> list[ObjectCandidate]:
        """Return the objects that were not chosen and found to be wrong in this stage."""
        rejected_ids = {past.id for past in self.history if past.kind == "object"}
        return [node.candidate for node in self.objects if node.entry_id not in rejected_ids]

    def by_rule(self, matcher: Matcher) -> tuple[GraphChoice, str]:
        """Choose a fitting object that was not rejected; else one that only an image shows; else explore.

        With no frontier or hardly a round left, any object of the right category is chosen, or else one that the goal
        should be on or near.
        """
        goal = matcher.parsed(self.goal)
        around = [node.candidate for node in self.objects]
        left = self._not_rejected()
        named = [candidate for candidate in left if matcher.names_goal(goal, candidate)]
        is_last_chance = self.num_frontiers == 0 or self.max_rounds - self.round <= matcher.hurry_rounds
        best = matcher.best(goal, named, around, self.unseen_m2) if named else None
        if best is None or not best.fits:
            image = self._unmapped(matcher, goal, around)
            if image is not None:
                return image, f"{image.category} seen, but not in the graph"
        if best is not None and (best.fits or is_last_chance):
            return GraphChoice("object", named[best.index].entry_id), best.reason
        if self.num_frontiers == 0:
            scored = [(matcher.label_score(goal, candidate.label), -i) for i, candidate in enumerate(left)]
            score, index = max(scored, default=(0.0, 0))
            if score > 0.0:
                return GraphChoice("object", left[-index].entry_id), f"where the {goal.noun} should be"
        return GraphChoice("explore"), "relations do not hold" if named else "nothing remembered fits"

    def _unmapped(self, matcher: Matcher, goal: ParsedGoal, around: Sequence[ObjectCandidate]) -> GraphChoice | None:
        """Choose the largest detection of the goal's category that belongs to no entry and lies at no known place."""
        known_m = [candidate.ground_m for candidate in around if matcher.names_goal(goal, candidate)]
        known_m += [past.place_m for past in self.history if past.place_m is not None]

        def is_known(place_m: Point2) -> bool:
            return any(math.dist(place_m, other_m) <= matcher.near_m for other_m in known_m)

        found = [
            (seen.area_px, -number, seen.label)
            for number, image in enumerate(self.images)
            for seen in image.seen
            if seen.entry_id is None
            and seen.centre_m is not None
            and similarity(goal.noun, seen.label) >= matcher.min_similarity
            and not is_known(seen.centre_m)
        ]
        if not found:
            return None
        _, number, label = max(found)
        return GraphChoice("image", -number, canonical(label))


def _things(objects: Sequence[GraphObject]) -> list[GraphObject]:
    """Return the objects that can be goals: doors and windows are in the graph for what is beside them."""
    return [node for node in objects if not is_structure(node.candidate.label)]


def _object_line(node: GraphObject) -> str:
    x_m, y_m, z_m = node.candidate.centre_m
    return f"{node.entry_id}, {node.candidate.label}, {x_m:.2f}, {y_m:.2f}, {z_m:.2f}, {node.room}"


@dataclass(frozen=True, slots=True)
class FrontierImagesQuestion(ClosedQuestion[int]):
    """Ask behind which frontier the goal may be; the answer is its place in the list."""

    kind: ClassVar[str] = "frontier"
    goal: Goal
    frontiers: Sequence[FrontierCandidate]
    surroundings: Sequence[ObjectCandidate]
    """Everything remembered: what the images would show. Not part of the prompt."""

    def prompt(self) -> Prompt:
        """Show each frontier with its image."""
        return goal_prompt(
            self.goal,
            "The robot searches a home. It may explore one of these frontiers next.",
            *((f"Frontier {index}:", frontier.image) for index, frontier in enumerate(self.frontiers)),
            "Behind which one is the goal most likely found? Answer on the first line with exactly "
            '"Frontier i", and give your reason on the second.',
        )

    def answer_text(self, answer: int) -> str:
        """Return `Frontier i`."""
        return f"Frontier {answer}"

    def choices(self) -> Sequence[int]:
        """Return the places in the list."""
        return range(len(self.frontiers))

    def by_rule(self, matcher: Matcher) -> tuple[int, str]:
        """Choose the cheapest frontier."""
        costs_m = matcher.frontier_costs_m(matcher.parsed(self.goal), self.frontiers, self.surroundings)
        index = costs_m.index(min(costs_m))
        return index, f"costs {costs_m[index]:.1f} m"


@dataclass(frozen=True, slots=True)
class ArrivalQuestion(YesNoQuestion):
    """Ask whether the goal is here: at a chosen object, with all that was seen on the last stretch to it."""

    kind: ClassVar[str] = "arrival"
    goal: Goal
    target: ObjectCandidate
    """The object that the agent went to. Not part of the prompt."""
    seen: Sequence[ObjectCandidate]
    """Detections of these rounds, each by the points of that view alone. Not part of the prompt."""
    num_views: int
    """Number of views of the last rounds, and of images if the model looks at them."""
    num_frontiers: int
    """Number of frontiers. Not part of the prompt."""
    num_rounds_left: int
    """Number of rounds that are left. Not part of the prompt."""
    views: Sequence[Picture] = field(default=(), compare=False, repr=False)
    """Views, the most recent first."""

    def prompt(self) -> Prompt:
        """Show the views."""
        return goal_prompt(
            self.goal,
            "The robot may have arrived. What it saw, the most recent view first:",
            *((f"View {index}:", view) for index, view in enumerate(self.views)),
            "Has it found the goal, in full agreement with what is said of it? Answer on the first line with "
            '"yes" or "no", and give your reason on the second.',
        )

    def by_rule(self, matcher: Matcher) -> tuple[bool, str]:
        """Answer yes if the goal's category was seen at the place, and its relations hold among the objects seen.

        With no frontier or hardly a round left the category is enough.
        """
        goal = matcher.parsed(self.goal)
        here = [
            seen for seen in self.seen if matcher.names_goal(goal, seen) and gap_m(seen, self.target) <= matcher.near_m
        ]
        if not here:
            return False, f"no {goal.noun} seen here"
        share = max(matcher.relation_share(goal, seen, self.seen) for seen in here)
        is_fitting = share >= matcher.min_relations
        is_last_chance = self.num_frontiers == 0 or self.num_rounds_left <= matcher.hurry_rounds
        return is_fitting or is_last_chance, f"{goal.noun} seen here, {share:.0%} of what is said fits"
