"""Read a server's response: a complete answer, or an error."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from evonav.decision.vlm.errors import VlmError
from evonav.decision.vlm.ledger import Usage
from evonav.decision.vlm.response_cache import JsonObject


@dataclass(frozen=True, slots=True)
class ModelAnswer:
    """A complete answer."""

    text: str
    model: str
    """The model's name and version, from the server."""
    usage: Usage
    key: str
    """Key of the exchange in the cache."""
    is_replayed: bool


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


def read_answer(response: JsonObject, key: str, *, is_replayed: bool) -> ModelAnswer:
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
    model = response.get("model")
    return ModelAnswer(
        content, model if isinstance(model, str) else "", usage_of(response) or Usage(), key, is_replayed
    )


def _content(content: Any) -> str:  # noqa: ANN401
    """Return a message's text, which is a string, or parts of which some are text."""
    if content is None:
        return ""
    if isinstance(content, str):
        return content
    if isinstance(content, Sequence) and all(isinstance(part, dict) for part in content):
        return "".join(part["text"] for part in content if isinstance(part.get("text"), str))
    raise VlmError("malformed", f"content: expected text, got {str(content)[:80]!r}")
