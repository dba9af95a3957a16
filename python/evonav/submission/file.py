"""Read a packed run. Nothing in it is trusted, imported or extracted to disk."""

import hashlib
import json
import math
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from evonav.errors import InvalidArgumentError
from evonav.submission.archive import Archive, SubmissionError
from evonav.tasks.manifest import TaskId
from evonav.tasks.records import Sha256

SUFFIX = ".evonav.zip"
HEADER_NAME = "submission.json"
MAX_HEADER_BYTES = 8 << 20
MAX_LINE_BYTES = 50_000_000
"""Longest record: what an agent may say in a stage (`evonav.agents.hosting.wire`), and 2 MB."""
MAX_VALUES = 2_000_000
"""Largest number of JSON values in the header and in a record; a parsed value takes up to 100 times its text."""
EPOCH = (1980, 1, 1)
"""Day of the members' time stamps if it is not known when the run began."""


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("must hold printable characters only")
    return text


_Name = Annotated[str, Field(min_length=1, max_length=1000), AfterValidator(_printable)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class PackedTask(_Part):
    """A task of the run."""

    task_id: TaskId
    num_stages: int = Field(ge=1, le=64)
    digest: Sha256
    """SHA-256 of `task.json`, which holds the checksums of all other files of the task."""


class PackedRecords(_Part):
    """The records of one agent: a member of the archive, a line a stage."""

    agent: _Name
    member: str
    num_bytes: int
    """Size before compression."""
    sha256: Sha256
    """Checksum of the uncompressed bytes."""


class About(_Part):
    """Statements of the submitters, which cannot be checked."""

    title: str = ""
    authors: str = ""
    contact: str = ""
    url: str = ""
    description: str = ""


class Submission(_Part):
    """The header of the archive."""

    format_version: Literal[1] = 1
    evonav: _Name
    """Version of evonav that packed the file."""
    about: About
    config: dict[str, Any]
    """The run's protocol, seed, simulator, perception, decision model, and where its agents ran (`isolation`).

    Only protocol and simulator are checked.
    """
    tasks: tuple[PackedTask, ...]
    records: tuple[PackedRecords, ...]
    summary: dict[str, Any]
    """The claimed scores: `summary.json` of these agents."""


class SubmissionFile:
    """An archive that claims to be a submission."""

    def __init__(self, path: Path) -> None:
        """Open the archive and read its header.

        Raises:
            SubmissionError: It is not a zip, its members are not those of a submission, or the header is malformed.
        """
        self.path = path
        self._archive = Archive(path)
        try:
            if HEADER_NAME not in self._archive.names:
                raise SubmissionError(f"{path}: not a submission (no {HEADER_NAME})")
            self.header = self._read_header(self._archive.read(HEADER_NAME, MAX_HEADER_BYTES))
            self._check_members()
        except BaseException:
            self.close()
            raise

    @property
    def date(self) -> str | None:
        """Day on which the run began, such as `2026-11-23`, by the archive's time stamps; `None` if they tell none."""
        day = self._archive.date_of(HEADER_NAME)
        try:
            return None if day == EPOCH else date(*day).isoformat()
        except ValueError:
            return None

    def __enter__(self) -> "SubmissionFile":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._archive.__exit__(None, None, None)

    def texts(self, part: PackedRecords) -> Iterator[str]:
        """Yield the lines of a member, one record each.

        Raises:
            SubmissionError: The member is not what the header says.
        """
        where = f"{self.path}: {part.member}"
        digest, size = hashlib.sha256(), 0
        for number, line in enumerate(self._archive.lines(part.member, MAX_LINE_BYTES), start=1):
            size += len(line) + 1
            digest.update(line)
            digest.update(b"\n")
            _check_values(f"{where}, line {number}", line)
            try:
                yield line.decode()
            except UnicodeDecodeError as error:
                raise SubmissionError(f"{where}, line {number}: not UTF-8") from error
        if size != part.num_bytes or digest.hexdigest() != part.sha256:
            raise SubmissionError(f"{where}: {size} B of another checksum than the header's")

    def _read_header(self, data: bytes) -> Submission:
        where = f"{self.path}: {HEADER_NAME}"
        _check_values(where, data)
        try:
            header = Submission.model_validate_json(data)
            json.loads(data, object_pairs_hook=_without_repetition, parse_constant=_finite, parse_float=_finite)
        except ValidationError as error:
            raise SubmissionError(f"{where}: {first_problem(error)}") from error
        except InvalidArgumentError as error:
            raise SubmissionError(f"{where}: {error}") from error
        return header

    def _check_members(self) -> None:
        for number, part in enumerate(self.header.records, start=1):
            if part.member != member_name(number):
                where = f"{self.path}: {HEADER_NAME}: records.{number - 1}.member"
                raise SubmissionError(f"{where} = {part.member[:100]!r}: expected {member_name(number)}")
        expected = {HEADER_NAME, *(part.member for part in self.header.records)}
        odd = sorted(set(self._archive.names) ^ expected)
        if odd:
            raise SubmissionError(f"{self.path}: members missing or unknown: {', '.join(map(repr, odd[:5]))}")


def member_name(number: int) -> str:
    """Return the name of the member with the records of an agent, from 1."""
    return f"records/{number}.jsonl"


def first_problem(error: ValidationError) -> str:
    """Return the first wrong field and what is wrong with it."""
    problem = error.errors(include_url=False, include_input=False)[0]
    place = ".".join(str(step)[:100] for step in problem["loc"][:10])
    message = problem["msg"][:300]
    return f"{place}: {message}" if place else message


def _check_values(where: str, data: bytes) -> None:
    number = data.count(b",") + data.count(b"[") + data.count(b"{")
    if number > MAX_VALUES:
        raise SubmissionError(f"{where}: more than {MAX_VALUES} values")


def _without_repetition(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise InvalidArgumentError(f"{twice[:100]!r} is there twice")
    return values


def _finite(text: str) -> float:
    if not math.isfinite(float(text)):
        raise InvalidArgumentError(f"{text[:100]}: numbers must be finite")
    return float(text)
