"""Make decision models by import path: see `evonav.evaluation.run.components.Backend.decision`.

Options are JSON. Those that decide what is answered are `decision_options`, part of what makes runs the same; those on
how the model is reached are `decision_host_options`. A key is neither: it is read from the environment.
"""

from collections.abc import Mapping
from typing import Any, TypeVar

from evonav.decision.custom_model import CustomClient, load_custom_model, needs_of
from evonav.decision.goal_input import GoalInput
from evonav.decision.noisy import NoiseRates, Noisy
from evonav.decision.options import AskedOptions, CustomOptions, VlmOptions
from evonav.decision.prompts import with_notice
from evonav.decision.question import DecisionModel, Question, Reply
from evonav.decision.rules import AppearanceMatch, TextMatch
from evonav.decision.vlm.account import Ledger, Usage
from evonav.decision.vlm.client import VlmClient
from evonav.decision.vlm.decision import VlmDecision, with_schema
from evonav.decision.vlm.relay import RelayedClient
from evonav.errors import InvalidArgumentError

A = TypeVar("A")

OUTPUT_TOKENS = 100
"""Assumed length of an answer: a line and a sentence or two of reasons."""


def text_match(seed: int, *, noise: Mapping[str, float] | None = None) -> DecisionModel:
    """Make the text matcher.

    Args:
        noise: Rates of mistakes, by the names of `NoiseRates`; all models accept them.
    """
    return _with_noise(TextMatch(), noise, seed)


def appearance_match(
    seed: int,
    *,
    eagerness: float = 0.0,
    mistakes: float = 0.0,
    goal_input: GoalInput = "text",
    noise: Mapping[str, float] | None = None,
) -> DecisionModel:
    """Make the rules that look; see `AppearanceMatch`. The seed is that of the mistakes as well.

    Raises:
        InvalidArgumentError: A number is out of range.
    """
    model = AppearanceMatch(eagerness=eagerness, mistakes=mistakes, goal_input=goal_input, seed=seed)
    return _with_noise(model, noise, seed)


def vlm(seed: int, **options: Any) -> DecisionModel:  # noqa: ANN401 - JSON, checked
    """Make a model behind an OpenAI-compatible endpoint.

    Args:
        seed: Seed of the agent. Questions do not depend on it, so agents that ask the same get the same answer.
        **options: The fields of `VlmOptions`.

    Raises:
        InvalidArgumentError: An option makes no sense.
        StoreError: The file of exchanges cannot be opened.
    """
    given = VlmOptions(**options)
    client: VlmClient | RelayedClient
    client = given.client() if given.relay is None else RelayedClient(given.relay, never_asks=given.mode == "replay")
    return _with_noise(VlmDecision(client, given), given.noise, seed)


def custom(seed: int, **options: Any) -> DecisionModel:  # noqa: ANN401 - JSON, checked
    """Make a model of your own: a `DecisionModel`, or an object with `ask(prompt) -> str`.

    Args:
        seed: Seed of the agent, for a factory with a parameter `seed`.
        **options: The fields of `CustomOptions`; those on prompts and their cache are for a model with `ask`.

    Raises:
        InvalidArgumentError: It cannot be imported or made, is none such, or answers itself and has options on prompts.
        StoreError: The file of exchanges cannot be opened.
    """
    given = CustomOptions(**options)
    path, model = given.path, load_custom_model(given.path, seed)
    if isinstance(model, DecisionModel):
        if given.tells_of_change:
            raise InvalidArgumentError(f"{path}: a model with `answer` makes its own prompts; tell it of changes there")
        if given.goal_input != "text":
            raise InvalidArgumentError(f"{path}: a model with `answer` says itself what it goes by, as `goal_input`")
        return _with_noise(model, given.noise, seed)
    client = CustomClient(
        path,
        model,
        store=given.store(),
        mode=given.mode,
        account=given.new_account(path),
        keeps_images=given.keeps_images,
    )
    asked = given.model_copy(update={"images": "images" in needs_of(model)})
    return _with_noise(VlmDecision(client, asked), given.noise, seed)


def counting(seed: int, *, ledger: str, **options: Any) -> DecisionModel:  # noqa: ANN401 - JSON, checked
    """Make a text matcher that notes in `ledger` what `vlm` would be asked with the same options; see `VlmOptions`."""
    given = VlmOptions(**options)
    counted = Counting(TextMatch(), VlmClient(given.config), Ledger(ledger), str(seed), given)
    return _with_noise(counted, given.noise, seed)


class Counting(DecisionModel):
    """A decision model that notes what its questions would cost; its rules know no more of a picture than the type."""

    def __init__(
        self, model: DecisionModel, client: VlmClient, ledger: Ledger, name: str, options: AskedOptions
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


def _with_noise(model: DecisionModel, noise: Mapping[str, float] | None, seed: int) -> DecisionModel:
    return Noisy(model, NoiseRates(**noise), seed) if noise else model
