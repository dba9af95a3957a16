"""Read houses from files."""

import gzip
import json
import re
import zlib
from collections.abc import Iterator, Mapping
from importlib import resources
from io import TextIOWrapper
from itertools import islice
from pathlib import Path
from typing import IO, NamedTuple, Protocol

from evonav._core import House
from evonav.errors import HouseError, InvalidArgumentError
from evonav.house.generated import ENDLESS, EndlessHouses
from evonav.parallel.folders import sha256_of_file

BUNDLED = "bundled"
"""Names the houses that come with evonav; `bundled:3` is the third of them."""
_NUMBERED = re.compile(r"(.+):([1-9]\d*)")
SUFFIXES = (".json", ".jsonl", ".json.gz", ".jsonl.gz")


def stream_houses(path: str | Path, limit: int | None = None) -> Iterator[House]:
    """Yield the houses of a file or a directory, in order.

    Args:
        path: A `.json` file with a house or a list of houses, a `.jsonl` file with a house a line, either with `.gz`;
            or a directory with such files, taken by name; a fetched split, `procthor-10k:val`; a split that is made
            when it is first used, `evonav-10k:test`; `endless:SEED`, for houses that are made as they are read, without
            end; or `bundled`, for the houses that come with evonav. `bundled:3`, `evonav-10k:test:3`, `endless:7:3` and
            `houses.jsonl:3` are the third house.
        limit: Number of houses after which to stop.

    Yields:
        Each house, checked; its `name` is `file:line`, for lists `file:line[index]`,
        of a split `procthor-10k:val:line`, of the bundled ones `bundled:line`, of endless ones `endless:seed:number`.

    Raises:
        HouseError: A file cannot be read or a house is malformed; it names file, line, object and field.
        InvalidArgumentError: `limit` is negative.
    """
    if limit is not None and limit < 0:
        raise InvalidArgumentError(f"argument `limit` is {limit}, expected None or at least 0")
    return (House(text, name=name) for name, text in islice(HouseTexts(path), limit))


class HouseText(NamedTuple):
    """A house as text, not parsed yet."""

    name: str
    """The name that `stream_houses` gives the house."""
    text: str


class HouseCompletion(Protocol):
    """Completes houses as they are read (`evonav.world.house_options.HouseOptions`)."""

    @property
    def identity(self) -> Mapping[str, str]:
        """Everything that decides the result."""
        ...

    def complete(self, name: str, text: str) -> str:
        """Return a house with what it lacks."""
        ...


class HouseTexts:
    """The houses of a file or a directory as text, one at a time, with the progress of reading."""

    def __init__(self, path: str | Path, completion: HouseCompletion | None = None) -> None:
        """Find the files.

        Args:
            path: A path, as for `stream_houses`.
            completion: Completes each house as it is read.

        Raises:
            HouseError: The file does not exist; or a split was not fetched, is incomplete, or holds other houses.
            InvalidArgumentError: The path names a known dataset, but no split of it.
        """
        source = _source_of(path)
        self.completion = completion
        self.name = source.name
        self.split = source.split
        """Data set and split of the houses; `None` if their path names none."""
        self.endless = source.endless
        """Houses that are made as they are read."""
        self.files = [] if source.file is None else files_of(source.file)
        """The files to read, in order."""
        self._file, self._number, self._sha256 = source.file, source.number, source.sha256
        self._num_bytes = sum(file.stat().st_size for file in self.files)
        self._num_bytes_before = 0
        self._raw: IO[bytes] | None = None

    @property
    def is_endless(self) -> bool:
        """Return whether there is no last house."""
        return self.endless is not None and self.endless.number is None

    def check_end(self, limit: int | None) -> None:
        """Check that no more houses are asked for than can be read.

        Raises:
            InvalidArgumentError: The houses are endless, and there is no limit.
        """
        if limit is None and self.is_endless:
            raise InvalidArgumentError(f"{self.name}: there is no last house; say how many to take (--limit, `limit`)")

    def checksums(self) -> list[tuple[str, str]]:
        """Return a name and a SHA-256 for everything that the houses are read from or made of.

        Raises:
            HouseError: A file cannot be read.
        """
        if self.endless is not None:
            return [(self.name, self.endless.sha256())]
        if self._sha256 is not None:
            return [(self.name, self._sha256)]
        try:
            return [(self.name if self.split else file.name, sha256_of_file(file)) for file in self.files]
        except OSError as error:
            raise HouseError(f"{self.name}: cannot be read: {error}") from error

    @property
    def share_read(self) -> float:
        """Share of the bytes of all files that has been read, 0 to 1."""
        position = 0 if self._raw is None or self._raw.closed else self._raw.tell()
        return min(1.0, (self._num_bytes_before + position) / max(1, self._num_bytes))

    def __iter__(self) -> Iterator[HouseText]:
        """Yield houses from the first one on, completed.

        Raises:
            HouseError: A file cannot be read, or a list of houses is malformed; or there is no bundled house of the
                number.
        """
        found = self._read() if self._number is None else islice(self._read(), self._number - 1, self._number)
        is_empty = True
        for house in found:
            is_empty = False
            yield house if self.completion is None else house._replace(text=self.completion.complete(*house))
        if is_empty and self._number is not None:
            raise HouseError(f"{self.name}:{self._number}: {self.name} has fewer houses")

    def _read(self) -> Iterator[HouseText]:
        if self.endless is not None:
            yield from (HouseText(*house) for house in self.endless)
        self._num_bytes_before = 0
        for file in self.files:
            name = self.name if file == self._file else str(file)
            try:
                with file.open("rb") as self._raw, _text_of(file, self._raw) as text:
                    yield from _lines(name, text) if ".jsonl" in file.suffixes else _document(name, text.read())
            except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
                raise HouseError(f"{file}: cannot be read: {error}") from error
            self._num_bytes_before += file.stat().st_size
            self._raw = None


class _Source(NamedTuple):
    """The meaning of a path of houses."""

    name: str
    file: Path | None
    """File or folder to read; `None` for houses that are made as they are read."""
    number: int | None = None
    """Number of the one house that is read; `None` for all."""
    split: tuple[str, str] | None = None
    sha256: str | None = None
    """Checksum of the houses' text, whatever the file is packed by; `None` if that of the file is taken."""
    endless: EndlessHouses | None = None


def _source_of(path: str | Path) -> _Source:
    """Return what a path stands for: what exists is read, then the named sets are tried."""
    text, file = str(path), Path(path)
    if not file.exists():
        if (numbered := _NUMBERED.fullmatch(text)) and Path(numbered[1]).is_file():
            return _Source(numbered[1], Path(numbered[1]), int(numbered[2]))
        for pattern, source in _NAMED_SETS:
            if pattern.match(text):
                return source(text)
    return _Source(str(file), file)


def _bundled(text: str) -> _Source:
    _, colon, number = text.partition(":")
    if colon and (not number.isdigit() or int(number) < 1):
        raise HouseError(f"{text}: expected `bundled` or `bundled:N`, where N is a number from 1")
    file = Path(str(resources.files("evonav") / "data" / "houses.jsonl.gz"))
    return _Source(BUNDLED, file, int(number) if colon else None)


def _endless(text: str) -> _Source:
    return _Source(text, None, endless=EndlessHouses(text))


def _procthor10k(text: str) -> _Source:
    from evonav.house.procthor10k import NAME, house_set, split_path

    published = house_set(text)
    return _Source(text, split_path(published), split=(NAME, published.split))


def _evonav10k(text: str) -> _Source:
    from evonav.house.evonav10k import NAME, SPLITS, made_split, named_split

    numbered = _NUMBERED.fullmatch(text)
    name, number = (numbered[1], int(numbered[2])) if numbered else (text, None)
    split = named_split(name)
    return _Source(name, made_split(split), number, (NAME, split), SPLITS[split].sha256)


_NAMED_SETS = (
    (re.compile(rf"{BUNDLED}(:|$)"), _bundled),
    (re.compile(rf"{ENDLESS}(:|$)"), _endless),
    (re.compile("procthor-10k"), _procthor10k),
    (re.compile("evonav-10k"), _evonav10k),
)


def files_of(path: Path) -> list[Path]:
    """Return the house files of a directory, by name, or the one file that the path is.

    Raises:
        HouseError: No file exists, or the file has another suffix.
    """
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.name.endswith(SUFFIXES) and file.is_file())
        if not files:
            raise HouseError(f"{path}: no {', '.join(SUFFIXES)} file in this directory")
        return files
    if not path.name.endswith(SUFFIXES):
        raise HouseError(f"{path}: expected a folder, a file with one of {', '.join(SUFFIXES)}, or the word {BUNDLED}")
    if not path.exists():
        raise HouseError(f"{path}: cannot be read: no such file")
    return [path]


def bundled_houses(limit: int | None = None) -> Iterator[House]:
    """Yield the multi-room houses that come with evonav (generated with the published `procthor` generator).

    Args:
        limit: Number of houses after which to stop.

    Yields:
        Each house, in a fixed order; its `name` is `bundled:line`.
    """
    yield from stream_houses(BUNDLED, limit)


def _text_of(path: Path, raw: IO[bytes]) -> IO[str]:
    return gzip.open(raw, "rt", encoding="utf-8") if path.suffix == ".gz" else TextIOWrapper(raw, encoding="utf-8")


def _lines(name: str, text: IO[str]) -> Iterator[HouseText]:
    for number, line in enumerate(text, start=1):
        if line.strip():
            yield HouseText(f"{name}:{number}", line)


def _document(name: str, text: str) -> Iterator[HouseText]:
    """Yield the house of a document, or the houses of its list."""
    start = _after_space(text, 0)
    if not text.startswith("[", start):
        yield HouseText(f"{name}:1", text)
        return
    line, counted = 1, 0
    for index, (begin, end) in enumerate(_entries(name, text, start)):
        line, counted = line + text.count("\n", counted, begin), begin
        yield HouseText(f"{name}:{line}[{index}]", text[begin:end])


def _entries(name: str, text: str, start: int) -> Iterator[tuple[int, int]]:
    """Yield the begin and end of each entry of the list at `start`; cut out as text, numbers stay as written."""
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
