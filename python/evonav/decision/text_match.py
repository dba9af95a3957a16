"""A decision model without a network: reads the instruction by rule and compares it with what the agent remembers.

It stands where the paper's agents ask GPT-4o. It is deterministic, free, and blind to images: it knows objects by label
and box, so it judges "on" and "next to" by geometry and a room by what stands in it. `evonav.decision.rules` holds its
answers, a file an agent family. A question of somebody else's agent may bring its own: a method `by_rule(matcher)` that
gives an answer and the reason for it.
"""

from importlib import import_module
from typing import Any, TypeVar

from evonav.decision.matching import Matcher, TextMatchConfig
from evonav.decision.questions.question import Question, Reply
from evonav.errors import DecisionError

A = TypeVar("A")

_FAMILIES = ("frontier_update", "msgnav", "three_d_mem", "unigoal")
"""Modules of `evonav.decision.rules`; each has `RULES`, which gives the function that answers a class of question."""


class TextMatch:
    """Answers every question of evonav's agents by rule."""

    needs_images = False

    def __init__(self, config: TextMatchConfig | None = None) -> None:
        """Rules with the given thresholds."""
        self.matcher = Matcher(config)
        self._rules: dict[type[Question[Any]], Any] = {}
        for family in _FAMILIES:
            self._rules.update(import_module(f"evonav.decision.rules.{family}").RULES)

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """The rule's answer; the same at every attempt.

        Raises:
            AnswerError: Nothing fits, and there is nothing to choose.
            DecisionError: There is no rule for such questions.
        """
        rule = self._rules.get(type(question))
        if rule is None and hasattr(question, "by_rule"):
            rule = _own_rule
        if rule is None:
            raise DecisionError(f"the text matcher has no rule for {type(question).__name__}: ask a model")
        answer, reason = rule(self.matcher, question)
        return Reply(answer, f"{question.words(answer)}\n{reason}")


def _own_rule(matcher: Matcher, question: Any) -> tuple[Any, str]:  # noqa: ANN401 - of a class with `by_rule`
    answer, reason = question.by_rule(matcher)
    return answer, str(reason)
