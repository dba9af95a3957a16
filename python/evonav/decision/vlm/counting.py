"""Count what a run would ask a model, without asking: the text matcher decides, and every prompt is built."""

from typing import TypeVar

from evonav.decision.goal_input import GoalInput
from evonav.decision.prompts import with_notice
from evonav.decision.question import DecisionModel, Question, Reply
from evonav.decision.vlm.client import VlmClient
from evonav.decision.vlm.decision import with_schema
from evonav.decision.vlm.ledger import Ledger, Usage

A = TypeVar("A")

OUTPUT_TOKENS = 100
"""Assumed length of an answer: a line and a sentence or two of reasons."""


class Counting:
    """A decision model that notes what its questions would cost."""

    def __init__(
        self,
        model: DecisionModel,
        client: VlmClient,
        ledger: Ledger,
        name: str,
        *,
        needs_images: bool,
        is_json: bool,
        tells_of_change: bool = False,
        goal_input: GoalInput = "text",
    ) -> None:
        """Count the questions to `model`.

        Args:
            client: Client that estimates and asks nothing.
            ledger: Ledger of requests and tokens, a row a kind of question.
            name: Name of the episode, which precedes the kind.
            needs_images: True if questions should have images, as they would for the model.
            is_json: True if requests would come with a JSON Schema.
            tells_of_change: See `with_notice`.
            goal_input: Form of the goal that agents go by; of a picture, the text matcher knows the category alone.
        """
        self.needs_images = needs_images
        self.goal_input = goal_input
        self._model = model
        self._client = client
        self._ledger = ledger
        self._name = name
        self._is_json = is_json
        self._tells_of_change = tells_of_change

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """Return the model's answer."""
        prompt = with_notice(question.prompt(), tells_of_change=self._tells_of_change)
        if self._is_json:
            prompt = with_schema(prompt, question.answer_schema())
        used = Usage(self._client.estimate(prompt).input_tokens, OUTPUT_TOKENS)
        self._ledger.settle(f"{self._name} {question.kind}", 0.0, used)
        return self._model.answer(question, attempt)
