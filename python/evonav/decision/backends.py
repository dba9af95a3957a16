"""What makes decision models, by import path: see `evonav.evaluation.run.components.Backend.decision`.

Options are JSON. Those that decide what is answered are `decision_options`, part of what makes runs the same; those on
how the model is reached are `decision_host_options`. A key is neither: it is read from the environment.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from evonav.decision.question import DecisionModel

if TYPE_CHECKING:  # the text matcher loads none of this
    from evonav.decision.vlm.client import VlmConfig

SAMPLING: Mapping[str, Any] = {
    "temperature": 0.7,
    "top_p": 0.95,
    "max_tokens": 4096,
    "seed": 0,
    "image_detail": "high",
}
"""3D-Mem's, whose questions the paper's agents build on; the paper does not state its own. The seed is ours."""


def text_match(seed: int, *, noise: Mapping[str, float] | None = None) -> DecisionModel:
    """The rules of `evonav.decision.text.decision`, which draw nothing.

    Args:
        seed: Of the agent.
        noise: Rates of mistakes, by the names of `NoiseRates`; so for all of these.
    """
    from evonav.decision.text.decision import TextMatch

    return _with_noise(TextMatch(), noise, seed)


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
) -> DecisionModel:
    """A model behind an OpenAI-compatible endpoint.

    Args:
        seed: Of the agent; questions do not depend on it, so agents that ask the same have the same answer.
        model: Its name, as the server calls it.
        structured: Whether answers are held to a JSON Schema: auto, on, off.
        images: Whether the model is shown images.
        request: What else requests say, by the names of `VlmConfig`; what is not given is `SAMPLING`.
        server: How the server is reached, by the names of `VlmConfig`.
        cache: File of recorded exchanges.
        mode: Default `auto` with a file, else `live`.
        keeps_images: Whether that file gets the images too.
        ledger: File that books what all processes of the run spend.
        account: Name in that file; default: the model's.
        price: Of the model: dollars a million tokens, in and out.
        max_cost_usd: Most that the run may spend; needs `price`.
        noise: Rates of mistakes.

    Raises:
        InvalidArgumentError: An option makes no sense.
        StoreError: The file of exchanges cannot be opened.
    """
    from evonav.decision.vlm.account import Account, Price
    from evonav.decision.vlm.client import VlmClient
    from evonav.decision.vlm.decision import VlmDecision
    from evonav.decision.vlm.ledger import Ledger
    from evonav.decision.vlm.response_cache import ResponseCache

    store = None if cache is None else ResponseCache(Path(cache))
    config = vlm_config(model, request, server)
    booked = Account(
        None if price is None else Price(*price),
        max_cost_usd,
        ledger=None if ledger is None else Ledger(ledger),
        model=account or model,
    )
    client = VlmClient(config, store=store, mode=mode, account=booked, keeps_failures=True, keeps_images=keeps_images)
    return _with_noise(VlmDecision(client, structured=structured, needs_images=images), noise, seed)


def own(
    seed: int,
    *,
    path: str,
    cache: str | None = None,
    mode: str | None = None,
    keeps_images: bool = True,
    ledger: str | None = None,
    account: str | None = None,
    noise: Mapping[str, float] | None = None,
) -> DecisionModel:
    """A model of your own: an object with `answer(question, attempt)`, or just with `ask(prompt) -> str`.

    Args:
        seed: Of the agent; handed to what has a parameter `seed`.
        path: Import path `module:name` of a class, or of a function that makes the object.
        cache: File of recorded exchanges, for a model with `ask`.
        mode: Default `auto` with a file, else `live`.
        keeps_images: Whether that file gets the images too.
        ledger: File that counts the run's questions.
        account: Name in that file; default: the model's path.
        noise: Rates of mistakes.

    Raises:
        InvalidArgumentError: It cannot be imported or made, or is none such.
        StoreError: The file of exchanges cannot be opened.
    """
    from evonav.decision.custom_model import CustomClient, load_custom_model
    from evonav.decision.vlm.account import Account
    from evonav.decision.vlm.decision import VlmDecision
    from evonav.decision.vlm.ledger import Ledger
    from evonav.decision.vlm.response_cache import ResponseCache

    model = load_custom_model(path, seed)
    if hasattr(model, "answer"):
        return _with_noise(cast("DecisionModel", model), noise, seed)
    booked = Account(ledger=None if ledger is None else Ledger(ledger), model=account or path)
    store = None if cache is None else ResponseCache(Path(cache))
    client = CustomClient(path, model, store=store, mode=mode, account=booked, keeps_images=keeps_images)
    needs_images = bool(getattr(model, "needs_images", True))
    return _with_noise(VlmDecision(client, structured="off", needs_images=needs_images), noise, seed)


def counting(
    seed: int,
    *,
    model: str,
    ledger: str,
    structured: str = "auto",
    images: bool = True,
    request: Mapping[str, Any] | None = None,
    noise: Mapping[str, float] | None = None,
) -> DecisionModel:
    """The text matcher, booking in `ledger` what `vlm` with the same options would be asked; see `vlm`."""
    from evonav.decision.text.decision import TextMatch
    from evonav.decision.vlm.client import VlmClient
    from evonav.decision.vlm.counting import Counting
    from evonav.decision.vlm.ledger import Ledger

    client = VlmClient(vlm_config(model, request))
    is_json = structured != "off"
    counted = Counting(TextMatch(), client, Ledger(ledger), str(seed), needs_images=images, is_json=is_json)
    return _with_noise(counted, noise, seed)


def _with_noise(model: DecisionModel, noise: Mapping[str, float] | None, seed: int) -> DecisionModel:
    if not noise:
        return model
    from evonav.decision.noisy import NoiseRates, Noisy

    return Noisy(model, NoiseRates.read(noise), seed)


def vlm_config(
    model: str, request: Mapping[str, Any] | None = None, server: Mapping[str, Any] | None = None
) -> "VlmConfig":
    """How decisions are asked for, with `SAMPLING` where nothing else is said.

    Raises:
        InvalidArgumentError: A name is unknown, or a value makes no sense.
    """
    from evonav.decision.vlm.client import VlmConfig
    from evonav.errors import InvalidArgumentError

    try:
        return VlmConfig(model, **{**SAMPLING, **(request or {}), **(server or {})})
    except TypeError as error:
        raise InvalidArgumentError(f"decision options: {error}") from error
