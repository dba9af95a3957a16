"""Ask a model from a process that has no network: the evaluator asks it, and keeps the key, the exchanges and the bill.

Questions and answers are JSON messages on a connection that the process inherits. The asking side has a `RelayedClient`
in place of the client; the evaluator's side is `evonav.evaluation.hosting.model_relay`, which trusts nothing it reads.
"""

import base64
import os
import struct
import threading
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from evonav.decision.prompts import Picture, Prompt, Text, Turn
from evonav.decision.vlm.answer import Answer
from evonav.decision.vlm.errors import VlmError, VlmFailure
from evonav.errors import DecisionError, InvalidArgumentError

LENGTH = struct.Struct("<Q")
"""Format of the size of the message that follows."""
MAX_MESSAGE_BYTES = 64 << 20
"""Largest message: some ten views with their text."""
MAX_EDGE_PX = 4096


@dataclass(frozen=True, slots=True)
class _Image:
    height: Annotated[int, Field(ge=1, le=MAX_EDGE_PX)]
    width: Annotated[int, Field(ge=1, le=MAX_EDGE_PX)]
    rgb: str
    """The pixels, row by row, in base64."""


@dataclass(frozen=True, slots=True)
class _Turn:
    role: Literal["system", "user", "assistant"]
    parts: list[str | _Image]


@dataclass(frozen=True, slots=True)
class Request:
    """A question to the model, or whether its answer is cached."""

    operation: Literal["ask", "is_cached"]
    turns: Annotated[list[_Turn], Field(min_length=1, max_length=100)]
    schema: dict[str, Any] | None
    attempt: Annotated[int, Field(ge=0, le=1000)]

    @property
    def prompt(self) -> Prompt:
        """The question.

        Raises:
            InvalidArgumentError: An image has other bytes than its size says.
        """
        turns = (Turn(turn.role, tuple(_part_of(part) for part in turn.parts)) for turn in self.turns)
        return Prompt(tuple(turns), self.schema)


@dataclass(frozen=True, slots=True)
class Response:
    """The outcome of a request, in one of the fields."""

    answer: Answer | None = None
    is_cached: bool | None = None
    failure: VlmFailure | None = None
    """The kind of a `VlmError`."""
    error: str | None = None
    """The message of a failure, or of another `DecisionError` if there is no kind."""


REQUEST = TypeAdapter(Request)
RESPONSE = TypeAdapter(Response)
_lock = threading.Lock()


class RelayedClient:
    """Stands in for a client of a model that another process asks."""

    def __init__(self, descriptor: int, *, never_asks: bool) -> None:
        """Use an inherited connection.

        Args:
            descriptor: The connection.
            never_asks: True if only cached answers are returned.
        """
        self._descriptor = descriptor
        self.never_asks = never_asks
        os.set_inheritable(descriptor, False)

    def check(self) -> None:
        """Check nothing: the evaluator has checked the model before the run."""

    def ask(self, prompt: Prompt, attempt: int = 0) -> Answer:
        """Return the model's answer.

        Raises:
            VlmError: There is no valid answer; `kind` says why.
            DecisionError: The model cannot be asked.
        """
        response = self._response("ask", prompt, attempt)
        if response.failure is not None:
            raise VlmError(response.failure, response.error or "")
        if response.answer is None:
            raise DecisionError(response.error or "the evaluator gave no answer")
        return response.answer

    def is_cached(self, prompt: Prompt, attempt: int = 0) -> bool:
        """Return whether the outcome of a question is cached, so that nothing is asked."""
        response = self._response("is_cached", prompt, attempt)
        if response.is_cached is None:
            raise DecisionError(response.error or "the evaluator gave no answer")
        return response.is_cached

    def _response(self, operation: Literal["ask", "is_cached"], prompt: Prompt, attempt: int) -> Response:
        turns = [_Turn(turn.role, [_part(part) for part in turn.parts]) for turn in prompt.turns]
        schema = None if prompt.schema is None else dict(prompt.schema)
        with _lock:  # of all threads of the agent: an answer belongs to the question before it
            try:
                write_message(self._descriptor, REQUEST.dump_json(Request(operation, turns, schema, attempt)))
                text = read_message(self._descriptor)
            except OSError as error:
                raise DecisionError(f"the connection to the model is lost: {error}") from error
        try:
            return RESPONSE.validate_json(text)
        except ValidationError as error:
            raise DecisionError("the connection to the model is lost: no answer to the question") from error


def read_message(descriptor: int) -> bytes:
    """Read a message.

    Raises:
        OSError: The connection has ended.
        InvalidArgumentError: The message is too long.
    """
    size = LENGTH.unpack(_exactly(descriptor, LENGTH.size))[0]
    if size > MAX_MESSAGE_BYTES:
        raise InvalidArgumentError(f"a message of {size} bytes: must be at most {MAX_MESSAGE_BYTES}")
    return _exactly(descriptor, size)


def write_message(descriptor: int, text: bytes) -> None:
    """Write a message.

    Raises:
        OSError: The connection has ended.
        InvalidArgumentError: The message is too long.
    """
    if len(text) > MAX_MESSAGE_BYTES:
        raise InvalidArgumentError(f"a question of {len(text)} bytes: must be at most {MAX_MESSAGE_BYTES}")
    data = memoryview(LENGTH.pack(len(text)) + text)
    while data:
        data = data[os.write(descriptor, data) :]


def _exactly(descriptor: int, size: int) -> bytes:
    data = bytearray()
    while len(data) < size:
        part = os.read(descriptor, min(size - len(data), 1 << 20))
        if not part:
            raise ConnectionResetError("closed")
        data += part
    return bytes(data)


def _part(part: Text | Picture) -> str | _Image:
    if isinstance(part, Text):
        return part.text
    height, width = part.pixels.shape[:2]
    return _Image(height, width, base64.b64encode(np.ascontiguousarray(part.pixels, np.uint8).tobytes()).decode())


def _part_of(part: str | _Image) -> Text | Picture:
    return Text(part) if isinstance(part, str) else Picture(_pixels(part))


def _pixels(image: _Image) -> NDArray[np.uint8]:
    try:
        data = base64.b64decode(image.rgb, validate=True)
        return np.frombuffer(data, np.uint8).reshape(image.height, image.width, 3)
    except ValueError as error:
        raise InvalidArgumentError(f"an image of {image.width} x {image.height}: other bytes: {error}") from error
