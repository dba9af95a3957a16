"""Use a vision-language model as a decision model: put questions as prompts, and parse answers by their grammar.

    model = VlmDecision(VlmClient(VlmConfig("gpt-4o"), store=ResponseCache("exchanges.sqlite"), keeps_failures=True))

If the server follows a JSON Schema, the grammar's lines are in a field `answer` and the reason is in another. The
content of `answer` is parsed as any other answer is.
"""

import json
from collections.abc import Mapping
from typing import Any, TypeVar

from evonav.decision.goal_input import check_goal_input
from evonav.decision.options import AskedOptions
from evonav.decision.prompts import Prompt, Turn, with_notice
from evonav.decision.question import AnswerError, DecisionModel, Fault, Question, Reply
from evonav.decision.vlm.caching_client import CachingClient
from evonav.decision.vlm.errors import VlmError, VlmFailure
from evonav.decision.vlm.relay import RelayedClient
from evonav.errors import DecisionError, StoreError

A = TypeVar("A")

FAULTS: Mapping[VlmFailure, Fault] = {
    "refusal": "refusal",
    "truncated": "invalid",
    "empty": "invalid",
    "malformed": "invalid",
    "oversized": "invalid",
    "unusable": "invalid",
    "rate_limited": "lost",
    "server": "lost",
    "timeout": "lost",
    "connection": "lost",
}
"""The fault of each failure; the other failures would meet every question, and end the stage."""

_MAX_VALUES, _MAX_CHARACTERS = 1000, 15_000
"""Longest `enum`, and the most characters in its values: OpenAI's limits."""

_AS_JSON = "Give the answer as JSON: what belongs on the first line as `answer`, the reason as `reason`."
_LINES_AS_JSON = "Give the answer as JSON: its lines as the items of `answer`, in order, the reason as `reason`."


_USUAL = AskedOptions()


class VlmDecision(DecisionModel):
    """Answers every question by asking a model."""

    def __init__(self, client: CachingClient | RelayedClient, options: AskedOptions = _USUAL) -> None:
        """Create a decision model; `InvalidArgumentError` if one without images is to go by a picture."""
        check_goal_input(options.goal_input, sees_images=options.images)
        self.client = client
        self.goal_input = options.goal_input
        self.needs = frozenset({"images"}) if options.images else frozenset()
        self.options = options
        self._is_refused = False
        """True after the server has refused `response_format`."""

    def check(self) -> None:
        """Check that the client can ask; see `DecisionModel.check`."""
        self.client.check()

    def costs(self) -> dict[str, float]:
        """Return what the client has spent."""
        return self.client.costs()

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """Return the model's answer, parsed by the question's grammar.

        Raises:
            AnswerError: There is no valid answer this time.
            DecisionError: There will be none: no key, no money left, not recorded, a request that the server refuses,
                exchanges that cannot be read or written.
        """
        try:
            answer, is_json = self._ask(question, attempt)
        except StoreError as error:
            raise DecisionError(str(error)) from error
        except VlmError as error:
            fault = FAULTS.get(error.kind)
            if fault is None:
                raise
            raise AnswerError(fault, str(error)) from error
        if is_json and (self.options.structured == "on" or _fields(answer) is not None):
            return read_json(question, answer)
        # A server that ignores a schema answers in lines, which are as good.
        return Reply(question.parse(answer), answer)

    def _ask(self, question: Question[A], attempt: int) -> tuple[str, bool]:
        """Return the answer, and whether JSON was requested."""
        plain = with_notice(question.prompt(), tells_of_change=self.options.tells_of_change)
        if self.options.structured == "off":
            return self.client.ask(plain, attempt), False
        as_json = with_schema(plain, question.answer_schema())
        if self.options.structured == "on":
            return self.client.ask(as_json, attempt), True
        # In a replay, an exchange that is not cached as JSON is of a server without schemas.
        asks_plain = self._is_refused or self.client.never_asks
        try:
            index, answer = self.client.ask_first((as_json, plain), attempt, otherwise=int(asks_plain))
        except VlmError as error:
            if asks_plain or not _is_about_format(error):
                raise
        else:
            return answer, index == 0
        self._is_refused = True
        return self.client.ask(plain, attempt), False


def with_schema(prompt: Prompt, answer_schema: Mapping[str, Any]) -> Prompt:
    """Return the prompt for an answer in JSON: `{"answer": ..., "reason": ...}`, both required, nothing else."""
    schema = {
        "type": "object",
        "properties": {"answer": _supported(answer_schema), "reason": {"type": "string"}},
        "required": ["answer", "reason"],
        "additionalProperties": False,
    }
    instruction = _LINES_AS_JSON if answer_schema.get("type") == "array" else _AS_JSON
    *turns, last = prompt.turns
    return Prompt((*turns, Turn(last.role, (*last.parts, instruction))), schema)


def read_json(question: Question[A], text: str) -> Reply[A]:
    """Read an answer by the schema of `with_schema`; its lines are parsed by the question's grammar.

    Raises:
        AnswerError: The answer is invalid.
    """
    fields = _fields(text)
    if fields is None:
        raise AnswerError("invalid", f"no JSON object with `answer`: {text[:80]!r}", text)
    answer = fields["answer"]
    lines = answer if isinstance(answer, list) else [answer]
    if not all(isinstance(line, str | int | float) and not isinstance(line, bool) for line in lines):
        raise AnswerError("invalid", f"no lines in `answer`: {text[:80]!r}", text)
    plain = "\n".join(str(line) for line in lines)
    reason = " ".join(str(fields.get("reason", "")).split())
    try:
        return Reply(question.parse(plain), f"{plain}\n{reason}")
    except AnswerError as error:
        error.text = text
        raise


def _fields(text: str) -> dict[str, Any] | None:
    """Return the JSON object with an answer in a text; `None` if there is none."""
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) and "answer" in content else None


def _supported(schema: Mapping[str, Any]) -> dict[str, Any]:
    """Return a schema without lists of values that servers refuse: empty ones, and very long ones."""
    supported = {name: _supported(value) if name == "items" else value for name, value in schema.items()}
    values = supported.get("enum")
    if values is not None and not (values and len(values) <= _MAX_VALUES and len("".join(values)) <= _MAX_CHARACTERS):
        del supported["enum"]
    return supported


def _is_about_format(error: VlmError) -> bool:
    """Return whether a server has refused the schema, which is then not requested again."""
    message = str(error).lower()
    names = ("response_format", "response format", "json_schema", "json schema", "structured")
    return error.kind == "bad_request" and any(name in message for name in names)
