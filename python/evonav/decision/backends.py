"""Make decision models by import path: see `evonav.evaluation.run.components.Backend.decision`.

Options are JSON. Those that decide what is answered are `decision_options`, part of what makes runs the same; those on
how the model is reached are `decision_host_options`. A key is neither: it is read from the environment.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from evonav.decision.appearance.model import AppearanceMatch
from evonav.decision.custom_model import CustomClient, load_custom_model
from evonav.decision.goal_input import GoalInput
from evonav.decision.noisy import NoiseRates, Noisy
from evonav.decision.question import DecisionModel
from evonav.decision.text.matcher import TextMatch
from evonav.decision.vlm.account import Account, Price
from evonav.decision.vlm.client import VlmClient, VlmConfig
from evonav.decision.vlm.counting import Counting
from evonav.decision.vlm.decision import VlmDecision
from evonav.decision.vlm.ledger import Ledger
from evonav.decision.vlm.relay import RelayedClient
from evonav.decision.vlm.response_cache import ResponseCache
from evonav.errors import InvalidArgumentError

SAMPLING: Mapping[str, Any] = {
    "temperature": 0.7,
    "top_p": 0.95,
    "max_tokens": 4096,
    "seed": 0,
    "image_detail": "high",
}
"""Sampling of 3D-Mem, on which the paper's agents build; the paper does not state its own. The seed is ours."""


def text_match(seed: int, *, noise: Mapping[str, float] | None = None) -> DecisionModel:
    """Make the text matcher, which draws no random numbers.

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
    """Make the rules that look: see `AppearanceMatch`.

    Args:
        seed: Seed of the agent, and of the mistakes.
        eagerness: 0 to 1.
        mistakes: Temperature, 0 or more.
        goal_input: Form of the goal that agents go by: text, image or both.
        noise: Rates of other mistakes.

    Raises:
        InvalidArgumentError: A number is out of range.
    """
    model = AppearanceMatch(eagerness=eagerness, mistakes=mistakes, goal_input=goal_input, seed=seed)
    return _with_noise(model, noise, seed)


def vlm(
    seed: int,
    *,
    model: str,
    structured: Any = "auto",  # noqa: ANN401 - JSON, checked
    images: bool = True,
    request: Mapping[str, Any] | None = None,
    server: Mapping[str, Any] | None = None,
    cache: str | None = None,
    mode: Any = None,  # noqa: ANN401 - JSON, checked
    keeps_images: bool = True,
    ledger: str | None = None,
    account: str | None = None,
    price: Sequence[float] | None = None,
    max_cost_usd: float | None = None,
    noise: Mapping[str, float] | None = None,
    tells_of_change: bool = False,
    goal_input: GoalInput = "text",
    relay: int | None = None,
) -> DecisionModel:
    """Make a model behind an OpenAI-compatible endpoint.

    Args:
        seed: Seed of the agent. Questions do not depend on it, so agents that ask the same get the same answer.
        model: The model's name on the server.
        structured: Answers by JSON Schema: auto, on, off.
        images: True if the model is shown images.
        request: Other fields of requests, by the names of `VlmConfig`; missing ones are those of `SAMPLING`.
        server: Connection to the server, by the names of `VlmConfig`.
        cache: File of recorded exchanges.
        mode: Default `auto` with a cache, else `live`.
        keeps_images: True to store the images in the cache too.
        ledger: File with the spending of all processes of the run.
        account: Name in the ledger; default: the model's.
        price: Dollars a million tokens, in and out.
        max_cost_usd: Largest cost of the run; needs `price`.
        noise: Rates of mistakes.
        tells_of_change: See `with_notice`.
        goal_input: Form of the goal that agents go by: text, image or both.
        relay: Descriptor of a connection to a process that asks the model for this one, see `RelayedClient`; options
            on how the model is reached are that process's.

    Raises:
        InvalidArgumentError: An option makes no sense.
        StoreError: The file of exchanges cannot be opened.
    """
    client: VlmClient | RelayedClient
    if relay is None:
        client = vlm_client(
            model=model,
            request=request,
            server=server,
            cache=cache,
            mode=mode,
            keeps_images=keeps_images,
            ledger=ledger,
            account=account,
            price=price,
            max_cost_usd=max_cost_usd,
        )
    else:
        client = RelayedClient(relay, never_asks=mode == "replay")
    decision = VlmDecision(
        client, structured=structured, needs_images=images, tells_of_change=tells_of_change, goal_input=goal_input
    )
    return _with_noise(decision, noise, seed)


def vlm_client(
    *,
    model: str,
    request: Mapping[str, Any] | None = None,
    server: Mapping[str, Any] | None = None,
    cache: str | None = None,
    mode: Any = None,  # noqa: ANN401 - JSON, checked
    keeps_images: bool = True,
    ledger: str | None = None,
    account: str | None = None,
    price: Sequence[float] | None = None,
    max_cost_usd: float | None = None,
    **_: Any,  # noqa: ANN401 - other options of `vlm`, which say how its answers are used
) -> VlmClient:
    """Make the client of `vlm`, which has its arguments and errors."""
    store = None if cache is None else ResponseCache(Path(cache))
    booked = Account(
        None if price is None else Price(*price),
        max_cost_usd,
        ledger=None if ledger is None else Ledger(ledger),
        model=account or model,
    )
    config = vlm_config(model, request, server)
    return VlmClient(config, store=store, mode=mode, account=booked, keeps_failures=True, keeps_images=keeps_images)


def own(
    seed: int,
    *,
    path: str,
    cache: str | None = None,
    mode: Any = None,  # noqa: ANN401 - JSON, checked
    keeps_images: bool = True,
    ledger: str | None = None,
    account: str | None = None,
    noise: Mapping[str, float] | None = None,
    tells_of_change: bool = False,
    goal_input: GoalInput = "text",
) -> DecisionModel:
    """Make a model of your own: an object with `answer(question, attempt)`, or just with `ask(prompt) -> str`.

    Args:
        seed: Seed of the agent, for a factory with a parameter `seed`.
        path: Import path `module:name` of a class, or of a function that makes the object.
        cache: File of recorded exchanges, for a model with `ask`.
        mode: Default `auto` with a cache, else `live`.
        keeps_images: True to store the images in the cache too.
        ledger: File that counts the run's questions.
        account: Name in the ledger; default: the model's path.
        noise: Rates of mistakes.
        tells_of_change: See `with_notice`; for a model with `ask`.
        goal_input: Form of the goal that agents go by: text, image or both; for a model with `ask`.

    Raises:
        InvalidArgumentError: It cannot be imported or made, is none such, or has `answer` and is to be told of changes.
        StoreError: The file of exchanges cannot be opened.
    """
    model = load_custom_model(path, seed)
    if hasattr(model, "answer"):
        if tells_of_change:
            raise InvalidArgumentError(f"{path}: a model with `answer` makes its own prompts; tell it of changes there")
        if goal_input != "text":
            raise InvalidArgumentError(f"{path}: a model with `answer` says itself what it goes by, as `goal_input`")
        return _with_noise(cast("DecisionModel", model), noise, seed)
    booked = Account(ledger=None if ledger is None else Ledger(ledger), model=account or path)
    store = None if cache is None else ResponseCache(Path(cache))
    client = CustomClient(path, model, store=store, mode=mode, account=booked, keeps_images=keeps_images)
    needs_images = bool(getattr(model, "needs_images", True))
    decision = VlmDecision(
        client, structured="off", needs_images=needs_images, tells_of_change=tells_of_change, goal_input=goal_input
    )
    return _with_noise(decision, noise, seed)


def counting(
    seed: int,
    *,
    model: str,
    ledger: str,
    structured: str = "auto",
    images: bool = True,
    request: Mapping[str, Any] | None = None,
    noise: Mapping[str, float] | None = None,
    tells_of_change: bool = False,
    goal_input: GoalInput = "text",
) -> DecisionModel:
    """Make a text matcher that notes in `ledger` what `vlm` would be asked with the same options; see `vlm`."""
    client = VlmClient(vlm_config(model, request))
    is_json = structured != "off"
    name = str(seed)
    counted = Counting(
        TextMatch(),
        client,
        Ledger(ledger),
        name,
        needs_images=images,
        is_json=is_json,
        tells_of_change=tells_of_change,
        goal_input=goal_input,
    )
    return _with_noise(counted, noise, seed)


def _with_noise(model: DecisionModel, noise: Mapping[str, float] | None, seed: int) -> DecisionModel:
    if not noise:
        return model
    return Noisy(model, NoiseRates.read(noise), seed)


def vlm_config(
    model: str, request: Mapping[str, Any] | None = None, server: Mapping[str, Any] | None = None
) -> VlmConfig:
    """Return the configuration of a client, with `SAMPLING` for missing fields.

    Raises:
        InvalidArgumentError: A name is unknown, or a value makes no sense.
    """
    try:
        return VlmConfig(model, **{**SAMPLING, **(request or {}), **(server or {})})
    except TypeError as error:
        raise InvalidArgumentError(f"decision options: {error}") from error
