"""Asks a vision-language model behind any OpenAI-compatible endpoint.

    client = VlmClient(VlmConfig("gpt-4o"), store=ExchangeStore("exchanges.sqlite"))
    answer = client.ask(Prompt.of(Text("What is this?"), Picture(image)))

Retries of lost connections, of 429 and of 5xx are the SDK's, which honours `Retry-After`; what remains is a `VlmError`.
Keys come from the caller or the environment, are sent in the header, and appear in no file, record or message.
"""

import base64
import json
import os
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evonav.decision.account import CHARACTERS_PER_TOKEN, Account, Usage, image_tokens
from evonav.decision.exchanges import ExchangeStore, JsonObject, image_name, key_of
from evonav.decision.prompts import Picture, Prompt, Text, Turn
from evonav.decision.vlm_errors import VlmError
from evonav.errors import DecisionError, InvalidArgumentError

if TYPE_CHECKING:
    import openai

Mode = Literal["live", "record", "replay", "auto"]
"""`live` keeps nothing, `record` asks and keeps, `replay` never asks, `auto` asks what is not kept."""
MODES: tuple[Mode, ...] = ("live", "record", "replay", "auto")
MAX_ANSWER_BYTES = 2**20
"""Longest response that is read as one."""
KEY_VARIABLE, URL_VARIABLE = "OPENAI_API_KEY", "OPENAI_BASE_URL"


@dataclass(frozen=True, slots=True)
class VlmConfig:
    """How to reach a model."""

    model: str
    base_url: str | None = None
    """Of the API, with its `/v1`; default `OPENAI_BASE_URL`, else OpenAI's."""
    api_key: str | None = field(default=None, repr=False)
    """Default `OPENAI_API_KEY`; servers of one's own mostly need none."""
    timeout_s: float = 60.0
    """Of one try."""
    max_retries: int = 4
    max_concurrency: int = 4
    """Most questions under way at a time, over all threads."""
    temperature: float | None = 0.0
    """`None` leaves it to the server; some models allow no other."""
    seed: int | None = 0
    max_tokens: int = 300
    """Of an answer."""
    max_tokens_field: Literal["max_tokens", "max_completion_tokens"] = "max_tokens"
    """How the server calls that; OpenAI's reasoning models know the second alone."""
    image_detail: Literal["low", "high", "auto"] = "auto"

    def __post_init__(self) -> None:
        """Checks what a typing mistake may have made of it.

        Raises:
            InvalidArgumentError: It names the field.
        """
        least = {"timeout_s": 1e-3, "max_retries": 0, "max_concurrency": 1, "max_tokens": 1}
        for name, minimum in least.items():
            value = getattr(self, name)
            if not np.isfinite(value) or value < minimum:
                raise InvalidArgumentError(f"{name}: expected {minimum:g} or more, got {value!r}")
        if not self.model:
            raise InvalidArgumentError("model: expected a name, got ''")


@dataclass(frozen=True, slots=True)
class Answer:
    """A whole answer."""

    text: str
    model: str
    """As the server calls it, with its version."""
    usage: Usage
    key: str
    """Of the exchange."""
    is_replayed: bool


class VlmClient:
    """Asks, keeps what came back, and counts what it cost. Any number of threads may use one client."""

    def __init__(
        self,
        config: VlmConfig,
        *,
        store: ExchangeStore | None = None,
        mode: Mode | None = None,
        account: Account | None = None,
    ) -> None:
        """A client; nothing is asked or imported yet.

        Args:
            config: Model and endpoint.
            store: Of exchanges; every mode but `live` needs one.
            mode: Default `auto` with a store, else `live`.
            account: Default one without prices or limit.

        Raises:
            InvalidArgumentError: The mode needs a store.
        """
        self.config = config
        self.store = store
        self.mode: Mode = mode or ("live" if store is None else "auto")
        self.account = account or Account()
        if self.mode not in MODES:
            raise InvalidArgumentError(f"mode: expected one of {', '.join(MODES)}, got {self.mode!r}")
        if self.mode != "live" and store is None:
            raise InvalidArgumentError(f"mode {self.mode}: needs a file of exchanges")
        self._slots = threading.BoundedSemaphore(config.max_concurrency)
        self._lock = threading.Lock()
        self._sdk: openai.OpenAI | None = None

    def ask(self, prompt: Prompt) -> Answer:
        """The model's answer.

        Raises:
            VlmError: There is none that could be used; `kind` says why.
            StoreError: The exchanges cannot be read or written.
            DecisionError: The package `openai` is missing.
        """
        kept = self.request_of(prompt, image_name)
        key = key_of(kept)
        if self.store is not None and self.mode in ("replay", "auto"):
            response = self.store.get(key)
            if response is not None:
                self.account.replayed()
                return _answer(response, key, is_replayed=True)
            if self.mode == "replay":
                raise VlmError("not_recorded", f"{self.store.path} has no exchange {key}")
        response = self._ask_server(self.request_of(prompt), self.estimate(prompt))
        try:
            return _answer(response, key, is_replayed=False)
        except VlmError as error:
            if error.kind == "malformed":
                kept = {}
            raise
        finally:
            # A refusal is an answer too.
            if self.store is not None and self.mode != "live" and kept:
                pictures = [part for turn in prompt.turns for part in turn.parts if isinstance(part, Picture)]
                images = {image_name(picture.pixels): _png(picture.pixels) for picture in pictures}
                self.store.put(kept, images, response)

    def is_kept(self, prompt: Prompt) -> bool:
        """Whether the store has the answer."""
        return self.store is not None and self.store.get(key_of(self.request_of(prompt, image_name))) is not None

    def request_of(self, prompt: Prompt, url_of: Callable[[NDArray[np.uint8]], str] | None = None) -> JsonObject:
        """The body that is posted to `/chat/completions`.

        Args:
            prompt: What is asked.
            url_of: Of an image; default all of it, as PNG in a `data:` URL.
        """
        config = self.config
        request: JsonObject = {
            "model": config.model,
            "messages": [_message(turn, config.image_detail, url_of or _data_url) for turn in prompt.turns],
            config.max_tokens_field: config.max_tokens,
        }
        if config.temperature is not None:
            request["temperature"] = config.temperature
        if config.seed is not None:
            request["seed"] = config.seed
        if prompt.schema is not None:
            schema = {"name": "answer", "strict": True, "schema": dict(prompt.schema)}
            request["response_format"] = {"type": "json_schema", "json_schema": schema}
        return request

    def estimate(self, prompt: Prompt) -> Usage:
        """Tokens that a question may cost, rather too many than too few."""
        tokens = 0.0
        for part in (part for turn in prompt.turns for part in turn.parts):
            if isinstance(part, Text):
                tokens += 8 + len(part.text) / CHARACTERS_PER_TOKEN
            else:
                height, width = part.pixels.shape[:2]
                tokens += image_tokens((width, height), self.config.image_detail)
        return Usage(int(tokens) + 1, self.config.max_tokens)

    def _ask_server(self, request: JsonObject, estimate: Usage) -> JsonObject:
        """Asks within the limits of money and of questions at a time."""
        reserved_usd = self.account.reserve(estimate)
        usage: Usage | None = None
        try:
            with self._slots:
                response = self._post(request)
            # Servers that count no tokens are taken to have used what was expected.
            usage = _usage(response) or estimate
            return response
        finally:
            self.account.settle(reserved_usd, usage)

    def _post(self, request: JsonObject) -> JsonObject:
        sdk = self._client()
        import openai

        try:
            raw = sdk.chat.completions.with_raw_response.create(**request)
            text = raw.text if isinstance(raw.text, str) else raw.text()
        except openai.APITimeoutError as error:
            raise VlmError("timeout", f"no answer in {self.config.timeout_s:g} s") from error
        except openai.APIConnectionError as error:
            raise VlmError("connection", self._without_key(error.__cause__ or error)) from None
        except openai.RateLimitError as error:
            raise VlmError("rate_limited", self._without_key(error)) from None
        except (openai.AuthenticationError, openai.PermissionDeniedError) as error:
            raise VlmError("unauthorized", self._without_key(error)) from None
        except openai.APIStatusError as error:
            kind: Literal["server", "bad_request"] = "server" if error.status_code >= 500 else "bad_request"
            raise VlmError(kind, self._without_key(error)) from None
        except openai.OpenAIError as error:
            raise VlmError("malformed", self._without_key(error)) from None
        if len(text) > MAX_ANSWER_BYTES:
            raise VlmError("oversized", f"a response of {len(text)} characters")
        try:
            response = json.loads(text)
        except ValueError as error:
            raise VlmError("malformed", f"not JSON: {error}: {text[:80]!r}") from error
        if not isinstance(response, dict):
            raise VlmError("malformed", f"expected an object, got {text[:80]!r}")
        return response

    def _client(self) -> "openai.OpenAI":
        """The SDK's client, made once.

        Raises:
            DecisionError: The package is missing, or there is no key.
        """
        with self._lock:
            if self._sdk is None:
                try:
                    import openai
                except ImportError as error:
                    raise DecisionError(f"asking a model needs openai ({error}): pip install 'evonav[vlm]'") from error
                base_url = self.config.base_url or os.environ.get(URL_VARIABLE) or None
                key = self._key()
                if not key and base_url is None:
                    raise DecisionError(f"asking a model needs a key: set {KEY_VARIABLE}, or give a base URL")
                self._sdk = openai.OpenAI(
                    api_key=key or "none",
                    base_url=base_url,
                    timeout=self.config.timeout_s,
                    max_retries=self.config.max_retries,
                )
            return self._sdk

    def _key(self) -> str:
        return self.config.api_key or os.environ.get(KEY_VARIABLE) or ""

    def _without_key(self, error: BaseException) -> str:
        """An error's words; servers quote keys."""
        words = " ".join(str(error).split())[:500]
        key = self._key()
        return words.replace(key, "***") if key else words


def _message(turn: Turn, detail: str, url_of: Callable[[NDArray[np.uint8]], str]) -> JsonObject:
    if turn.role != "user":
        return {"role": turn.role, "content": "".join(part.text for part in turn.parts if isinstance(part, Text))}
    content: list[JsonObject] = []
    for part in turn.parts:
        if isinstance(part, Text):
            content.append({"type": "text", "text": part.text})
        else:
            content.append({"type": "image_url", "image_url": {"url": url_of(part.pixels), "detail": detail}})
    return {"role": "user", "content": content}


def _data_url(pixels: NDArray[np.uint8]) -> str:
    return "data:image/png;base64," + base64.b64encode(_png(pixels)).decode()


def _png(pixels: NDArray[np.uint8]) -> bytes:
    buffer = BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(buffer, "PNG")
    return buffer.getvalue()


def _usage(response: JsonObject) -> Usage | None:
    """Tokens as the server counts them; `None` where it does not."""
    usage = response.get("usage")
    counts = [usage.get(name) for name in ("prompt_tokens", "completion_tokens")] if isinstance(usage, dict) else []
    numbers = [count for count in counts if isinstance(count, int) and count >= 0]
    return Usage(*numbers) if len(numbers) == 2 else None


def _answer(response: JsonObject, key: str, *, is_replayed: bool) -> Answer:
    """The answer in a response.

    Raises:
        VlmError: There is none that is whole.
    """
    choices = response.get("choices")
    choice = choices[0] if isinstance(choices, list) and choices else None
    message = choice.get("message") if isinstance(choice, dict) else None
    if not isinstance(choice, dict) or not isinstance(message, dict):
        raise VlmError("malformed", f"a response without a message: {json.dumps(response)[:200]}")
    if message.get("refusal"):
        raise VlmError("refusal", str(message["refusal"])[:200])
    content = _content(message.get("content"))
    reason = choice.get("finish_reason")
    if reason == "content_filter":
        raise VlmError("refusal", "stopped by the server's filter of contents")
    if reason == "length":
        raise VlmError("truncated", f"cut off after {len(content)} characters: {content[:80]!r}")
    if not content.strip():
        raise VlmError("empty", f"an answer without words (finish_reason {reason!r})")
    model = response.get("model")
    return Answer(content, model if isinstance(model, str) else "", _usage(response) or Usage(), key, is_replayed)


def _content(content: Any) -> str:  # noqa: ANN401
    """A message's words: a string, or parts of which some are text.

    Raises:
        VlmError: It is neither.
    """
    if content is None:
        return ""
    if isinstance(content, str):
        return content
    if isinstance(content, Sequence) and all(isinstance(part, dict) for part in content):
        return "".join(part["text"] for part in content if isinstance(part.get("text"), str))
    raise VlmError("malformed", f"content: expected words, got {str(content)[:80]!r}")
