"""Houses from files."""

import gzip
import json
import zlib
from collections.abc import Iterator
from importlib import resources
from itertools import islice
from pathlib import Path
from typing import IO, TYPE_CHECKING

from evonav._core import House
from evonav.errors import HouseError, InvalidArgumentError

if TYPE_CHECKING:
    from evonav.house.procthor10k import HouseSet

SUFFIXES = (".json", ".jsonl", ".json.gz", ".jsonl.gz")


def load_houses(path: str | Path, limit: int | None = None) -> Iterator[House]:
    """Houses of a file or a directory, one after the other, in order.

    Args:
        path: A `.json` file with a house or a list of houses, a `.jsonl` file with a house a line, either with `.gz`;
            or a directory with such files, taken by name; or a fetched split, `procthor-10k:val`.
        limit: Stop after so many.

    Yields:
        Each house, checked; its `name` is `file:line`, for lists `file:line[index]`,
        of a split `procthor-10k:val:line`.

    Raises:
        HouseError: A file cannot be read or a house is malformed; it names file, line, object and field.
        InvalidArgumentError: `limit` is negative.
    """
    if limit is not None and limit < 0:
        message = f"argument `limit` is {limit}, expected None or at least 0"
        raise InvalidArgumentError(message)
    file = house_file(path)
    return islice(_houses(file, str(path if named_set(path) else file)), limit)


def named_set(path: str | Path) -> "HouseSet | None":
    """The published split that a `--houses` argument names; None if it is a file or a directory.

    Raises:
        InvalidArgumentError: It names a dataset that evonav knows, but no split of it.
    """
    if not str(path).startswith("procthor-10k") or Path(path).exists():
        return None
    from evonav.house.procthor10k import house_set

    return house_set(path)


def house_file(path: str | Path) -> Path:
    """The file or directory that a `--houses` argument means.

    Raises:
        DatasetError: It is a published split that was not fetched, or is not whole.
        InvalidArgumentError: As for `named_set`.
    """
    named = named_set(path)
    if named is None:
        return Path(path)
    from evonav.house.procthor10k import split_path

    return split_path(named)


def bundled_houses(limit: int | None = None) -> Iterator[House]:
    """The multi-room houses that come with evonav (generated with the published `procthor` generator).

    Args:
        limit: Stop after so many.

    Yields:
        Each house, in a fixed order; its `name` is `bundled:line`.
    """
    file = resources.files("evonav") / "data" / "houses.jsonl.gz"
    with file.open("rb") as packed, gzip.open(packed, "rt", encoding="utf-8") as lines:
        for number, line in islice(enumerate(lines, start=1), limit):
            yield House(line, name=f"bundled:{number}")


def _houses(path: Path, name: str) -> Iterator[House]:
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.name.endswith(SUFFIXES) and file.is_file())
        if not files:
            message = f"{path}: no {', '.join(SUFFIXES)} file in this directory"
            raise HouseError(message)
        for file in files:
            yield from _houses(file, str(file))
        return
    if not path.name.endswith(SUFFIXES):
        message = f"{path}: expected a directory or a file with one of {', '.join(SUFFIXES)}"
        raise HouseError(message)
    try:
        with _open(path) as text:
            yield from _lines(name, text) if ".jsonl" in path.suffixes else _document(path, text.read())
    except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
        message = f"{path}: cannot be read: {error}"
        raise HouseError(message) from error


def _open(path: Path) -> IO[str]:
    return gzip.open(path, "rt", encoding="utf-8") if path.suffix == ".gz" else path.open(encoding="utf-8")


def _lines(name: str, text: IO[str]) -> Iterator[House]:
    for number, line in enumerate(text, start=1):
        if line.strip():
            yield House(line, name=f"{name}:{number}")


def _document(path: Path, text: str) -> Iterator[House]:
    """One house, or a list of houses."""
    start = _after_space(text, 0)
    if not text.startswith("[", start):
        yield House(text, name=f"{path}:1")
        return
    line, counted = 1, 0
    for index, (begin, end) in enumerate(_entries(path, text, start)):
        line, counted = line + text.count("\n", counted, begin), begin
        yield House(text[begin:end], name=f"{path}:{line}[{index}]")


def _entries(path: Path, text: str, start: int) -> Iterator[tuple[int, int]]:
    """Where the entries of the list at `start` begin and end: cut out, their numbers stay as they were written."""
    decoder = json.JSONDecoder()
    position = _after_space(text, start + 1)
    is_closed = text.startswith("]", position)
    while not is_closed:
        try:
            _, end = decoder.raw_decode(text, position)
        except (ValueError, RecursionError) as error:
            raise _list_error(path, text, position, str(error)) from error
        yield position, end
        position = _after_space(text, end)
        is_closed = text.startswith("]", position)
        if not is_closed:
            if not text.startswith(",", position):
                raise _list_error(path, text, position, "expected `,` or `]` after a house")
            position = _after_space(text, position + 1)
    if _after_space(text, position + 1) != len(text):
        raise _list_error(path, text, position, "text follows the list")


def _list_error(path: Path, text: str, position: int, message: str) -> HouseError:
    line = text.count("\n", 0, position) + 1
    return HouseError(f"house {path}:{line}: document: field `JSON`: {message}")


def _after_space(text: str, position: int) -> int:
    while position < len(text) and text[position] in " \t\r\n":
        position += 1
    return position
