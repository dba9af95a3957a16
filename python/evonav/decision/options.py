"""Options of decision models that are asked by prompts, as a run's header and its workers state them in JSON."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from evonav.decision.goal_input import GoalInput
from evonav.decision.vlm.account import Account, Ledger, Price
from evonav.decision.vlm.caching_client import Mode, ResponseCache
from evonav.decision.vlm.client import VlmClient, VlmConfig
from evonav.errors import InvalidArgumentError
from evonav.records import Options

SAMPLING: Mapping[str, Any] = {
    "temperature": 0.7,
    "top_p": 0.95,
    "max_tokens": 4096,
    "seed": 0,
    "image_detail": "high",
}
"""Sampling of 3D-Mem, on which the paper's agents build; the paper does not state its own. The seed is ours."""

Structured = Literal["auto", "on", "off"]
"""Answers by JSON Schema: `auto` asks for them until the server refuses."""

_IDENTITY = {"path", "model", "structured", "images", "tells_of_change", "goal_input", "request", "noise"}


class AskedOptions(Options):
    """Options of all models that are asked by prompts. `identity()` decides answers, `host()` how they are reached."""

    of = "decision"
    structured: Structured = "auto"
    images: bool = True
    """The model is shown images."""
    tells_of_change: bool = False
    """Prompts say that things may have been moved; see `with_notice`."""
    goal_input: GoalInput = "text"
    """Form of the goal that agents go by."""
    noise: dict[str, float] | None = None
    """Rates of mistakes, by the names of `NoiseRates`."""
    cache: str | None = None
    """File of recorded exchanges."""
    mode: Mode | None = None
    """Default: `auto` with a cache, else `live`."""
    keeps_images: bool = True
    """Store the images in the cache too."""
    ledger: str | None = None
    """File with the spending of all processes of the run."""
    account: str | None = None
    """Name in the ledger; default: the model's."""

    def identity(self) -> dict[str, Any]:
        """Return the options that decide what is answered, as a run's header states them."""
        often_default = {"goal_input", "noise"}
        changed = self.model_dump(include=often_default, exclude_defaults=True)
        return self.model_dump(include=_IDENTITY - often_default) | changed

    def host(self) -> dict[str, Any]:
        """Return the options on how the model is reached, and where answers and costs are stored."""
        return self.model_dump(exclude=_IDENTITY, exclude_defaults=True)

    def store(self) -> ResponseCache | None:
        """Open the cache; `StoreError` if that fails."""
        return None if self.cache is None else ResponseCache(Path(self.cache))

    def new_account(self, model: str, price: Price | None = None, max_cost_usd: float | None = None) -> Account:
        """Return an account of `model`, which the ledger lists by its own name."""
        ledger = None if self.ledger is None else Ledger(self.ledger)
        return Account(price, max_cost_usd, ledger=ledger, model=self.account or model)


class CustomOptions(AskedOptions):
    """A model of your own."""

    structured: Structured = "off"
    path: str
    """Import path `module:name` of a class, or of a function that makes the object."""

    def identity(self) -> dict[str, Any]:
        """Return the options that decide what is answered; the model says itself whether it needs images."""
        return {name: value for name, value in super().identity().items() if name not in ("structured", "images")}


class VlmOptions(AskedOptions):
    """A model behind an OpenAI-compatible endpoint."""

    model: str
    """The model's name on the server."""
    request: dict[str, Any] = Field(default_factory=dict)
    """Other fields of requests, by the names of `VlmConfig`; missing ones are those of `SAMPLING`."""
    server: dict[str, Any] = Field(default_factory=dict)
    """Connection to the server, by the names of `VlmConfig`."""
    price: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    """Dollars a million tokens, in and out."""
    max_cost_usd: float | None = None
    """Largest cost of the run; needs `price`."""
    relay: int | None = None
    """Descriptor of a connection to a process that asks the model for this one, see `RelayedClient`.

    Options on how the model is reached are that process's.
    """

    @property
    def config(self) -> VlmConfig:
        """Configuration of the client; `InvalidArgumentError` if a name is unknown, or a value makes no sense."""
        try:
            return VlmConfig(self.model, **{**SAMPLING, **self.request, **self.server})
        except TypeError as error:
            raise InvalidArgumentError(f"decision: {error}") from error

    def client(self) -> VlmClient:
        """Return the client.

        Raises:
            InvalidArgumentError: An option makes no sense.
            StoreError: The cache cannot be opened.
        """
        price = None if self.price is None else Price(*self.price)
        return VlmClient(
            self.config,
            store=self.store(),
            mode=self.mode,
            account=self.new_account(self.model, price, self.max_cost_usd),
            keeps_failures=True,
            keeps_images=self.keeps_images,
        )
