"""Ask a vision-language model behind any OpenAI-compatible endpoint.

    client = VlmClient(VlmConfig("gpt-4o"), store=ResponseCache("exchanges.sqlite"))
    answer = client.ask(Prompt.of("What is this?", Picture(image)))

Retries of lost connections, of 429 and of 5xx are the SDK's, which honours `Retry-After`; what remains is a `VlmError`.
Keys come from the caller or the environment, are sent in the header, and appear in no file, record or message.
"""

import json
import os
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Literal
from urllib.parse import unquote, urlsplit

from pydantic_core import to_json

from evonav.decision.pictures import Picture
from evonav.decision.prompts import Prompt, Turn
from evonav.decision.vlm.account import CHARACTERS_PER_TOKEN, Account, Usage, image_tokens
from evonav.decision.vlm.caching_client import CachingClient, JsonObject, Mode, ResponseCache
from evonav.decision.vlm.errors import VlmError
from evonav.decision.vlm.secrets import REMOVED, without_secrets
from evonav.errors import DecisionError, InvalidArgumentError

if TYPE_CHECKING:
    import openai

MAX_ANSWER_BYTES = 2**20
"""Longest response that is read."""
KEY_VARIABLE, URL_VARIABLE = "OPENAI_API_KEY", "OPENAI_BASE_URL"


@dataclass(frozen=True, slots=True)
class VlmConfig:
    """Settings to reach a model."""

    model: str
    base_url: str | None = None
    """URL of the API, with its `/v1`; default `OPENAI_BASE_URL`, else OpenAI's."""
    api_key: str | None = field(default=None, repr=False)
    """Key of the API; default `OPENAI_API_KEY`. Your own server mostly needs none."""
    timeout_s: float = 60.0
    """Longest time of one try."""
    max_retries: int = 4
    max_concurrency: int = 4
    """Largest number of concurrent questions, over all threads."""
    temperature: float | None = 0.0
    """Sampling temperature. `None` leaves it to the server; some models allow no other."""
    top_p: float | None = None
    """Nucleus sampling. `None` leaves it to the server."""
    seed: int | None = 0
    """Seed of the first attempt; `None` leaves it to the server."""
    max_tokens: int = 300
    """Longest answer."""
    max_tokens_field: Literal["max_tokens", "max_completion_tokens"] = "max_tokens"
    """Name of that field on the server; OpenAI's reasoning models know only the second."""
    image_detail: Literal["low", "high", "auto"] = "auto"
    requests_per_minute: float | None = None
    """Largest rate of requests of this process; retries of the SDK are not counted."""
    tokens_per_minute: float | None = None
    """Largest rate of tokens of this process, by estimate."""

    def __post_init__(self) -> None:
        """Check all fields; an `InvalidArgumentError` names the one that is wrong."""
        ranges = {
            "timeout_s": (1e-3, 1e6),
            "max_retries": (0, 1000),
            "max_concurrency": (1, 10_000),
            "max_tokens": (1, 10**7),
            "temperature": (0, 2),
            "top_p": (0, 1),
            "requests_per_minute": (1e-3, 1e9),
            "tokens_per_minute": (1, 1e12),
        }
        for name, (least, most) in ranges.items():
            value = getattr(self, name)
            if value is not None and not least <= value <= most:
                raise InvalidArgumentError(f"{name}: expected {least:g} to {most:g}, got {value!r}")
        if not self.model:
            raise InvalidArgumentError("model: expected a name, got ''")


class Pace:
    """Delays questions so that they begin no faster than the limits allow. Any number of threads may use one.

    Each question moves the earliest start of the next one on by its share of a minute, so there is no burst that a
    server with another idea of where minutes begin could object to. `Retry-After` is the client's business.
    """

    def __init__(
        self,
        requests_per_minute: float | None = None,
        tokens_per_minute: float | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Set the limits; `None` is no limit."""
        self._s_a_request = 60.0 / requests_per_minute if requests_per_minute else 0.0
        self._s_a_token = 60.0 / tokens_per_minute if tokens_per_minute else 0.0
        self._clock = clock
        self._sleep = sleep
        self._lock = threading.Lock()
        self._next_s = 0.0

    def wait(self, num_tokens: int) -> None:
        """Wait until a question of a number of tokens may begin."""
        share_s = max(self._s_a_request, self._s_a_token * num_tokens)
        if share_s == 0.0:
            return
        with self._lock:
            now_s = self._clock()
            begin_s = max(now_s, self._next_s)
            self._next_s = begin_s + share_s
        if begin_s > now_s:
            self._sleep(begin_s - now_s)


class VlmClient(CachingClient):
    """Asks a model behind an endpoint. Any number of threads may use one client."""

    def __init__(
        self,
        config: VlmConfig,
        *,
        store: ResponseCache | None = None,
        mode: Mode | None = None,
        account: Account | None = None,
        keeps_failures: bool = False,
        keeps_images: bool = True,
    ) -> None:
        """Create a client of the configured model and endpoint; see `CachingClient` for the other arguments.

        Raises:
            InvalidArgumentError: The mode is unknown, or needs a store.
        """
        super().__init__(
            store=store, mode=mode, account=account, keeps_failures=keeps_failures, keeps_images=keeps_images
        )
        self.config = config
        self._slots = threading.BoundedSemaphore(config.max_concurrency)
        self._pace = Pace(config.requests_per_minute, config.tokens_per_minute)
        self._lock = threading.Lock()
        self._sdk: openai.OpenAI | None = None

    def check(self) -> None:
        """Check before the first question that the model can be asked; ask nothing.

        Raises:
            DecisionError: The package `openai` is missing, or there is no key.
        """
        if self.mode != "replay":
            self._client()

    def cached_request(self, prompt: Prompt, attempt: int = 0) -> JsonObject:
        """Return the request as it is cached: with names of images, and the attempt if nothing else tells it apart."""
        request = self.request_of(prompt, lambda picture: picture.name, attempt)
        return {**request, "attempt": attempt} if attempt and self.config.seed is None else request

    def request_of(
        self, prompt: Prompt, url_of: Callable[[Picture], str] = attrgetter("data_url"), attempt: int = 0
    ) -> JsonObject:
        """Return the body that is posted to `/chat/completions`.

        Args:
            url_of: Returns the URL of an image; default: the whole image as PNG in a `data:` URL.
            attempt: Number that is added to the seed.
        """
        config = self.config
        request: JsonObject = {
            "model": config.model,
            "messages": [_message(turn, config.image_detail, url_of) for turn in prompt.turns],
            config.max_tokens_field: config.max_tokens,
        }
        if config.temperature is not None:
            request["temperature"] = config.temperature
        if config.top_p is not None:
            request["top_p"] = config.top_p
        if config.seed is not None:
            request["seed"] = config.seed + attempt
        if prompt.schema is not None:
            schema = {"name": "answer", "strict": True, "schema": dict(prompt.schema)}
            request["response_format"] = {"type": "json_schema", "json_schema": schema}
        return request

    def estimate(self, prompt: Prompt) -> Usage:
        """Estimate the tokens of a question, rather too high than too low."""
        tokens = 0.0
        for part in prompt.parts:
            if isinstance(part, str):
                tokens += 8 + len(part) / CHARACTERS_PER_TOKEN
            else:
                tokens += image_tokens(part.size_px, self.config.image_detail)
        return Usage(int(tokens) + 1, self.config.max_tokens)

    def _ask_model(self, prompt: Prompt, attempt: int) -> JsonObject:
        """Ask within the limits of money and of concurrent questions."""
        request = self.request_of(prompt, attempt=attempt)
        estimate = self.estimate(prompt)
        reserved_usd = self.account.reserve(estimate)
        usage: Usage | None = None
        try:
            with self._slots:
                self._pace.wait(estimate.input_tokens)
                response = self._post(request)
            # A server that counts no tokens is assumed to have used the estimate.
            usage = usage_of(response) or estimate
            return response
        finally:
            self.account.settle(reserved_usd, usage)

    def _read(self, response: JsonObject) -> str:
        return read_answer(response)

    def _post(self, request: JsonObject) -> JsonObject:
        sdk = self._client()
        import openai

        try:
            # Its method for chats would look through the request, which is a megabyte of images, three times.
            text = sdk.post("/chat/completions", content=to_json(request), cast_to=str)
        except openai.APITimeoutError as error:
            raise VlmError("timeout", f"no answer in {self.config.timeout_s:g} s") from error
        except openai.APIConnectionError as error:
            raise VlmError("connection", self._message_of(error.__cause__ or error)) from None
        except openai.RateLimitError as error:
            # OpenAI also answers so if the account is empty, and waiting does not fill it.
            is_broke = error.code == "insufficient_quota"
            raise VlmError("over_budget" if is_broke else "rate_limited", self._message_of(error)) from None
        except (openai.AuthenticationError, openai.PermissionDeniedError) as error:
            raise VlmError("unauthorized", self._message_of(error)) from None
        except openai.APIStatusError as error:
            if 300 <= error.status_code < 400:  # what was asked would go to another server, and perhaps the key
                place = urlsplit(error.response.headers.get("location", "")[:1000])
                host = self._without_secrets(place.netloc.rpartition("@")[2]) or "another address"
                message = f"the server redirects to {host}: give the address of the API itself"
                raise VlmError("bad_request", message) from None
            kind: Literal["server", "bad_request"] = "server" if error.status_code >= 500 else "bad_request"
            raise VlmError(kind, self._message_of(error)) from None
        except openai.OpenAIError as error:
            raise VlmError("malformed", self._message_of(error)) from None
        if len(text) > MAX_ANSWER_BYTES:
            raise VlmError("oversized", f"a response of {len(text)} characters")
        return read_response(self._without_secrets(text))

    def _client(self) -> "openai.OpenAI":
        """Return the SDK's client, made once."""
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
                self._connections = _Connections.shared()
                self._sdk = openai.OpenAI(
                    api_key=key or "none",
                    base_url=base_url,
                    timeout=self.config.timeout_s,
                    max_retries=self.config.max_retries,
                    http_client=self._connections.http,
                )
            return self._sdk

    def _key(self) -> str:
        """Return the key, without the line end of a file that it may have been read from."""
        key = (self.config.api_key or os.environ.get(KEY_VARIABLE) or "").strip()
        if not (key.isascii() and key.isprintable()):
            raise DecisionError(f"{KEY_VARIABLE}: holds characters that no key has, such as a line end")
        return key

    def _message_of(self, error: BaseException) -> str:
        """Return an error's message without secrets."""
        return self._without_secrets(" ".join(str(error)[:MAX_ANSWER_BYTES].split()))[:500]

    def _without_secrets(self, text: str) -> str:
        """Remove the key and the address with its password, which servers quote, from a text."""
        url = self.config.base_url or os.environ.get(URL_VARIABLE) or ""
        text = text.replace(url, REMOVED) if url else text
        return without_secrets(text, (self._key(), unquote(urlsplit(url).password or "")))


class _Connections:
    """The connections of all clients of this process: if each had its own, it would read all certificates again."""

    _lock = threading.Lock()
    _open: "weakref.ref[_Connections] | None" = None

    def __init__(self) -> None:
        import openai

        self.http = openai.DefaultHttpxClient(follow_redirects=False)
        weakref.finalize(self, self.http.close)

    @classmethod
    def shared(cls) -> "_Connections":
        """Return those that are open; they are closed when the last client is gone."""
        with cls._lock:
            found = None if cls._open is None else cls._open()
            if found is None:
                found = cls()
                cls._open = weakref.ref(found)
            return found


def _message(turn: Turn, detail: str, url_of: Callable[[Picture], str]) -> JsonObject:
    if turn.role != "user":
        return {"role": turn.role, "content": "".join(part for part in turn.parts if isinstance(part, str))}
    content: list[JsonObject] = []
    for part in turn.parts:
        if isinstance(part, str):
            content.append({"type": "text", "text": part})
        else:
            content.append({"type": "image_url", "image_url": {"url": url_of(part), "detail": detail}})
    return {"role": "user", "content": content}


def read_response(text: str) -> JsonObject:
    """Read the body of a response; `VlmError` if it is no JSON object."""
    try:
        response = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise VlmError("malformed", f"not JSON: {error}: {text[:80]!r}") from None
    if not isinstance(response, dict):
        raise VlmError("malformed", f"expected an object, got {text[:80]!r}")
    return response


def usage_of(response: JsonObject) -> Usage | None:
    """Return the tokens that the server counted; `None` if it counts none."""
    usage = response.get("usage")
    counts = [usage.get(name) for name in ("prompt_tokens", "completion_tokens")] if isinstance(usage, dict) else []
    numbers = [count for count in counts if isinstance(count, int) and count >= 0]
    return Usage(*numbers) if len(numbers) == 2 else None


def read_answer(response: JsonObject) -> str:
    """Return the answer in a response; `VlmError` if there is no complete one."""
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
        raise VlmError("empty", f"an empty answer (finish_reason {reason!r})")
    return content


def _content(content: Any) -> str:  # noqa: ANN401
    """Return a message's text, which is a string, or parts of which some are text."""
    if content is None:
        return ""
    if isinstance(content, str):
        return content
    if isinstance(content, Sequence) and all(isinstance(part, dict) for part in content):
        return "".join(part["text"] for part in content if isinstance(part.get("text"), str))
    raise VlmError("malformed", f"content: expected text, got {str(content)[:80]!r}")
