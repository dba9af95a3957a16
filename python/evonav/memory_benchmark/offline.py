"""Score the answers of a system that ran elsewhere and wrote them to a file, one line a frame."""

from collections.abc import Generator
from pathlib import Path
from typing import Annotated

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError, with_config
from pydantic.dataclasses import dataclass

from evonav.errors import StoreError
from evonav.memory_benchmark.answers import CheckedEntries, Hosting, MemoryFailedError, read_entries
from evonav.memory_benchmark.local import Cost, HostedMemory
from evonav.memory_benchmark.protocol import MemoryEntry, MemoryFrame
from evonav.memory_benchmark.records import StreamResult
from evonav.memory_benchmark.run import measure
from evonav.memory_benchmark.truth import Stream
from evonav.records import sentence_of

_STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)
with_config(_STRICT)(MemoryEntry)


@dataclass(frozen=True, config=_STRICT)
class FrameAnswer:
    """The answer of a system after one frame: a line of its file, as JSON."""

    frame: Annotated[int, Field(ge=0)]
    """Index of the frame."""
    entries: list[MemoryEntry]
    """All that the system believes in after the frame."""
    seconds: Annotated[float, Field(ge=0.0)] | None = None
    """Wall time that it took for the frame."""
    num_bytes: Annotated[int, Field(ge=0)] | None = None
    """Size of its memory."""


_ANSWER = TypeAdapter(FrameAnswer)


def score(stream: Stream, entries_file: Path) -> StreamResult:
    """Judge the answers in a file.

    Args:
        stream: The stream that the system was given.
        entries_file: A line of JSON for each frame, in order: `{"frame": 0, "seconds": 0.012, "entries": [{"entry_id":
            1, "label": "Mug", "centre_m": [1.0, 0.9, 2.0], "size_m": [0.1, 0.1, 0.1]}]}`. The fields of an entry are
            those of `MemoryEntry`. After a frame without a line, the entries of the line before count.

    Raises:
        StoreError: The file cannot be read, or a line is wrong; the message has file, line, field and value.
    """
    return measure(_Answers(entries_file), stream)


class _Answers(HostedMemory):
    """A memory whose answers are read from a file."""

    hosting: Hosting = "offline"

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lines = _read_lines(path)
        self._next = next(self._lines, None)
        self._line = 1
        self._entries = read_entries([])
        self._num_bytes: int | None = None
        self._last = -1
        if self._next is None:
            raise StoreError(f"{path}: has no line")

    def call(self, name: str, argument: object) -> Cost | None:
        """Read the line of a frame, if there is one; the other methods do nothing."""
        return self._read(argument) if isinstance(argument, MemoryFrame) else None

    def _read(self, frame: MemoryFrame) -> Cost | None:
        self._last = frame.index
        if self._next is None or self._next[1].frame > frame.index:
            return None
        self._line, answer = self._next
        if answer.frame < frame.index:
            raise StoreError(f"{self._path}, line {self._line}: frame = {answer.frame}: must be later than before")
        try:
            self._entries = read_entries(answer.entries)
        except MemoryFailedError as error:
            message = str(error).replace("entries()", "entries")
            raise StoreError(f"{self._path}, line {self._line}: {message}") from None
        self._num_bytes = answer.num_bytes
        self._next = next(self._lines, None)
        return None if answer.seconds is None else Cost(None, answer.seconds)

    def entries(self) -> CheckedEntries:
        """Return the entries of the last line."""
        return self._entries

    def num_bytes(self, num_entries: int) -> int | None:
        """Return the size of the last line."""
        if self._next is not None:
            line, answer = self._next
            raise StoreError(f"{self._path}, line {line}: frame = {answer.frame}: the last frame is {self._last}")
        return self._num_bytes

    def close(self) -> None:
        """Close the file."""
        self._lines.close()


def _read_lines(path: Path) -> Generator[tuple[int, FrameAnswer]]:
    """Yield the lines of a file with their numbers; empty ones are left out."""
    try:
        with path.open("rb") as file:
            for number, line in enumerate(file, start=1):
                if line.strip():
                    try:
                        yield number, _ANSWER.validate_json(line, strict=True)
                    except ValidationError as error:
                        raise StoreError(f"{path}, line {number}: {sentence_of(error)}") from None
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error
