"""Write and read a packed run: gzip of JSON lines, first the header, then the records of each agent.

Nothing in a file is trusted, imported or extracted to disk. Every line must be as evonav writes it, so that a file
means the same to everybody.
"""

import gzip
import stat
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, Field, ValidationError

from evonav.errors import StoreError
from evonav.evaluation.records.schema import StageRecord
from evonav.parallel.folders import replacing
from evonav.records import Record, Version, sentence_of
from evonav.tasks.manifest import TaskId
from evonav.tasks.records import Sha256

SUFFIX = ".evonav.jsonl.gz"
MAX_TOTAL_BYTES = 2 << 30
"""Largest file, compressed and not."""
MAX_HEADER_BYTES = 8 << 20
MAX_LINE_BYTES = 50_000_000
"""Longest record: what an agent may say in a stage (`evonav.agents.hosting.wire`), and 2 MB."""
MAX_VALUES = 2_000_000
"""Largest number of JSON values in the header and in a record; a parsed value takes up to 100 times its text."""


class SubmissionError(StoreError):
    """A file that is not a submission, or not a whole one."""


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("must hold printable characters only")
    return text


_Name = Annotated[str, Field(min_length=1, max_length=1000), AfterValidator(_printable)]


class PackedTask(Record):
    """A task of the run."""

    task_id: TaskId
    num_stages: int = Field(ge=1, le=64)
    digest: Sha256
    """SHA-256 of `task.json`, which holds the checksums of all other files of the task."""


class About(Record):
    """Statements of the submitters, which cannot be checked."""

    title: str = ""
    authors: str = ""
    contact: str = ""
    url: str = ""
    description: str = ""


class Submission(Record):
    """The header of a packed run."""

    format_version: Version = 1
    evonav: _Name
    """Version of evonav that packed the file."""
    about: About
    config: dict[str, Any]
    """The run's protocol, seed, simulator, perception, decision model, and where its agents ran (`isolation`).

    Only protocol and simulator are checked.
    """
    tasks: tuple[PackedTask, ...]
    agents: tuple[_Name, ...]
    """The agents in the order of their records; each has a record for every stage of every task, in order."""
    summary: dict[str, Any]
    """The claimed scores: `summary.json` of these agents."""


_Line = TypeVar("_Line", Submission, StageRecord)


def write_submission(path: Path, header: Submission, records: Iterable[str]) -> None:
    """Write a packed run, whole or not at all. The same contents give the same bytes."""
    with replacing(path) as beside, beside.open("wb") as raw, gzip.GzipFile("", "wb", fileobj=raw, mtime=0) as file:
        for text in (header.model_dump_json(), *records):
            file.write(f"{text}\n".encode())


def read_header(path: Path) -> Submission:
    """Read the header of a packed run.

    Raises:
        SubmissionError: The file is no packed run, or its header is malformed.
    """
    for where, line in _lines(path):
        return _parsed(where, line, Submission)
    raise SubmissionError(f"{path}: not a submission (it is empty)")


def read_records(path: Path) -> Iterator[tuple[StageRecord, bytes]]:
    """Yield the records of a packed run, and their lines.

    Raises:
        SubmissionError: The file is damaged, or a line is not a record as evonav writes it.
    """
    lines = _lines(path)
    next(lines, None)
    for where, line in lines:
        yield _parsed(where, line, StageRecord), line


def _lines(path: Path) -> Iterator[tuple[str, bytes]]:
    """Yield the lines of a file without their ends, each after its file and number, as errors name it."""
    where, num_bytes, most = str(path), 0, MAX_HEADER_BYTES
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):  # a pipe would be waited for
            raise SubmissionError(f"{path}: not a submission (no regular file)")
        if found.st_size > MAX_TOTAL_BYTES:
            raise SubmissionError(f"{path}: {found.st_size} B, the limit is {MAX_TOTAL_BYTES}")
        with gzip.open(path) as file:
            number = 1
            while line := file.readline(most + 1):
                where = f"{path}: line {number}"
                num_bytes += len(line)
                if not line.endswith(b"\n"):
                    why = f"longer than {most} B" if len(line) > most else "without an end"
                    raise SubmissionError(f"{where}: {why}")
                if num_bytes > MAX_TOTAL_BYTES:
                    raise SubmissionError(f"{where}: uncompressed, the limit is {MAX_TOTAL_BYTES} B")
                yield where, line[:-1]
                number, most = number + 1, MAX_LINE_BYTES
                where = f"{path}: line {number}"
    except (OSError, EOFError, zlib.error) as error:
        raise SubmissionError(f"{where}: not a submission, or damaged ({error})") from error


def _parsed(where: str, line: bytes, model: type[_Line]) -> _Line:
    if line.count(b",") + line.count(b"[") + line.count(b"{") > MAX_VALUES:
        raise SubmissionError(f"{where}: more than {MAX_VALUES} values")
    try:
        value = model.model_validate_json(line)
    except ValidationError as error:
        raise SubmissionError(f"{where}: {sentence_of(error)}") from error
    if value.model_dump_json().encode() != line:
        raise SubmissionError(f"{where}: not as evonav writes it")
    return value
