"""A vision-language model as a decision model: questions are put as prompts, and answers read by their grammar.

    model = VlmDecision(VlmClient(VlmConfig("gpt-4o"), store=ResponseCache("exchanges.sqlite"), keeps_failures=True))

Where the server holds answers to a JSON Schema, the grammar's lines come in a field `answer` and the reason in another;
what is in `answer` is read as any other answer is.
"""

import json
from collections.abc import Mapping
from typing import Any, Literal, Protocol, TypeVar

from evonav.decision.prompts import Prompt, Text, Turn
from evonav.decision.question import AnswerError, Fault, Question, Reply
from evonav.decision.vlm.answer import Answer
from evonav.decision.vlm.errors import VlmError, VlmFailure
from evonav.errors import DecisionError, InvalidArgumentError, StoreError

A = TypeVar("A")

Structured = Literal["auto", "on", "off"]
"""Whether answers are held to a JSON Schema: `auto` does until the server says that it cannot."""
STRUCTURED: tuple[Structured, ...] = ("auto", "on", "off")

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
"""What counts as which fault of an answer; the other failures would meet every question, and end the stage."""

_MAX_VALUES, _MAX_CHARACTERS = 1000, 15_000
"""Of an `enum`, and of all its values together: OpenAI's limits."""

_AS_JSON = "Give the answer as JSON: what belongs on the first line as `answer`, the reason as `reason`."
_LINES_AS_JSON = "Give the answer as JSON: its lines as the items of `answer`, in order, the reason as `reason`."


class Asks(Protocol):
    """What has the answer to a prompt: `VlmClient`, or a model of your own behind `CustomClient`."""

    @property
    def never_asks(self) -> bool:
        """Whether there are no answers but those that are kept."""
        ...

    def ask(self, prompt: Prompt, attempt: int = 0) -> Answer:
        """The answer.

        Raises:
            VlmError: There is none.
        """
        ...

    def is_cached(self, prompt: Prompt, attempt: int = 0) -> bool:
        """Whether what came of it is kept, so that nothing is asked."""
        ...

    def check(self) -> None:
        """Finds out before the first question what would make all of them fail; asks nothing.

        Raises:
            DecisionError: It says what to do.
        """
        ...


class VlmDecision:
    """Answers every question by asking a model."""

    def __init__(self, client: Asks, *, structured: Structured = "auto", needs_images: bool = True) -> None:
        """A model behind a client.

        Args:
            client: Asks and keeps.
            structured: Whether to ask for JSON by schema.
            needs_images: Whether agents shall put images into questions.

        Raises:
            InvalidArgumentError: `structured` is none of the three.
        """
        if structured not in STRUCTURED:
            raise InvalidArgumentError(f"structured: expected one of {', '.join(STRUCTURED)}, got {structured!r}")
        self.client = client
        self.structured: Structured = structured
        self.needs_images = needs_images
        self._is_refused = False
        """The server has said that it knows no `response_format`."""

    def check(self) -> None:
        """Finds out before the first question what would make all of them fail; asks nothing.

        Raises:
            DecisionError: It says what to do.
        """
        self.client.check()

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """The model's answer, read by the question's grammar.

        Raises:
            AnswerError: There is no usable answer this time.
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
        if is_json and (self.structured == "on" or _fields(answer.text) is not None):
            return read_json(question, answer.text)
        # Servers that overlook a schema answer in lines, which is as good.
        return Reply(question.parse(answer.text), answer.text)

    def _ask(self, question: Question[A], attempt: int) -> tuple[Answer, bool]:
        """The answer, and whether it was asked for as JSON."""
        plain = question.prompt()
        if self.structured == "off":
            return self.client.ask(plain, attempt), False
        as_json = with_schema(plain, question.answer_schema())
        if self.structured == "on" or self.client.is_cached(as_json, attempt):
            return self.client.ask(as_json, attempt), True
        # In a replay, what is not kept as JSON was asked of a server that knew none.
        if self._is_refused or self.client.never_asks or self.client.is_cached(plain, attempt):
            return self.client.ask(plain, attempt), False
        try:
            return self.client.ask(as_json, attempt), True
        except VlmError as error:
            if not _is_about_format(error):
                raise
        self._is_refused = True
        return self.client.ask(plain, attempt), False


def with_schema(prompt: Prompt, answer_schema: Mapping[str, Any]) -> Prompt:
    """The same prompt for an answer in JSON: `{"answer": ..., "reason": ...}`, both required, nothing else."""
    schema = {
        "type": "object",
        "properties": {"answer": _supported(answer_schema), "reason": {"type": "string"}},
        "required": ["answer", "reason"],
        "additionalProperties": False,
    }
    words = _LINES_AS_JSON if answer_schema.get("type") == "array" else _AS_JSON
    *turns, last = prompt.turns
    return Prompt((*turns, Turn(last.role, (*last.parts, Text(words)))), schema)


def read_json(question: Question[A], text: str) -> Reply[A]:
    """Reads an answer by the schema of `with_schema`: its lines go through the question's grammar.

    Raises:
        AnswerError: `invalid`.
    """
    fields = _fields(text)
    if fields is None:
        raise AnswerError("invalid", f"no JSON object with `answer`: {text[:80]!r}", text)
    answer = fields["answer"]
    lines = answer if isinstance(answer, list) else [answer]
    if not all(isinstance(line, str | int | float) and not isinstance(line, bool) for line in lines):
        raise AnswerError("invalid", f"no lines in `answer`: {text[:80]!r}", text)
    words = "\n".join(str(line) for line in lines)
    reason = " ".join(str(fields.get("reason", "")).split())
    try:
        return Reply(question.parse(words), f"{words}\n{reason}")
    except AnswerError as error:
        error.text = text
        raise


def _fields(text: str) -> dict[str, Any] | None:
    """A JSON object with an answer in it; `None` if the text is none."""
    try:
        content = json.loads(text)
    except ValueError:
        return None
    return content if isinstance(content, dict) and "answer" in content else None


def _supported(schema: Mapping[str, Any]) -> dict[str, Any]:
    """A schema without lists of values that servers refuse: empty ones, and very long ones."""
    kept = {name: _supported(value) if name == "items" else value for name, value in schema.items()}
    values = kept.get("enum")
    if values is not None and not (values and len(values) <= _MAX_VALUES and len("".join(values)) <= _MAX_CHARACTERS):
        del kept["enum"]
    return kept


def _is_about_format(error: VlmError) -> bool:
    """Whether a server's refusal is of the schema, which is then not asked for again."""
    words = str(error).lower()
    names = ("response_format", "response format", "json_schema", "json schema", "structured")
    return error.kind == "bad_request" and any(name in words for name in names)
