"""Houses from seeds: made when they are read, or into a file.

The core makes them (`evonav_core::house_generation`), in the way of ProcTHOR (Deitke et al., NeurIPS 2022).

A file of houses is made in parallel, resumable, and with the same bytes for any number of workers. Houses are written
in order as they are made, so memory does not grow with their number. An unfinished file has the suffix `.partial`, and
its parameters beside it, in `.partial.json`; the same command goes on after its last whole house.
"""

import gzip
import hashlib
import json
import re
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from itertools import count as counted_from
from pathlib import Path
from typing import IO

from evonav._core import HouseMaker, __version__, default_house_parameters
from evonav.errors import EvonavError, InvalidArgumentError, SimulationError, StoreError
from evonav.parallel.pool import Job, Pool, open_pool
from evonav.parallel.worker import Workforce
from evonav.toml import read_toml

ENDLESS = "endless"
"""`endless:SEED` names the endless houses of a seed, and `endless:SEED:N` the N-th of them, from 1."""
SPLIT_SEEDS = {"train": 20_001, "val": 20_002, "test": 20_003}
"""Seeds of `endless:train`, `endless:val` and `endless:test`, which have the assets of their split."""
MAX_SEED = 2**64 - 1
_NAME = re.compile(rf"{ENDLESS}:(\d+|{'|'.join(SPLIT_SEEDS)})(?::([1-9]\d*))?")
WORK = "evonav.house.generated:house_work"
HOUSE_TIMEOUT_S = 300.0
"""Longest time for a house; most take a few hundredths of a second."""
WINDOW = 256
"""Houses that may be made before the next one to write is ready; they are all that memory holds."""
_SUFFIXES = (".jsonl", ".jsonl.gz")
_LEVEL = 9
_READ_BYTES = 1 << 20


class EndlessHouses:
    """The endless houses of a seed, or one of them, made as they are read."""

    def __init__(self, name: str) -> None:
        """Read a name.

        Args:
            name: `endless:SEED` or `endless:SPLIT`, and `:N` for the N-th of them.

        Raises:
            InvalidArgumentError: The name has another form, or a number is too large.
        """
        found = _NAME.fullmatch(name)
        if found is None:
            splits = ", ".join(SPLIT_SEEDS)
            raise InvalidArgumentError(
                f"{name}: expected {ENDLESS}:SEED or {ENDLESS}:SEED:N, with N from 1, and {splits} or a number as SEED"
            )
        self.name = f"{ENDLESS}:{found[1]}"
        """Name of all houses of the seed."""
        split = found[1] if found[1] in SPLIT_SEEDS else None
        self.seed = int(found[1]) if split is None else SPLIT_SEEDS[split]
        self.parameters = "{}" if split is None else json.dumps({"split": split})
        """Parameters as JSON."""
        self.number = None if found[2] is None else int(found[2])
        """Number of the only house, from 1; `None` for all."""
        if max(self.seed, self.number or 0) > MAX_SEED:
            raise InvalidArgumentError(f"{name}: a number is beyond {MAX_SEED}")

    def sha256(self) -> str:
        """Return the checksum of everything that decides the houses: version, seed and parameters."""
        return hashlib.sha256(
            f"{__version__} {self.seed} {default_house_parameters()} {self.parameters}".encode()
        ).hexdigest()

    def __iter__(self) -> Iterator[tuple[str, str]]:
        """Yield the name `endless:SEED:N` and the text of each house, from the first one on."""
        for number in counted_from(1) if self.number is None else [self.number]:
            yield self.house(number)

    def house(self, number: int) -> tuple[str, str]:
        """Make the house of a number from 1; return its name and its text."""
        return f"{self.name}:{number}", house_maker(self.parameters).make(self.seed, number - 1)


@lru_cache(maxsize=4)
def house_maker(parameters_json: str) -> HouseMaker:
    """Return the maker of houses with these parameters; it is made once in a process.

    Raises:
        InvalidArgumentError: A parameter is wrong; names the field.
    """
    return HouseMaker(parameters_json)


def read_house_parameters(path: Path | None) -> str:
    """Read the parameters of houses from a TOML file, as JSON.

    Args:
        path: Tables and keys of `evonav_core::house_generation::HouseParameters`; what is left out has its default.
            `None` for all defaults.

    Raises:
        InvalidArgumentError: The file cannot be read, or a parameter is wrong; names file, field and value.
    """
    if path is None:
        return "{}"
    values = read_toml(path)
    try:
        text = json.dumps(values, allow_nan=False)
        house_maker(text)
    except InvalidArgumentError as error:
        raise InvalidArgumentError(f"{path}: {error}") from None
    except (TypeError, ValueError) as error:
        raise InvalidArgumentError(f"{path}: {error}: expected finite numbers, words and lists") from None
    return text


@dataclass(frozen=True, slots=True)
class MakingProgress:
    """Progress of a file of houses."""

    num_houses: int
    """Number of houses in the file, including those of earlier calls."""
    num_new: int
    """Number of houses that this call made."""
    seconds: float
    """Duration of this call so far."""


def house_work(settings: str, alive: Callable[[], None]) -> Callable[[str], str]:
    """Return the work of a worker: from the number of a house to its JSON, or to what is wrong."""
    del alive  # a house takes less time than a heartbeat
    found = json.loads(settings)
    seed, maker = int(found["seed"]), house_maker(found["parameters"])

    def make(number: str) -> str:
        try:
            return json.dumps({"house": maker.make(seed, int(number))})
        except EvonavError as error:
            return json.dumps({"error": str(error)})

    return make


def make_houses(
    out: Path,
    count: int,
    *,
    seed: int = 0,
    first: int = 0,
    parameters: str = "{}",
    workforce: Workforce | None = None,
    on_progress: Callable[[MakingProgress], None] = lambda _: None,
) -> MakingProgress:
    """Make the houses `first` to `first + count - 1` of a seed into a file, one a line.

    Args:
        out: A file `.jsonl` or `.jsonl.gz` that does not exist; an unfinished one is resumed.
        seed: Seed of every random choice.
        first: Number of the first house, from 0.
        parameters: Parameters as JSON (`read_house_parameters`).
        workforce: The workers; default: this process.
        on_progress: Called at the beginning and after every house.

    Raises:
        InvalidArgumentError: An argument is outside its domain; names it.
        SimulationError: A house cannot be made with these parameters.
        StoreError: `out` exists, cannot be written, or was begun with other arguments.
        EngineError: The workers cannot be started.
    """
    if not out.name.endswith(_SUFFIXES):
        raise InvalidArgumentError(f"{out}: expected a file with one of {', '.join(_SUFFIXES)}")
    if count < 1 or first < 0 or not 0 <= seed <= MAX_SEED or first + count > MAX_SEED:
        raise InvalidArgumentError(
            f"count = {count}, first = {first}, seed = {seed}: expected a count from 1 and numbers up to 2^64 - 1"
        )
    house_maker(parameters)  # a wrong parameter is found before anything is written
    if out.exists():
        raise StoreError(f"{out}: exists already; choose another file, or remove it")
    identity = {"evonav": __version__, "seed": seed, "first": first, "count": count, "parameters": parameters}
    start_s = time.monotonic()
    with _unfinished(out, identity) as (file, num_before):
        num_done = num_before
        on_progress(MakingProgress(num_done, 0, 0.0))
        settings = json.dumps({"seed": seed, "parameters": parameters})
        with open_pool(WORK, settings, workforce or Workforce(), timeout_s=HOUSE_TIMEOUT_S) as pool:
            for text in _in_order(pool, range(first + num_before, first + count)):
                file.write(_encoded(text, out))
                file.flush()
                num_done += 1
                seconds = time.monotonic() - start_s
                on_progress(MakingProgress(num_done, num_done - num_before, seconds))
    _partial(out).replace(out)
    _identity_file(out).unlink(missing_ok=True)
    return MakingProgress(num_done, num_done - num_before, time.monotonic() - start_s)


def _in_order(pool: Pool, numbers: range) -> Iterator[str]:
    """Yield the houses of some numbers in order, as workers make them."""
    ready: dict[int, str] = {}
    num_open, next_job = 0, numbers.start
    for number in numbers:
        while number not in ready:
            while num_open < pool.capacity and next_job < min(numbers.stop, number + WINDOW):
                pool.submit(Job(key=next_job, text=str(next_job)))
                num_open, next_job = num_open + 1, next_job + 1
            answer = pool.next_answer()
            num_open -= 1
            if answer.failure is not None:
                raise SimulationError(f"house {answer.key}: {answer.failure}: {answer.detail}")
            found = json.loads(answer.text)
            if "error" in found:
                raise SimulationError(found["error"])
            ready[answer.key] = found["house"]
        yield ready.pop(number)


@contextmanager
def _unfinished(out: Path, identity: dict[str, object]) -> Iterator[tuple[IO[bytes], int]]:
    """Open the unfinished file for appending, and count the whole houses that it holds."""
    partial, identity_file = _partial(out), _identity_file(out)
    text = json.dumps(identity, indent=1) + "\n"
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        if not partial.exists():
            identity_file.write_text(text, encoding="utf-8")
        elif not identity_file.exists() or identity_file.read_text(encoding="utf-8") != text:
            raise StoreError(f"{partial}: was begun with other arguments; use the same ones, or remove it")
        with partial.open("ab") as file:
            num_houses, size = _whole_houses(partial, is_compressed=out.suffix == ".gz")
            file.truncate(size)
            yield file, num_houses
    except OSError as error:
        raise StoreError(f"{partial}: cannot be written: {error.strerror or error}") from error


def _partial(out: Path) -> Path:
    return out.with_name(out.name + ".partial")


def _identity_file(out: Path) -> Path:
    return out.with_name(out.name + ".partial.json")


def _encoded(text: str, out: Path) -> bytes:
    """Return the bytes of a house: a line, for `.gz` as a member of its own."""
    line = text.encode() + b"\n"
    return gzip.compress(line, _LEVEL, mtime=0) if out.suffix == ".gz" else line


def _whole_houses(partial: Path, *, is_compressed: bool) -> tuple[int, int]:
    """Return the number of whole houses in an unfinished file, and the number of bytes that they take."""
    num_houses = size = 0
    with partial.open("rb") as file:
        if not is_compressed:
            for line in file:
                if not line.endswith(b"\n"):
                    break
                num_houses, size = num_houses + 1, size + len(line)
            return num_houses, size
        data, member, position = b"", zlib.decompressobj(wbits=31), 0
        while chunk := data or file.read(_READ_BYTES):
            try:
                member.decompress(chunk)
            except zlib.error:
                break
            data = member.unused_data
            position += len(chunk) - len(data)
            if member.eof:
                num_houses, size, member = num_houses + 1, position, zlib.decompressobj(wbits=31)
    return num_houses, size
