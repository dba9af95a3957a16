"""Decide by looks, without a network: how likely each remembered object is the goal, by all that its views show.

`AppearanceMatch` stands where the paper's agents ask GPT-4o, as `TextMatch` does, but it sees: the colours of an object
in the agent's own views, its size and proportions, and what these views show around it. Each of these is a likelihood
ratio, the probability of what is seen for the goal over that for another object of its type; so is the goal's picture,
for agents that go by it. Their product and the number of objects of the type that the unseen part of the home should
hold give a posterior probability. The agent goes to the likeliest object if that is likely enough against "not seen
yet": exploring does not tell apart two objects that were both seen. What cannot be seen counts 1: materials, details,
corners.

Two distances of colours to the goal's picture count: near the object, and in the whole view. The picture shows the goal
in its middle. Walls and floors tell rooms apart, so that the surroundings say more than the object itself.
"""

import hashlib
import math
import random
from collections.abc import Sequence
from dataclasses import replace

from evonav.decision.candidates import FrontierCandidate, ObjectCandidate
from evonav.decision.goal_input import PictureGoal
from evonav.decision.home_statistics import COLOUR_PRIOR, per_100_m2, usual_size
from evonav.decision.text.language import ParsedGoal, Relation, canonical, similarity
from evonav.decision.text.matcher import Best, Matcher
from evonav.memory.colours import Layout, distance, layouts
from evonav.tasks.language import COLOURS
from evonav.tasks.public import Goal

_WALL_THINGS = {"painting", "window", "doorway"}
"""Things on or in walls, which views show less often than what stands on the floor."""
PICTURE_CONSTANT, PICTURE_NEAR, PICTURE_WHOLE = 3.56, -5.39, -12.95
"""The logarithm of the ratio: its constant, and the weights of the distances near the object and in the whole view.

`scripts/data/calibrate_goal_pictures.py` fits them on the design houses.
"""
PICTURE_RANGE = (0.05, 20.0)
"""Smallest and largest ratio: a few hundred views do not tell of rarer things."""


class AppearanceMatcher(Matcher):
    """Compares goals with remembered objects by what their views show."""

    threshold = 0.5
    """Probability from which an object is believed to be the goal, if it is either that object or not seen yet."""
    eager_threshold = 0.2
    """The same at full eagerness."""
    colour_floor = 0.05
    """Added to the share of a colour and to the word's prior: a colour that is not seen may be in the shade."""
    colour_range = (0.1, 6.0)
    """Smallest and largest ratio of a colour."""
    form_ratio = 3.0
    """Largest ratio of a size or of a form; its inverse is the smallest."""
    form_slope = 0.15
    """Width of the step between a word and its opposite, in natural logarithms of sizes or proportions."""
    min_sightings = 3
    """Number of detections from which a box counts as complete."""
    on_probability = 0.95
    """Probability that the goal's views show what it is said to stand on."""
    near_probability = 0.85
    """The same for what stands beside it."""
    near_wall_thing_probability = 0.75
    """The same for a painting, a window or a door."""
    room_probability = 0.9
    """The same for the room."""
    keep_share = 0.2
    """Share by which another frontier must be nearer than the one to which the agent goes."""
    min_known_share = 0.7
    """Known share of the surroundings from which a neighbour or a room that is not seen counts as violated.

    What an object stands on is seen with it.
    """

    def __init__(self, *, eagerness: float = 0.0) -> None:
        """Create a matcher: `eagerness` 0 believes an object at `threshold`, 1 at `eager_threshold`."""
        super().__init__()
        self._pictured: tuple[Goal, Layout] | None = None
        """The last goal with a picture, and the picture's layout, which takes a millisecond."""
        self._threshold = self.threshold + eagerness * (self.eager_threshold - self.threshold)

    def parsed(self, goal: Goal) -> ParsedGoal:
        """Return the parsed instruction, and the layout of the picture if that counts."""
        parsed = super().parsed(goal)
        if not isinstance(goal, PictureGoal):
            return parsed
        if self._pictured is None or self._pictured[0] is not goal:
            self._pictured = (goal, goal_layout(goal))
        return replace(parsed, picture=self._pictured[1])

    def best(
        self, goal: ParsedGoal, named: Sequence[ObjectCandidate], around: Sequence[ObjectCandidate], unseen_m2: float
    ) -> Best:
        """Return which of the objects with the goal's name is most likely the goal; of equals, the first."""
        shares = self.scores(goal, named, around, unseen_m2)
        index = shares.index(max(shares))
        unseen = max(0.0, 1.0 - math.fsum(shares))
        fits = shares[index] >= self._threshold * (shares[index] + unseen)
        return self._best(index, named, shares[index], fits=fits)

    def _best(self, index: int, named: Sequence[ObjectCandidate], share: float, *, fits: bool) -> Best:
        return Best(index, fits, f"{named[index].label}, {share:.0%} likely the one described")

    def scores(
        self, goal: ParsedGoal, named: Sequence[ObjectCandidate], around: Sequence[ObjectCandidate], unseen_m2: float
    ) -> list[float]:
        """Return the probability that each object is the goal; the rest is that of "not seen yet".

        Args:
            around: Everything remembered; of it, only what an object's own views show counts.
            unseen_m2: Area that the map does not know.
        """
        ratios = self._times_relations(self.appearance_ratios(goal, named), goal, named, around)
        unseen = per_100_m2(goal.noun) * unseen_m2 / 100.0
        total = math.fsum(ratios) + unseen
        return [ratio / total for ratio in ratios]

    def appearance_ratios(self, goal: ParsedGoal, named: Sequence[ObjectCandidate]) -> list[float]:
        """Return the ratios of colours, size, form and picture together."""
        rules = (self._colour_ratio, self._form_ratio, self._picture_ratio)
        return [math.prod(rule(goal, one) for rule in rules) for one in named]

    def context_ratios(
        self, goal: ParsedGoal, named: Sequence[ObjectCandidate], around: Sequence[ObjectCandidate]
    ) -> list[float]:
        """Return the ratios of all relations together."""
        return self._times_relations([1.0] * len(named), goal, named, around)

    def _times_relations(
        self,
        ratios: list[float],
        goal: ParsedGoal,
        named: Sequence[ObjectCandidate],
        around: Sequence[ObjectCandidate],
    ) -> list[float]:
        """Return the ratios of objects, each times those of their relations."""
        for relation in goal.relations:
            each = self._relation_ratios(relation, named, around)
            ratios = [ratio * factor for ratio, factor in zip(ratios, each, strict=True)]
        return ratios

    def _colour_ratio(self, goal: ParsedGoal, one: ObjectCandidate) -> float:
        """Return the ratio of the named colours; 1 if none is named, or none was seen."""
        if one.appearance is None:
            return 1.0
        low, high = self.colour_range
        ratio = 1.0
        for word in goal.adjectives:
            if word in COLOUR_PRIOR:
                share = one.appearance.colours[COLOURS.index(word)] + self.colour_floor
                ratio *= min(max(share / (COLOUR_PRIOR[word] + self.colour_floor), low), high)
        return ratio

    def _form_ratio(self, goal: ParsedGoal, one: ObjectCandidate) -> float:
        """Return the ratio of the named size and proportions; 1 for a box that may be a part of the object."""
        usual = usual_size(canonical(one.label))
        if usual is None or one.num_detections < self.min_sightings or min(one.size_m) <= 0.0:
            return 1.0
        width_m, height_m, depth_m = one.size_m
        size = math.log(math.cbrt(width_m * height_m * depth_m) / usual[0])
        upright = math.log(height_m / max(width_m, depth_m))
        top = math.log(min(width_m, depth_m) / max(width_m, depth_m))
        over = {  # how far beyond the describer's limit, in natural logarithms
            "small": math.log(0.8) - size,
            "large": size - math.log(1.25),
            "tall": upright - max(math.log(1.3), math.log(1.3 * usual[1])),
            "wide": min(math.log(0.9), math.log(usual[1] / 1.3)) - upright,
            "square": top - math.log(0.92),
            "long": math.log(0.45) - top,
        }
        ratio = 1.0
        for word in goal.adjectives:
            if word in over:
                ratio *= self.form_ratio ** math.tanh(over[word] / (2.0 * self.form_slope))
        return ratio

    def _picture_ratio(self, goal: ParsedGoal, one: ObjectCandidate) -> float:
        """Return the ratio of the goal's picture; 1 if it does not count, or nothing was seen in colour."""
        if goal.picture is None or one.appearance is None or one.appearance.layout is None:
            return 1.0
        return picture_ratio(goal.picture, one.appearance.layout)

    def _relation_ratios(
        self, relation: Relation, named: Sequence[ObjectCandidate], around: Sequence[ObjectCandidate]
    ) -> list[float]:
        """Return the ratio of one relation for each object; other objects have it by their Laplace share."""
        seen = [self._is_seen(relation, one, around) for one in named]
        truth = self._probability(relation)
        ratios = []
        for index, holds in enumerate(seen):
            others = [other for number, other in enumerate(seen) if number != index and other is not None]
            share = (sum(others) + 1.0) / (len(others) + 2.0)
            ratios.append(1.0 if holds is None else truth / share if holds else (1.0 - truth) / (1.0 - share))
        return ratios

    def frontier_costs_m(
        self, goal: ParsedGoal, frontiers: Sequence[FrontierCandidate], around: Sequence[ObjectCandidate]
    ) -> list[float]:
        """Return the costs of `Matcher`, of a way that is shorter for the frontier to which the agent already goes."""
        ways = [replace(one, travel_m=one.travel_m * (1.0 - self.keep_share * one.is_current)) for one in frontiers]
        return super().frontier_costs_m(goal, ways, around)

    def _probability(self, relation: Relation) -> float:
        """Return the probability that the goal's views show a relation."""
        if relation.kind == "near":
            return self.near_wall_thing_probability if relation.noun in _WALL_THINGS else self.near_probability
        return self.on_probability if relation.kind == "on" else self.room_probability

    def _is_seen(self, relation: Relation, one: ObjectCandidate, around: Sequence[ObjectCandidate]) -> bool | None:
        """Return whether the views of an object show a relation; `None` if they cannot tell."""
        if one.appearance is None:
            return None
        shown = [other for other in around if other.entry_id in one.appearance.shown_ids]
        if relation.kind == "in":
            room = self.room_around(one.ground_m, shown)
            return None if room is None else room == relation.noun
        if self.holds(relation, one, shown):
            return True
        is_ever_detected = any(similarity(relation.noun, other.label) >= 1.0 for other in around)
        is_known = relation.kind == "on" or one.appearance.known_share >= self.min_known_share
        return False if is_known and (is_ever_detected or relation.noun not in _WALL_THINGS | {"corner"}) else None


class MistakenMatcher(AppearanceMatcher):
    """Draws what is believed from the posterior: like a model that is often, but not always, right."""

    def __init__(self, temperature: float, seed: int, *, eagerness: float = 0.0) -> None:
        """Create a matcher.

        Args:
            temperature: Above 0; at 1 each object and "not seen yet" is drawn as often as it is likely.
            eagerness: See `AppearanceMatcher`; it counts where the draw is "not seen yet".
        """
        super().__init__(eagerness=eagerness)
        self._temperature = temperature
        self._seed = seed
        self._num_drawn = 0

    def best(
        self, goal: ParsedGoal, named: Sequence[ObjectCandidate], around: Sequence[ObjectCandidate], unseen_m2: float
    ) -> Best:
        """Return an object drawn by its probability; it does not fit if "not seen yet" was drawn."""
        shares = self.scores(goal, named, around, unseen_m2)
        unseen = max(0.0, 1.0 - math.fsum(shares))
        self._num_drawn += 1
        name = f"looks\0{self._seed}\0{self._num_drawn}"
        draws = random.Random(hashlib.sha256(name.encode()).digest())  # noqa: S311 - not for secrets
        top = max(*shares, unseen)
        weights = [(share / top) ** (1.0 / self._temperature) for share in (*shares, unseen)]
        (index,) = draws.choices(range(len(weights)), weights)
        if index == len(named):
            likeliest = shares.index(max(shares))
            return self._best(likeliest, named, shares[likeliest], fits=False)
        return self._best(index, named, shares[index], fits=True)


def goal_layout(goal: Goal) -> Layout:
    """Return the layout of a goal's picture around its middle."""
    height_px, width_px, _ = goal.reference_image.shape
    return layouts(goal.reference_image, [(width_px / 2.0, height_px / 2.0)])[0]


def picture_ratio(pictured: Layout, seen: Layout) -> float:
    """Return the probability of what is seen if it is the goal, over that if it is another object of its type."""
    near, whole = distance(pictured.near, seen.near), distance(pictured.whole, seen.whole)
    low, high = PICTURE_RANGE
    return min(max(math.exp(PICTURE_CONSTANT + PICTURE_NEAR * near + PICTURE_WHOLE * whole), low), high)
