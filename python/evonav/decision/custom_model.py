"""Models of your own: a `DecisionModel`, or any object with `ask(prompt) -> str`.

One with `ask` has a cache as a model behind an endpoint has.
"""

import inspect
from collections.abc import Callable
from typing import Any, Protocol, cast

from evonav.component import import_callable
from evonav.decision.prompts import Prompt
from evonav.decision.question import DecisionModel, Need
from evonav.decision.vlm.account import Account, Usage
from evonav.decision.vlm.caching_client import CachingClient, JsonObject, Mode, ResponseCache
from evonav.decision.vlm.errors import VlmError
from evonav.errors import DecisionError, InvalidArgumentError


class AskedModel(Protocol):
    """The least that a model of your own must have. With `needs = frozenset()` it gets no images."""

    def ask(self, prompt: Prompt) -> str:
        """Answer a prompt in its grammar.

        Raises:
            TimeoutError, ConnectionError: No answer came this time; the question is asked again.
        """
        ...


class CustomClient(CachingClient):
    """Asks a model of your own, and caches its answers by name and prompt."""

    def __init__(
        self,
        name: str,
        model: AskedModel,
        *,
        store: ResponseCache | None = None,
        mode: Mode | None = None,
        account: Account | None = None,
        keeps_images: bool = True,
    ) -> None:
        """Create a client; see `CachingClient` for the other arguments.

        Args:
            name: Name of the model in the keys of the cache: another name, other exchanges.
            mode: Default `auto` with a store, else `live`.
            keeps_images: True to store the images' files beside their hashes.

        Raises:
            InvalidArgumentError: The mode is unknown, or needs a store.
        """
        super().__init__(store=store, mode=mode, account=account, keeps_images=keeps_images)
        self.name = name
        self.model = model

    def cached_request(self, prompt: Prompt, attempt: int = 0) -> JsonObject:
        """Return the content that an exchange's key is computed from."""
        turns = [
            {
                "role": turn.role,
                "content": [part if isinstance(part, str) else {"image": part.name} for part in turn.parts],
            }
            for turn in prompt.turns
        ]
        return {"custom_model": self.name, "turns": turns, "attempt": attempt}

    def _ask_model(self, prompt: Prompt, attempt: int) -> JsonObject:
        reserved_usd = self.account.reserve(Usage())
        usage: Usage | None = None
        try:
            text = self.model.ask(prompt)
            usage = Usage()
        except TimeoutError as error:
            raise VlmError("timeout", str(error) or "no answer in time") from error
        except ConnectionError as error:
            raise VlmError("connection", str(error) or "connection lost") from error
        except DecisionError:
            raise
        except Exception as error:
            raise DecisionError(f"{self.name}: {type(error).__name__}: {error}") from error
        finally:
            self.account.settle(reserved_usd, usage)
        if not isinstance(text, str):
            raise DecisionError(f"{self.name}: ask: expected a string, got {type(text).__name__}")
        return {"text": text}

    def _read(self, response: JsonObject) -> str:
        text = str(response["text"])
        if not text.strip():
            raise VlmError("empty", "an empty answer")
        return text


def needs_of(model: object) -> frozenset[Need]:
    """Return what a model with `ask` needs in its prompts: images, unless its attribute `needs` lacks them."""
    needs: frozenset[Need] = getattr(model, "needs", frozenset({"images"}))
    return needs


class _MadeWhenAsked:
    """An instance of a class with `ask`, made at the first question: a replay loads no weights."""

    def __init__(self, path: str, factory: Callable[..., Any], seed: int) -> None:
        self.needs = needs_of(factory)
        self._origin = (path, factory, seed)
        self._model: Any = None

    def ask(self, prompt: Prompt) -> str:
        if self._model is None:
            self._model = _made(*self._origin)
        answer: str = self._model.ask(prompt)
        return answer


def load_custom_model(path: str, seed: int) -> AskedModel | DecisionModel:
    """Load the model at `module:name`: a class's instance, or what a function returns.

    Made once a process and used for all its episodes, unless it has a parameter `seed`: then once an episode.

    Args:
        seed: Seed of the agent, for a factory with a parameter `seed`.

    Raises:
        InvalidArgumentError: It cannot be imported or made, or is neither a `DecisionModel` nor has `ask`.
    """
    factory = import_callable(path, "decision model")
    if inspect.isclass(factory) and hasattr(factory, "ask") and not issubclass(factory, DecisionModel):
        return _MadeWhenAsked(path, factory, seed)
    model = _made(path, factory, seed)
    if isinstance(model, DecisionModel):
        return model
    if callable(getattr(model, "ask", None)):
        return cast("AskedModel", model)
    raise InvalidArgumentError(
        f"decision `{path}`: a {type(model).__name__} is no evonav.decision.DecisionModel and has no `ask`"
    )


_MADE: dict[str, Any] = {}
"""Models by import path, so that weights are loaded once."""


def _made(path: str, factory: Callable[..., Any], seed: int) -> Any:  # noqa: ANN401 - a stranger's
    try:
        if "seed" in inspect.signature(factory).parameters:
            return factory(seed=seed)
        if path not in _MADE:
            _MADE[path] = factory()
    except Exception as error:
        raise InvalidArgumentError(f"decision `{path}`: {type(error).__name__}: {error}") from error
    return _MADE[path]
