"""Decide without a network: every question is answered by its own rule, which asks a matcher.

`TextMatch` stands where the paper's agents ask GPT-4o. It is deterministic, free, and blind to images.
`AppearanceMatch` also sees colours and sizes.
"""

import math
from typing import TypeVar

from evonav.decision.appearance import AppearanceMatcher, MistakenMatcher
from evonav.decision.goal_input import GoalInput, check_goal_input
from evonav.decision.question import DecisionModel, Question, Reply
from evonav.decision.text.matcher import Matcher
from evonav.errors import InvalidArgumentError

A = TypeVar("A")


class TextMatch(DecisionModel):
    """Answers every question by the question's own rule, which asks the matcher; it draws no random numbers."""

    matcher: Matcher

    def __init__(self) -> None:
        """Create a model with a matcher of its own."""
        self.matcher = Matcher()

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """Return the rule's answer, or raise as the question's `by_rule` does."""
        answer, reason = question.by_rule(self.matcher)
        return Reply(answer, f"{question.answer_text(answer)}\n{reason}")


class AppearanceMatch(TextMatch):
    """Rules that look: they ask the matcher how likely each object is, by its words, colours, size and surroundings."""

    needs = frozenset({"colours"})

    def __init__(
        self, *, eagerness: float = 0.0, mistakes: float = 0.0, goal_input: GoalInput = "text", seed: int = 0
    ) -> None:
        """Create a model.

        Args:
            eagerness: 0 to 1; more ends exploration for an object that is less likely the goal.
            mistakes: Temperature, 0 or more, at which objects are drawn from the posterior; 0 draws none.
            goal_input: Form of the goal that agents go by: the sentence, the picture, or both.

        Raises:
            InvalidArgumentError: A number is out of range, or there is no such input.
        """
        if not 0.0 <= eagerness <= 1.0:
            raise InvalidArgumentError(f"eagerness = {eagerness!r}: expected a number from 0 to 1")
        if not (math.isfinite(mistakes) and mistakes >= 0.0):
            raise InvalidArgumentError(f"mistakes = {mistakes!r}: expected a temperature, 0 or more")
        check_goal_input(goal_input, sees_images=True)
        self.goal_input = goal_input
        draws = MistakenMatcher(mistakes, seed, eagerness=eagerness) if mistakes > 0.0 else None
        self.matcher = draws or AppearanceMatcher(eagerness=eagerness)
