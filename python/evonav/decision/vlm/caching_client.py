"""Ask a model through a cache: the part that all clients of models share."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Literal

from evonav.decision.prompts import Prompt
from evonav.decision.vlm.account import Account
from evonav.decision.vlm.errors import LASTING, VlmError
from evonav.decision.vlm.response_cache import JsonObject, ResponseCache, key_of
from evonav.errors import InvalidArgumentError

Mode = Literal["live", "record", "replay", "auto"]
"""`live` stores nothing, `record` asks and stores, `replay` never asks, `auto` asks only what is not cached."""
MODES: tuple[Mode, ...] = ("live", "record", "replay", "auto")


class CachingClient(ABC):
    """Asks a model, caches its responses, and counts the costs."""

    def __init__(
        self,
        *,
        store: ResponseCache | None = None,
        mode: Mode | None = None,
        account: Account | None = None,
        keeps_failures: bool = True,
        keeps_images: bool = True,
    ) -> None:
        """Create a client; nothing is asked or imported yet.

        Args:
            store: Cache of exchanges; every mode but `live` needs one.
            mode: Default `auto` with a cache, else `live`.
            account: Default: an account without prices or limit.
            keeps_failures: True to cache timeouts, lost connections, servers' errors and broken responses in mode
                `auto`, so that they happen again when a run is resumed or replayed; else they are asked again.
            keeps_images: Store the images' files beside their hashes, for people; replays need none.

        Raises:
            InvalidArgumentError: The mode is unknown, or needs a store.
        """
        self.store = store
        self.mode: Mode = mode or ("live" if store is None else "auto")
        self.account = account or Account()
        self.keeps_failures = keeps_failures
        self.keeps_images = keeps_images
        if self.mode not in MODES:
            raise InvalidArgumentError(f"mode: expected one of {', '.join(MODES)}, got {self.mode!r}")
        if self.mode != "live" and store is None:
            raise InvalidArgumentError(f"mode {self.mode}: needs a file of exchanges")

    def ask(self, prompt: Prompt, attempt: int = 0) -> str:
        """Return the model's answer, or raise as `ask_first` does; another attempt is another request."""
        return self.ask_first((prompt,), attempt)[1]

    def ask_first(self, prompts: Sequence[Prompt], attempt: int = 0, *, otherwise: int = 0) -> tuple[int, str]:
        """Return the answer to the first prompt whose outcome is cached; if none is, ask one of them.

        Args:
            prompts: Prompts that differ in the form of the answer.
            attempt: Number of earlier tries without a valid answer.
            otherwise: Index of the prompt that is asked if none is cached.

        Returns:
            Index of the prompt that was answered, and the answer.

        Raises:
            VlmError: There is no valid answer; `kind` says why.
            StoreError: The exchanges cannot be read or written.
            DecisionError: The model cannot be asked.
        """
        requests = [self.cached_request(prompt, attempt) for prompt in prompts]
        keys = [key_of(request) for request in requests]
        index, outcome = otherwise, None
        if self.store is not None and self.mode in ("replay", "auto"):
            outcomes = ((number, self.store.outcome(key)) for number, key in enumerate(keys))
            index, outcome = next((found for found in outcomes if found[1] is not None), (otherwise, None))
        if outcome is not None:
            self.account.replayed()
        elif self.mode == "replay":
            raise VlmError("not_recorded", f"{self.store and self.store.path} has no exchange {keys[index]}")
        else:
            outcome = self._ask_anew(prompts[index], attempt, requests[index])
        if isinstance(outcome, VlmError):
            raise outcome
        return index, self._read(outcome)

    def _ask_anew(self, prompt: Prompt, attempt: int, cached: JsonObject) -> JsonObject | VlmError:
        """Ask the model, and store the outcome if the mode and `keeps_failures` require it."""
        outcome: JsonObject | VlmError
        try:
            outcome = self._ask_model(prompt, attempt)
        except VlmError as error:
            if not self.keeps_failures or error.kind in LASTING:
                raise
            outcome = error
        if self.store is None or self.mode == "live":
            return outcome
        if (self.mode == "record" or not self.keeps_failures) and self._is_malformed(outcome):
            return outcome
        pictures = prompt.pictures if self.keeps_images else []
        return self.store.store(cached, pictures, outcome, replaces=self.mode == "record")

    def _is_malformed(self, outcome: JsonObject | VlmError) -> bool:
        """Return whether it is no response of a model at all; a refusal or a truncated answer is one."""
        if isinstance(outcome, VlmError):
            return True
        try:
            self._read(outcome)
        except VlmError as error:
            return error.kind == "malformed"
        return False

    def costs(self) -> dict[str, float]:
        """Return what the questions have cost so far."""
        return self.account.costs()

    @property
    def never_asks(self) -> bool:
        """True if only cached answers are returned."""
        return self.mode == "replay"

    def is_cached(self, prompt: Prompt, attempt: int = 0) -> bool:
        """Return whether the outcome of a question is cached, so that nothing is asked."""
        return self.store is not None and self.store.outcome(key_of(self.cached_request(prompt, attempt))) is not None

    def check(self) -> None:  # noqa: B027 - by default there is nothing to check
        """Check before the first question that the model can be asked; ask nothing.

        Raises:
            DecisionError: The model cannot be asked; the message says what to do.
        """

    @abstractmethod
    def cached_request(self, prompt: Prompt, attempt: int = 0) -> JsonObject:
        """Return the content that an exchange's key is computed from, with names of images."""

    @abstractmethod
    def _ask_model(self, prompt: Prompt, attempt: int) -> JsonObject:
        """Ask the model itself."""

    @abstractmethod
    def _read(self, response: JsonObject) -> str:
        """Return the answer in a response."""
