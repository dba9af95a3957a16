"""A decision model whose answers are given by a function."""

from collections.abc import Callable
from typing import Any, TypeVar

from evonav.decision.question import DecisionModel, Question, Reply
from evonav.decision.rules import TextMatch

A = TypeVar("A")


class Scripted(DecisionModel):
    """Parses a script's texts by the grammar of the question, as a model's answers are."""

    def __init__(self, script: Callable[[Question[Any]], str], *, needs_images: bool = False) -> None:
        """Make a model whose answers are `script(question)`.

        Args:
            script: May raise `AnswerError` for a refusal or a lost answer.
            needs_images: Whether questions shall hold images.
        """
        self._script = script
        self.needs = frozenset({"images"}) if needs_images else frozenset()
        self.questions: list[Question[Any]] = []
        """All questions so far."""

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """Return the parsed answer of the script.

        Raises:
            AnswerError: The question's grammar refuses it.
        """
        self.questions.append(question)
        text = self._script(question)
        return Reply(question.parse(text), text)


def going(*, needs_images: bool = False, **said: str) -> Scripted:
    """Return a model that goes to the first object, else to the first frontier; on other kinds it says the words."""

    def script(question: Question[Any]) -> str:
        words = said.get(question.kind)
        return words or ("Object 0" if question.objects else "Frontier 0")  # type: ignore[attr-defined]

    return Scripted(script, needs_images=needs_images)


def scripted(**said: str | Callable[[Question[Any]], str]) -> Scripted:
    """Return the text matcher, but for questions of the kinds given: words, or a function of the question."""
    rules = TextMatch()

    def script(question: Question[Any]) -> str:
        words = said.get(question.kind.replace("-", "_"))
        if words is None:
            return question.answer_text(rules.answer(question).answer)
        return words(question) if callable(words) else words

    return Scripted(script)
