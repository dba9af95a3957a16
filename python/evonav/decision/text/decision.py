"""A decision model without a network: reads the instruction by rule and compares it with what the agent remembers.

It stands where the paper's agents ask GPT-4o. It is deterministic, free, and blind to images: it knows objects by label
and box, so it judges "on" and "next to" by geometry and a room by what stands in it. Each question brings its own rule:
the method `by_rule(matcher)`, which returns an answer and the reason for it.
"""

from typing import TypeVar

from evonav.decision.question import Question, Reply
from evonav.decision.text.matcher import Matcher, TextMatchConfig

A = TypeVar("A")


class TextMatch:
    """Answers every question by the question's own rule."""

    needs_images = False

    def __init__(self, config: TextMatchConfig | None = None) -> None:
        """Create a model whose rules use the given thresholds."""
        self.matcher = Matcher(config)

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """Return the rule's answer, which is the same at every attempt.

        Raises:
            AnswerError: Nothing fits, and there is nothing to choose.
            DecisionError: The question has no rule.
        """
        answer, reason = question.by_rule(self.matcher)
        return Reply(answer, f"{question.answer_text(answer)}\n{reason}")
