"""A decision model that says what it is told to: for tests of agents, and for agents of yours."""

from collections.abc import Callable
from typing import Any, TypeVar

from evonav.decision.question import Question, Reply

A = TypeVar("A")


class Scripted:
    """Puts a script's words through the grammar of the question, as if a model had said them."""

    def __init__(self, script: Callable[[Question[Any]], str], *, needs_images: bool = False) -> None:
        """A model whose answers are `script(question)`.

        Args:
            script: May raise `AnswerError` for a refusal or a lost answer.
            needs_images: Whether questions shall hold images.
        """
        self._script = script
        self.needs_images = needs_images
        self.questions: list[Question[Any]] = []
        """All that was asked."""

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """What the script says.

        Raises:
            AnswerError: It is no answer.
        """
        self.questions.append(question)
        text = self._script(question)
        return Reply(question.parse(text), text)
