"""Count what a run would ask a model, without asking: the text matcher decides, and every prompt is built."""

from typing import TypeVar

from evonav.decision.options import PromptOptions
from evonav.decision.prompts import with_notice
from evonav.decision.question import DecisionModel, Question, Reply
from evonav.decision.vlm.client import VlmClient
from evonav.decision.vlm.decision import with_schema
from evonav.decision.vlm.ledger import Ledger, Usage

A = TypeVar("A")

OUTPUT_TOKENS = 100
"""Assumed length of an answer: a line and a sentence or two of reasons."""


class Counting(DecisionModel):
    """A decision model that notes what its questions would cost; its rules know no more of a picture than the type."""

    def __init__(
        self, model: DecisionModel, client: VlmClient, ledger: Ledger, name: str, options: PromptOptions
    ) -> None:
        """Count the questions to `model`.

        Args:
            client: Client that estimates and asks nothing.
            ledger: Ledger of requests and tokens, a row a kind of question.
            name: Name of the episode, which precedes the kind.
            options: The options by which the model that is not asked would be prompted.
        """
        self.needs = frozenset({"images"}) if options.images else frozenset()
        self.goal_input = options.goal_input
        self._model = model
        self._client = client
        self._ledger = ledger
        self._name = name
        self._options = options

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """Return the model's answer."""
        prompt = with_notice(question.prompt(), tells_of_change=self._options.tells_of_change)
        if self._options.structured != "off":
            prompt = with_schema(prompt, question.answer_schema())
        used = Usage(self._client.estimate(prompt).input_tokens, OUTPUT_TOKENS)
        self._ledger.settle(f"{self._name} {question.kind}", 0.0, used)
        return self._model.answer(question, attempt)
