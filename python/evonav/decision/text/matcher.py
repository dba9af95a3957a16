"""Compare a goal with what the agent remembers by rules that only read.

They know objects by label and box, so they judge "on" and "next to" by geometry and a room by what stands in it. Each
question brings its own rule: the method `by_rule(matcher)`, which returns an answer and the reason for it.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial

from evonav.decision.candidates import FrontierCandidate, ObjectCandidate
from evonav.decision.text.language import ParsedGoal, Relation, canonical, is_structure, parse_goal, similarity
from evonav.points import Point2
from evonav.tasks.public import Goal

ROOM_SIGNS: dict[str, tuple[str, ...]] = {
    "kitchen": (
        "fridge",
        "microwave",
        "toaster",
        "coffee machine",
        "countertop",
        "kettle",
        "pot",
        "pan",
        "dish sponge",
    ),
    "bathroom": (
        "toilet",
        "bathtub",
        "shower curtain",
        "shower head",
        "toilet paper hanger",
        "plunger",
        "towel holder",
    ),
    "bedroom": ("bed", "dresser", "alarm clock", "laundry hamper"),
    "living room": ("sofa", "television", "tv stand", "coffee table", "arm chair", "remote control"),
}
"""Objects that mostly stand in one type of room."""
_ROOM_OF_SIGN = {sign: room for room, signs in ROOM_SIGNS.items() for sign in signs}


@dataclass(frozen=True, slots=True)
class Best:
    """The candidate that fits a goal best."""

    index: int
    fits: bool
    """Whether it fits well enough to end exploration."""
    reason: str


class Matcher:
    """Compares goals with remembered objects."""

    near_m = 1.0
    """Largest gap between boxes that are near each other."""
    support_margin_m = 0.15
    """Largest distance of an object's centre outside of its support's box, and of its bottom above that box."""
    room_radius_m = 3.5
    """Distance up to which objects indicate a room."""
    min_relations = 0.6
    """Share of an instruction's relations that must hold before exploration ends for a candidate."""
    unknown_room = 0.5
    """Value of a room that is unknown."""
    hurry_rounds = 8
    """Number of remaining rounds from which any candidate of the right category is accepted."""
    min_similarity = 0.99
    """Smallest similarity at which a label names the goal."""
    lead_radius_m = 3.0
    """A frontier this near something that the instruction mentions is worth a detour..."""
    lead_m = 3.0
    """...of this length."""
    same_place_m = 0.5
    """Verification: centres this near are the same place."""
    min_overlap = 0.2
    """Verification: or this share of the object's points lies by the remembered object's points."""
    violated_fixed = 0.1
    """Identity: factor for a violated relation to what does not move: the room, a doorway, a window."""
    violated_movable = 0.4
    """Identity: factor for a violated relation to a support or a neighbour."""
    chance_fit = 0.2
    """Identity: probability that a description fits a place of which nothing is known."""

    def __init__(self) -> None:
        self._score_of: tuple[ParsedGoal | None, Callable[[str], float]] = (None, float)
        """The last goal, and its scores by label, each worked out once: agents ask for them in every round."""

    def parsed(self, goal: Goal) -> ParsedGoal:
        """Return the parsed instruction."""
        return parse_goal(goal.unified_instruction, goal.category)

    def names_goal(self, goal: ParsedGoal, entry: ObjectCandidate) -> bool:
        """Return whether an entry's label is the goal's name for its target."""
        return similarity(goal.noun, entry.label) >= self.min_similarity

    def label_score(self, goal: ParsedGoal, label: str) -> float:
        """Return 1 for the goal's own label, less for part of it, still less for a related object.

        Doors and windows score 0 even where they are named: every room has them.
        """
        if goal is not self._score_of[0]:
            self._score_of = (goal, cache(partial(self._label_score, goal)))
        return self._score_of[1](label)

    def _label_score(self, goal: ParsedGoal, label: str) -> float:
        if is_structure(label):
            return 0.0
        own = similarity(goal.noun, label)
        if own >= self.min_similarity:
            return own
        related = [0.5 if r.kind == "on" else 0.4 for r in goal.relations if similarity(r.noun, label) >= 1.0]
        return max([0.9 * own if own >= 0.4 else 0.0, *related])

    def may_help(self, goal: ParsedGoal, label: str) -> bool:
        """Return whether a label is the goal's, or of something that is near it or in the same type of room."""
        sign_of = self.sign_of(label)
        return self.label_score(goal, label) > 0.0 or (sign_of is not None and sign_of == goal.room)

    def best(
        self, goal: ParsedGoal, named: Sequence[ObjectCandidate], around: Sequence[ObjectCandidate], unseen_m2: float
    ) -> Best:
        """Return which of the objects with the goal's name fits best; of equals, the first.

        Args:
            named: Objects with the goal's name, at least one.
            unseen_m2: Area that the map does not know; only rules that look use it.
        """
        shares = self.scores(goal, named, around, unseen_m2)
        index = shares.index(max(shares))
        fits = shares[index] >= self.min_relations
        return Best(index, fits, f"{named[index].label}, {shares[index]:.0%} of what is said fits")

    def scores(
        self, goal: ParsedGoal, named: Sequence[ObjectCandidate], around: Sequence[ObjectCandidate], unseen_m2: float
    ) -> list[float]:
        """Return how well each object with the goal's name fits, from 0 to 1; for the arguments see `best`."""
        return [self.relation_share(goal, candidate, around) for candidate in named]

    def appearance_ratios(self, goal: ParsedGoal, named: Sequence[ObjectCandidate]) -> list[float]:
        """Return how much likelier the appearance of each object is for the goal than for another of its type.

        Its appearance stays when an object moves. Rules that only read see none, so all ratios are 1.
        """
        return [1.0] * len(named)

    def context_ratios(
        self, goal: ParsedGoal, named: Sequence[ObjectCandidate], around: Sequence[ObjectCandidate]
    ) -> list[float]:
        """Return how much likelier what is around each object is for the goal than for an object at an unknown place.

        Below 1 the surroundings contradict the description. The sentence describes the home as it is now, so they do
        so for another object, and for the right one at a place where it no longer is.
        """
        fixed = {relation for relation in goal.relations if relation.kind == "in" or is_structure(relation.noun)}
        factors = {r: self.violated_fixed if r in fixed else self.violated_movable for r in goal.relations}
        judged = self._judged(goal, around)
        violated = ([one for one in judged if self.holds(one, entry, around) == 0.0] for entry in named)
        return [math.prod(factors[relation] for relation in relations) / self.chance_fit for relations in violated]

    def _judged(self, goal: ParsedGoal, around: Sequence[ObjectCandidate]) -> list[Relation]:
        """Return the relations, without those to a doorway or a window if none is remembered."""
        return [
            relation
            for relation in goal.relations
            if not is_structure(relation.noun) or any(similarity(relation.noun, o.label) >= 1.0 for o in around)
        ]

    def relation_share(self, goal: ParsedGoal, entry: ObjectCandidate, around: Sequence[ObjectCandidate]) -> float:
        """Return the share of the relations that hold, 1 if there is none.

        A doorway or a window is judged once one is remembered: some agents forget doors, and none knows corners.
        Adjectives do not count: memory has no colours, and an object that is small for its kind may be the
        larger of two that are remembered.
        """
        judged = [self.holds(relation, entry, around) for relation in self._judged(goal, around)]
        return sum(judged) / len(judged) if judged else 1.0

    def holds(self, relation: Relation, entry: ObjectCandidate, around: Sequence[ObjectCandidate]) -> float:
        """Return 1 if a relation of an entry holds, 0 if not, and in between for a room that is unknown."""
        if relation.kind == "in":
            room = self.room_around(entry.ground_m, around)
            return self.unknown_room if room is None else float(room == relation.noun)
        others = [o for o in around if o.entry_id != entry.entry_id and similarity(relation.noun, o.label) >= 1.0]
        if relation.kind == "on":
            return float(any(self.is_on(entry, other) for other in others))
        return float(any(gap_m(entry, other) <= self.near_m for other in others))

    def is_on(self, entry: ObjectCandidate, support: ObjectCandidate) -> bool:
        """Return whether an object stands on, or in, another, by their boxes."""
        margin_m = self.support_margin_m
        for axis in (0, 2):
            if abs(entry.centre_m[axis] - support.centre_m[axis]) > support.size_m[axis] / 2 + margin_m:
                return False
        bottom_m = entry.centre_m[1] - entry.size_m[1] / 2
        low_m = support.centre_m[1] - support.size_m[1] / 2
        return low_m - margin_m <= bottom_m <= low_m + support.size_m[1] + margin_m

    def room_around(self, place_m: Point2, around: Sequence[ObjectCandidate]) -> str | None:
        """Return the type of room that nearby objects indicate, the nearer the more; `None` if none does."""
        return self.room_of_signs(place_m, self.room_signs(around))

    def sign_of(self, label: str) -> str | None:
        """Return the type of room that an object indicates, if it does."""
        return _ROOM_OF_SIGN.get(canonical(label))

    def room_signs(self, around: Sequence[ObjectCandidate]) -> list[tuple[str, Point2]]:
        """Return the objects that indicate a type of room: that room, and where they stand."""
        room_of = _ROOM_OF_SIGN.get
        return [(room, other.ground_m) for other in around if (room := room_of(canonical(other.label))) is not None]

    def room_of_signs(self, place_m: Point2, signs: Sequence[tuple[str, Point2]]) -> str | None:
        """Return the same as `room_around`, from objects that were read before: for many places among the same ones."""
        votes: dict[str, list[float]] = defaultdict(list)
        (x_m, z_m), radius_m = place_m, self.room_radius_m
        for room, (other_x_m, other_z_m) in signs:
            if abs(other_x_m - x_m) >= radius_m or abs(other_z_m - z_m) >= radius_m:  # most are in other rooms
                continue
            weight = 1.0 - math.hypot(other_x_m - x_m, other_z_m - z_m) / radius_m
            if weight > 0.0:
                votes[room].append(weight)
        return max(sorted(votes), key=lambda room: math.fsum(votes[room]), default=None)

    def frontier_costs_m(
        self, goal: ParsedGoal, frontiers: Sequence[FrontierCandidate], around: Sequence[ObjectCandidate]
    ) -> list[float]:
        """Return each distance to travel, less the value of a hint: a mentioned object, or the right type of room.

        Doors and windows are no hints: every room has them.
        """
        mentioned = {r.noun for r in goal.relations if r.kind != "in" and not is_structure(r.noun)}
        leads_m = [other.ground_m for other in around if canonical(other.label) in mentioned] if mentioned else []
        signs = [] if goal.room is None else self.room_signs(around)
        costs_m = []
        for frontier in frontiers:
            is_lead = any(math.dist(lead_m, frontier.position_m) <= self.lead_radius_m for lead_m in leads_m)
            if not is_lead and signs:
                is_lead = self.room_of_signs(frontier.position_m, signs) == goal.room
            costs_m.append(frontier.travel_m - (self.lead_m if is_lead else 0.0))
        return costs_m


def gap_m(a: ObjectCandidate, b: ObjectCandidate) -> float:
    """Return the distance between two boxes on the ground plane; 0 if they overlap there."""
    gaps_m = (
        max(0.0, abs(a.centre_m[axis] - b.centre_m[axis]) - (a.size_m[axis] + b.size_m[axis]) / 2) for axis in (0, 2)
    )
    return math.hypot(*gaps_m)
