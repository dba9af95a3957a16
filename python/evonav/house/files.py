"""Houses from files."""

import gzip
import json
import zlib
from collections.abc import Iterator
from importlib import resources
from io import TextIOWrapper
from itertools import islice
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple

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
    return (House(text, name=name) for name, text in islice(HouseTexts(path), limit))


class HouseText(NamedTuple):
    """A house as it was written, not yet read."""

    name: str
    """As `load_houses` gives it."""
    text: str


class HouseTexts:
    """The houses of a file or a directory as text, one at a time, and how far the reading is."""

    def __init__(self, path: str | Path) -> None:
        """Looks where the houses are.

        Args:
            path: As for `load_houses`.

        Raises:
            HouseError: There is no such file.
            InvalidArgumentError: As for `named_set`.
        """
        self.published = named_set(path)
        """The published split that is read; `None` for a file or a directory."""
        self._path = _file_of(path, self.published)
        self.name = str(path if self.published else self._path)
        self.files = files_of(self._path)
        """What is read, in order."""
        self._num_bytes = sum(file.stat().st_size for file in self.files)
        self._num_bytes_before = 0
        self._raw: IO[bytes] | None = None

    @property
    def share_read(self) -> float:
        """Of the bytes of all files, 0 to 1."""
        position = 0 if self._raw is None or self._raw.closed else self._raw.tell()
        return min(1.0, (self._num_bytes_before + position) / max(1, self._num_bytes))

    def __iter__(self) -> Iterator[HouseText]:
        """Reads from the first house on.

        Raises:
            HouseError: A file cannot be read, or a list of houses is malformed.
        """
        self._num_bytes_before = 0
        for file in self.files:
            name = self.name if file == self._path else str(file)
            try:
                with file.open("rb") as self._raw, _text_of(file, self._raw) as text:
                    yield from _lines(name, text) if ".jsonl" in file.suffixes else _document(name, text.read())
            except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
                message = f"{file}: cannot be read: {error}"
                raise HouseError(message) from error
            self._num_bytes_before += file.stat().st_size
            self._raw = None


def files_of(path: Path) -> list[Path]:
    """The house files of a directory, by name, or the one that the path is.

    Raises:
        HouseError: There is none, or it has another suffix.
    """
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.name.endswith(SUFFIXES) and file.is_file())
        if not files:
            message = f"{path}: no {', '.join(SUFFIXES)} file in this directory"
            raise HouseError(message)
        return files
    if not path.name.endswith(SUFFIXES):
        message = f"{path}: expected a directory or a file with one of {', '.join(SUFFIXES)}"
        raise HouseError(message)
    if not path.exists():
        message = f"{path}: cannot be read: no such file"
        raise HouseError(message)
    return [path]


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
    return _file_of(path, named_set(path))


def _file_of(path: str | Path, published: "HouseSet | None") -> Path:
    if published is None:
        return Path(path)
    from evonav.house.procthor10k import split_path

    return split_path(published)


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


def _text_of(path: Path, raw: IO[bytes]) -> IO[str]:
    return gzip.open(raw, "rt", encoding="utf-8") if path.suffix == ".gz" else TextIOWrapper(raw, encoding="utf-8")


def _lines(name: str, text: IO[str]) -> Iterator[HouseText]:
    for number, line in enumerate(text, start=1):
        if line.strip():
            yield HouseText(f"{name}:{number}", line)


def _document(name: str, text: str) -> Iterator[HouseText]:
    """One house, or a list of houses."""
    start = _after_space(text, 0)
    if not text.startswith("[", start):
        yield HouseText(f"{name}:1", text)
        return
    line, counted = 1, 0
    for index, (begin, end) in enumerate(_entries(name, text, start)):
        line, counted = line + text.count("\n", counted, begin), begin
        yield HouseText(f"{name}:{line}[{index}]", text[begin:end])


def _entries(name: str, text: str, start: int) -> Iterator[tuple[int, int]]:
    """Where the entries of the list at `start` begin and end: cut out, their numbers stay as they were written."""
    decoder = json.JSONDecoder()
    position = _after_space(text, start + 1)
    is_closed = text.startswith("]", position)
    while not is_closed:
        try:
            _, end = decoder.raw_decode(text, position)
        except (ValueError, RecursionError) as error:
            raise _list_error(name, text, position, str(error)) from error
        yield position, end
        position = _after_space(text, end)
        is_closed = text.startswith("]", position)
        if not is_closed:
            if not text.startswith(",", position):
                raise _list_error(name, text, position, "expected `,` or `]` after a house")
            position = _after_space(text, position + 1)
    if _after_space(text, position + 1) != len(text):
        raise _list_error(name, text, position, "text follows the list")


def _list_error(name: str, text: str, position: int, message: str) -> HouseError:
    line = text.count("\n", 0, position) + 1
    return HouseError(f"house {name}:{line}: document: field `JSON`: {message}")


def _after_space(text: str, position: int) -> int:
    while position < len(text) and text[position] in " \t\r\n":
        position += 1
    return position
