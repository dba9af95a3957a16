"""Questions of Frontier-Update and its variants (paper, Sec. C.4): the next place, and whether the target is there."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from evonav.decision.candidates import Choice, FrontierCandidate, ObjectCandidate
from evonav.decision.pictures import Picture
from evonav.decision.prompts import Prompt, goal_prompt
from evonav.decision.question import ClosedQuestion, YesNoQuestion
from evonav.decision.text.language import canonical
from evonav.decision.text.matcher import Matcher
from evonav.decision.text.ranking import best_frontier, choose_candidate
from evonav.memory.presence import DepthEvidence, Presence, judge_presence
from evonav.points import Point2
from evonav.tasks.public import Goal


@dataclass(frozen=True, slots=True)
class ChooseQuestion(ClosedQuestion[Choice]):
    """Ask where to go next: to one of the objects, or to one of the frontiers."""

    kind: ClassVar[str] = "choose"
    goal: Goal
    position_m: Point2
    """`(x, z)` of the agent."""
    objects: Sequence[ObjectCandidate]
    """Candidates, the best first by `rank_entries`."""
    frontiers: Sequence[FrontierCandidate]
    surroundings: Sequence[ObjectCandidate]
    """Everything remembered: what the candidates' images would show around them. Not part of the prompt."""
    num_rounds_left: int
    unseen_m2: float = 0.0
    """Area that the map does not know, for rules that look. Not part of the prompt."""
    heading_view: Picture | None = field(default=None, compare=False, repr=False)

    def prompt(self) -> Prompt:
        """Show the heading view, each object with its crop and last view, each frontier with its image."""
        objects: list[tuple[str, Picture | None]] = []
        for index, candidate in enumerate(self.objects):
            objects.append((f"Object {index}: {candidate.label}", candidate.crop))
            if candidate.view is not None:
                objects.append((f"The view in which object {index} was last seen:", candidate.view))
        return goal_prompt(
            self.goal,
            "The robot searches a home. Choose where it goes next: to a remembered object that is the goal, or to a "
            "frontier behind which the goal may be.",
            ("What the robot sees ahead:", self.heading_view),
            *objects,
            *((f"Frontier {i}: {one.travel_m:.1f} m away", one.image) for i, one in enumerate(self.frontiers)),
            f"There are {len(self.objects)} objects and {len(self.frontiers)} frontiers. Answer on the first line "
            'with exactly "Object i" or "Frontier i", and give your reason on the second.',
        )

    def answer_text(self, answer: Choice) -> str:
        """Return `Object i` or `Frontier i`."""
        return f"{answer.kind.capitalize()} {answer.index}"

    def choices(self) -> Sequence[Choice]:
        """Return objects, then frontiers."""
        return [
            *(Choice("object", index) for index in range(len(self.objects))),
            *(Choice("frontier", index) for index in range(len(self.frontiers))),
        ]

    def namesakes(self, answer: Choice, matcher: Matcher) -> Sequence[tuple[Choice, float]]:
        """Return the other objects with the goal's name."""
        goal = matcher.parsed(self.goal)
        indices = [index for index, one in enumerate(self.objects) if matcher.names_goal(goal, one)]
        named = [self.objects[index] for index in indices]
        scores = matcher.scores(goal, named, self.surroundings, self.unseen_m2)
        rated = [(Choice("object", index), score) for index, score in zip(indices, scores, strict=True)]
        return [(choice, score) for choice, score in rated if choice != answer]

    def exploring(self, answer: Choice, matcher: Matcher) -> Choice | None:
        """Return the frontier that the rule would choose."""
        index = best_frontier(matcher, self.goal, self.frontiers, self.surroundings)
        return None if index is None or answer.kind == "frontier" else Choice("frontier", index)

    def by_rule(self, matcher: Matcher) -> tuple[Choice, str]:
        """Choose an object that the instruction fits; else a frontier; else what the goal should be on or near."""
        return choose_candidate(
            matcher,
            self.goal,
            self.objects,
            self.frontiers,
            self.surroundings,
            num_rounds_left=self.num_rounds_left,
            unseen_m2=self.unseen_m2,
        )


@dataclass(frozen=True, slots=True)
class ComparedDetection:
    """An object in a present view, compared with a remembered one."""

    label: str
    overlap: float
    """Share of its points that lie by the remembered object's points."""
    distance_m: float
    """Distance from its centroid to the middle of the remembered object's box; `inf` if it is unknown."""


@dataclass(frozen=True, slots=True)
class VerifyQuestion(YesNoQuestion):
    """Ask whether the present observation supports that the remembered object is still here."""

    kind: ClassVar[str] = "verify"
    goal: Goal
    entry: ObjectCandidate
    seen: Sequence[ComparedDetection]
    """Objects in the present views, for models that do not look at images. Not part of the prompt."""
    evidence: DepthEvidence
    """Its points compared with the present depth. Not part of the prompt."""
    views: Sequence[Picture] = field(default=(), compare=False, repr=False)
    """Present views, the facing view last."""

    def prompt(self) -> Prompt:
        """Show the stored crop, and what the robot sees where it was."""
        return goal_prompt(
            self.goal,
            (f"The robot remembers this object: {self.entry.label}", self.entry.crop),
            "It went to where it remembers it, and now sees:",
            *((f"View {index}:", view) for index, view in enumerate(self.views)),
            "Does what it sees support that the remembered object is still here? Answer on the first line with "
            'exactly "yes" or "no", and give your reason on the second.',
        )

    def by_rule(self, matcher: Matcher) -> tuple[bool, str]:
        """Answer no only if the object's place is seen through, and nothing with its label is detected there."""
        presence, reason = self.presence(matcher)
        return presence is not Presence.NO, reason

    def presence(self, matcher: Matcher) -> tuple[Presence, str]:
        """Judge by detections and depth whether the object is there, and say why."""
        is_detected = any(self._is_entry(seen, matcher) for seen in self.seen)
        evidence = self.evidence
        presence = judge_presence(evidence, is_detected=is_detected)
        if is_detected:
            return presence, f"{self.entry.label} detected at the remembered place"
        return presence, (
            f"{presence.value}: of {evidence.num_in_view} points in view, {evidence.num_see_through} seen through, "
            f"{evidence.num_supported} on a surface, {evidence.num_occluded} hidden"
        )

    def _is_entry(self, seen: ComparedDetection, matcher: Matcher) -> bool:
        """Return whether a detection may be of the remembered object."""
        is_here = seen.overlap > matcher.min_overlap or seen.distance_m < matcher.same_place_m
        return is_here and canonical(seen.label) == canonical(self.entry.label)


@dataclass(frozen=True, slots=True)
class IdentityQuestion(YesNoQuestion):
    """Ask whether a remembered object may be the goal, or its surroundings contradict the description."""

    kind: ClassVar[str] = "identity"
    goal: Goal
    entry: ObjectCandidate
    surroundings: Sequence[ObjectCandidate]
    """Everything remembered, the object too. Not part of the prompt."""

    def prompt(self) -> Prompt:
        """Show the crop of the object, and the view in which it was last seen."""
        return goal_prompt(
            self.goal,
            (f"The robot stands before this object: {self.entry.label}", self.entry.crop),
            ("The view in which it was last seen:", self.entry.view),
            'May it be the goal? There may be others of its kind. Answer on the first line with exactly "yes", or '
            'with "no" if its looks or what is around it contradict the description; give your reason on the second.',
        )

    def by_rule(self, matcher: Matcher) -> tuple[bool, str]:
        """Answer no if another object of the goal's kind would fit the description better than this one does.

        Objects of another kind are not compared: an agent goes to one only when nothing else is left.
        """
        goal = matcher.parsed(self.goal)
        named = [one for one in self.surroundings if matcher.names_goal(goal, one)]
        index = next((i for i, one in enumerate(named) if one.entry_id == self.entry.entry_id), None)
        if index is None:
            return True, f"{self.entry.label} is no {goal.noun}: there is nothing to compare"
        appearance = matcher.appearance_ratios(goal, named)[index]
        context = matcher.context_ratios(goal, named, self.surroundings)[index]
        reason = f"appearance {appearance:.2g} and surroundings {context:.2g} times as likely for the goal"
        return appearance * context >= 1.0, reason
