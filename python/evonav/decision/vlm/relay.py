"""Ask a model from a process that has no network: the evaluator asks it, and keeps the key, the exchanges and the bill.

Questions and answers are JSON messages on a connection that the process inherits. The asking side has a `RelayedClient`
in place of the client; the evaluator's side is `evonav.evaluation.hosting.model_relay`, which trusts nothing it reads.
"""

import os
import struct
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import accumulate
from typing import Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from evonav.decision.pictures import Picture
from evonav.decision.prompts import Prompt, Role, Turn
from evonav.decision.vlm.errors import VlmError, VlmFailure
from evonav.errors import DecisionError, InvalidArgumentError
from evonav.records import sentence_of

RELAYED = "evonav.decision.backends:vlm"
"""Import path of the decision model that can be asked so."""
LENGTH = struct.Struct("<Q")
"""Format of the size of the message that follows."""
MAX_MESSAGE_BYTES = 64 << 20
"""Largest message: some ten views with their text."""
MAX_EDGE_PX = 4096

_Edge = Annotated[int, Field(ge=1, le=MAX_EDGE_PX)]
_Turn = tuple[Role, list[str | int]]
"""A role, and its texts and numbers of images."""
_Prompt = tuple[Annotated[list[_Turn], Field(min_length=1, max_length=100)], dict[str, Any] | None]
"""The turns and the schema."""


@dataclass(frozen=True, slots=True)
class _Request:
    """The arguments of `CachingClient.ask_first`; the images follow the message, in order: pixels row by row, files."""

    prompts: Annotated[list[_Prompt], Field(min_length=1, max_length=10)]
    attempt: Annotated[int, Field(ge=0, le=1000)]
    otherwise: Annotated[int, Field(ge=0, le=9)]
    images: list[tuple[_Edge, _Edge]]
    """Height and width of each that comes as pixels."""
    files: list[Annotated[int, Field(ge=1)]]
    """Size of each that comes as a JPEG file. Images are counted on."""


@dataclass(frozen=True, slots=True)
class Response:
    """The outcome of a request, in one of the fields."""

    answer: str | None = None
    index: int = 0
    """Index of the prompt that was answered."""
    failure: VlmFailure | None = None
    """The kind of a `VlmError`."""
    error: str | None = None
    """The message of a failure, or of another `DecisionError` if there is no kind."""


Known = dict[tuple[int, int, bytes], Picture]
"""Pictures by height and width, 0 for a file, and content."""

_request: Callable[[], TypeAdapter[_Request]] = cache(lambda: TypeAdapter(_Request))
response_type: Callable[[], TypeAdapter[Response]] = cache(lambda: TypeAdapter(Response))
_lock = threading.Lock()


class RelayedClient:
    """Stands in for a client of a model that another process asks."""

    def __init__(self, descriptor: int, *, never_asks: bool) -> None:
        """Use an inherited connection; `never_asks` if only cached answers are returned."""
        self._descriptor = descriptor
        self.never_asks = never_asks
        os.set_inheritable(descriptor, False)

    def check(self) -> None:
        """Check nothing: the evaluator has checked the model before the run."""

    def costs(self) -> dict[str, float]:
        """Return nothing: the evaluator counts the costs."""
        return {}

    def ask(self, prompt: Prompt, attempt: int = 0) -> str:
        """Return the model's answer, or raise as `ask_first` does."""
        return self.ask_first((prompt,), attempt)[1]

    def ask_first(self, prompts: Sequence[Prompt], attempt: int = 0, *, otherwise: int = 0) -> tuple[int, str]:
        """Return the answer to the first prompt whose outcome is cached, else to `prompts[otherwise]`, with its index.

        Raises:
            VlmError: There is no valid answer; `kind` says why.
            DecisionError: The model cannot be asked.
        """
        response = self._response(request_bytes(prompts, attempt, otherwise))
        if response.failure is not None:
            raise VlmError(response.failure, response.error or "")
        if response.answer is None:
            raise DecisionError(response.error or "the evaluator gave no answer")
        return response.index, response.answer

    def _response(self, message: bytes) -> Response:
        with _lock:  # of all threads of the agent: an answer belongs to the question before it
            try:
                write_message(self._descriptor, message)
                text = read_message(self._descriptor)
            except OSError as error:
                raise DecisionError(f"the connection to the model is lost: {error}") from error
        try:
            return response_type().validate_json(text)
        except ValidationError as error:
            raise DecisionError("the connection to the model is lost: no answer to the question") from error


def request_bytes(prompts: Sequence[Prompt], attempt: int, otherwise: int) -> bytes:
    """Return the message that asks for `CachingClient.ask_first`. Prompts that share an image send it once."""
    shown = {id(picture): picture for prompt in prompts for picture in prompt.pictures}
    files = {key: picture.source for key, picture in shown.items() if isinstance(picture.source, bytes)}
    pixels = {key: np.ascontiguousarray(shown[key].source, np.uint8) for key in shown if key not in files}
    places = {key: index for index, key in enumerate((*pixels, *files))}
    forms: list[_Prompt] = []
    for prompt in prompts:
        turns: list[_Turn] = [
            (turn.role, [part if isinstance(part, str) else places[id(part)] for part in turn.parts])
            for turn in prompt.turns
        ]
        forms.append((turns, None if prompt.schema is None else dict(prompt.schema)))
    shapes = [image.shape[:2] for image in pixels.values()]
    request = _Request(forms, attempt, otherwise, shapes, [len(file) for file in files.values()])
    return b"".join((_request().dump_json(request), b"\n", *(image.data for image in pixels.values()), *files.values()))


def read_request(message: bytes, known: Known | None = None) -> tuple[list[Prompt], int, int]:
    """Return the prompts, the attempt and `otherwise` of a message.

    Args:
        message: Bytes that `request_bytes` returned.
        known: The pictures of the last question, most of which come again; they become those of this one.

    Raises:
        InvalidArgumentError: It is no request; the error names the field.
    """
    known = {} if known is None else known
    text, _, rest = message.partition(b"\n")  # JSON has no line ends
    try:
        request = _request().validate_json(text, strict=True)
    except ValidationError as error:
        raise InvalidArgumentError(sentence_of(error)) from error
    if request.otherwise >= len(request.prompts):
        raise InvalidArgumentError(f"otherwise = {request.otherwise}: of {len(request.prompts)} prompts")
    sizes = [*((height, width, 3 * height * width) for height, width in request.images)]
    sizes += [(0, 0, size) for size in request.files]
    ends = list(accumulate((size for _, _, size in sizes), initial=0))
    if ends[-1] != len(rest):
        raise InvalidArgumentError(f"images: expected {ends[-1]} bytes, got {len(rest)}")
    pictures = [
        _picture((height, width, rest[start : start + size]), known)
        for (height, width, size), start in zip(sizes, ends, strict=False)
    ]
    if pictures:
        known.clear()
        known.update(pictures)
    shown = [picture for _, picture in pictures]
    return [_prompt_of(prompt, shown) for prompt in request.prompts], request.attempt, request.otherwise


def _picture(key: tuple[int, int, bytes], known: Known) -> tuple[tuple[int, int, bytes], Picture]:
    if key in known:
        return key, known[key]
    height, width, content = key
    if height:
        return key, Picture(np.frombuffer(content, np.uint8).reshape(height, width, 3))
    picture = Picture(content)
    if max(picture.size_px) > MAX_EDGE_PX:
        raise InvalidArgumentError(f"files: an image of {picture.size_px} px: must be at most {MAX_EDGE_PX}")
    return key, picture


def _prompt_of(prompt: _Prompt, pictures: Sequence[Picture]) -> Prompt:
    turns, schema = prompt
    for part in (part for _, parts in turns for part in parts):
        if isinstance(part, int) and not 0 <= part < len(pictures):
            raise InvalidArgumentError(f"parts: image {part} of {len(pictures)}")
    return Prompt(
        tuple(
            Turn(role, tuple(part if isinstance(part, str) else pictures[part] for part in parts))
            for role, parts in turns
        ),
        schema,
    )


def read_message(descriptor: int) -> bytes:
    """Read a message; `OSError` if the connection has ended, `InvalidArgumentError` if the message is too long."""
    size = LENGTH.unpack(_exactly(descriptor, LENGTH.size))[0]
    if size > MAX_MESSAGE_BYTES:
        raise InvalidArgumentError(f"a message of {size} bytes: must be at most {MAX_MESSAGE_BYTES}")
    return _exactly(descriptor, size)


def write_message(descriptor: int, text: bytes) -> None:
    """Write a message; `OSError` if the connection has ended, `InvalidArgumentError` if the message is too long."""
    if len(text) > MAX_MESSAGE_BYTES:
        raise InvalidArgumentError(f"a question of {len(text)} bytes: must be at most {MAX_MESSAGE_BYTES}")
    for part in (LENGTH.pack(len(text)), text):
        data = memoryview(part)
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
