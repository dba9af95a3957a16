"""Check what a memory answers, and keep its entries as columns.

Every answer is checked once, here. A wrong one is a `MemoryFailedError` with one sentence, which costs the memory its
stream and nothing else.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from evonav.counted import counted
from evonav.errors import EvonavError
from evonav.memory_benchmark.protocol import FoundPlace, MemoryEntry

MAX_ENTRIES = 100_000
"""Largest number of entries of an answer."""
MIN_ENTRY_BYTES = 6
"""Bytes that no memory can do without for an entry: three different coordinates in the smallest common float format."""
MAX_SHOWN = 120
"""Longest value in a message, in characters."""

FailureKind = Literal["load", "raised", "hung", "died", "answer"]
"""`load`: it could not be made. `raised`, `hung`, `died`: a call ended so. `answer`: it answered what is no answer."""


Hosting = Literal["here", "process", "offline"]
"""The place where a memory runs: this process, its own, or elsewhere, with its answers in a file."""


class MemoryFailedError(EvonavError):
    """A benchmarked memory failed in a call; its stream is over."""

    def __init__(self, kind: FailureKind, message: str) -> None:
        """Create an error.

        Args:
            kind: The way it failed.
            message: The call, the field and the value in one sentence.
        """
        super().__init__(message)
        self.kind: FailureKind = kind


@dataclass(frozen=True, slots=True)
class CheckedEntries:
    """All entries of one answer as columns; every number has been checked."""

    ids: NDArray[np.int64]
    """`(N,)`, all different."""
    labels: tuple[str, ...]
    numbers: NDArray[np.float64]
    """`(N, 10)`: centre, size, confidence, `p_present`, first and last seen; the last three may be NaN: not given."""

    @property
    def centres_m(self) -> NDArray[np.float64]:
        """`(N, 3)` centres."""
        return self.numbers[:, :3]

    @property
    def p_present(self) -> NDArray[np.float64]:
        """`(N,)` probabilities that the objects are still there, NaN where the memory does not say."""
        column: NDArray[np.float64] = self.numbers[:, 7]
        return column

    def __len__(self) -> int:
        """Return the number of entries."""
        return len(self.labels)


_FIELDS = ("centre_m",) * 3 + ("size_m",) * 3 + ("confidence", "p_present", "first_seen_s", "last_seen_s")
NUM_COLUMNS = len(_FIELDS)
"""Columns of `CheckedEntries.numbers`."""
_NUM_GIVEN = 7
"""Columns that every entry has."""


def read_entries(answer: object) -> CheckedEntries:
    """Return a memory's answer to `entries()` as columns.

    Raises:
        MemoryFailedError: It is no sequence of `MemoryEntry`, or a field of one is wrong.
    """
    if not isinstance(answer, Sequence) or isinstance(answer, str | bytes):
        raise _wrong("entries()", answer, "must be a sequence of MemoryEntry")
    if len(answer) > MAX_ENTRIES:
        raise MemoryFailedError("answer", f"entries(): {len(answer)} entries, must be at most {MAX_ENTRIES}")
    try:
        rows = [_row(entry) for entry in answer]
        numbers = np.array(rows) if rows else np.empty((0, NUM_COLUMNS))
        ids = np.array([entry.entry_id for entry in answer]) if rows else np.empty(0, np.int64)
        labels = tuple(entry.label for entry in answer)
        is_typed = numbers.shape == (len(rows), NUM_COLUMNS) and numbers.dtype.kind in "fi" and ids.dtype.kind in "iu"
    except (AttributeError, TypeError, ValueError, OverflowError):
        is_typed = False
    if not is_typed or not all(isinstance(label, str) for label in labels):
        raise _first_of_wrong_type(answer)
    return checked(CheckedEntries(ids.astype(np.int64), labels, numbers.astype(np.float64)))


def checked(entries: CheckedEntries) -> CheckedEntries:
    """Check the values of entries whose types are right.

    Raises:
        MemoryFailedError: A number is out of its range; the message has entry, field and value.
    """
    numbers = entries.numbers
    is_wrong = ~np.isfinite(numbers)
    is_wrong[:, _NUM_GIVEN:] &= ~np.isnan(numbers[:, _NUM_GIVEN:])
    is_wrong[:, 3:6] |= numbers[:, 3:6] < 0.0
    shares = numbers[:, 6:8]
    is_wrong[:, 6:8] |= (shares < 0.0) | (shares > 1.0)
    if is_wrong.any():
        row, column = np.argwhere(is_wrong)[0].tolist()
        place = f"entries()[{row}].{_FIELDS[column]}"
        if column < 6:
            start = 0 if column < 3 else 3
            value: object = tuple(numbers[row, start : start + 3].tolist())
            rule = "must be finite" if column < 3 else "must be finite and not negative"
        else:
            value = float(numbers[row, column])
            rule = "must be from 0 to 1" if column < 8 else "must be finite or None"
        raise _wrong(place, value, rule)
    if not (entries.ids[1:] > entries.ids[:-1]).all():  # most memories answer in the order of their numbers
        values, counts = np.unique(entries.ids, return_counts=True)
        if len(values) == len(entries.ids):
            return entries
        raise _wrong("entries(): entry_id", int(values[counts > 1][0]), "must be of one entry only")
    return entries


def read_places(answer: object, k: int) -> list[FoundPlace]:
    """Return a memory's answer to `locate`, by falling score; of equal scores, the first one comes first.

    Raises:
        MemoryFailedError: It is no sequence of at most `k` finite places.
    """
    if not isinstance(answer, Sequence) or isinstance(answer, str | bytes):
        raise _wrong("locate()", answer, "must be a sequence of FoundPlace")
    if len(answer) > k:
        raise MemoryFailedError("answer", f"locate(): {len(answer)} places, must be at most {k}")
    places = []
    for index, place in enumerate(answer):
        try:
            x_m, y_m, z_m = (float(coordinate) for coordinate in place.position_m)
            score = float(place.score)
        except (AttributeError, TypeError, ValueError):
            raise _wrong(f"locate()[{index}]", place, "must be a FoundPlace") from None
        if not all(map(math.isfinite, (x_m, y_m, z_m, score))):
            raise _wrong(f"locate()[{index}]", place, "must be finite")
        places.append(FoundPlace((x_m, y_m, z_m), score))
    return sorted(places, key=lambda place: -place.score)


def read_num_bytes(answer: object, num_entries: int) -> int:
    """Return a memory's answer to `num_bytes()`.

    Raises:
        MemoryFailedError: It is no whole number, is negative, or is less than the entries alone must take.
    """
    if not isinstance(answer, int | np.integer) or isinstance(answer, bool):
        raise _wrong("num_bytes()", answer, "must be a whole number")
    if answer < 0:
        raise _wrong("num_bytes()", answer, "must not be negative")
    least = num_entries * MIN_ENTRY_BYTES
    if answer < least:
        verb = "takes" if num_entries == 1 else "take"
        raise _wrong("num_bytes()", answer, f"{counted(num_entries, 'entry')} alone {verb} at least {least} bytes")
    return int(answer)


def _row(entry: Any) -> tuple[Any, ...]:  # noqa: ANN401 - of a memory, so unchecked
    optional = (entry.p_present, entry.first_seen_s, entry.last_seen_s)
    given = (math.nan if value is None else value for value in optional)
    return *entry.centre_m, *entry.size_m, entry.confidence, *given


def _first_of_wrong_type(answer: Sequence[object]) -> MemoryFailedError:
    for index, entry in enumerate(answer):
        place = f"entries()[{index}]"
        if not isinstance(entry, MemoryEntry):
            return _wrong(place, entry, "must be a MemoryEntry")
        if not isinstance(entry.entry_id, int | np.integer) or not -(2**63) <= entry.entry_id < 2**63:
            return _wrong(f"{place}.entry_id", entry.entry_id, "must be a whole number of 64 bits")
        if not isinstance(entry.label, str):
            return _wrong(f"{place}.label", entry.label, "must be text")
        for name in ("centre_m", "size_m"):
            point = getattr(entry, name)
            if not isinstance(point, Sequence | np.ndarray) or len(point) != 3 or not all(map(_is_number, point)):
                return _wrong(f"{place}.{name}", point, "must be three numbers")
        for name in ("confidence", "p_present", "first_seen_s", "last_seen_s"):
            value = getattr(entry, name)
            if not _is_number(value) and (value is not None or name == "confidence"):
                return _wrong(f"{place}.{name}", value, "must be a number")
    return MemoryFailedError("answer", "entries(): the numbers of its entries do not make a table")


def _is_number(value: object) -> bool:
    return isinstance(value, float | int | np.number) and not isinstance(value, bool)


def _wrong(place: str, value: object, rule: str) -> MemoryFailedError:
    try:
        shown = repr(value)
    except Exception:  # the code of the memory
        shown = type(value).__name__
    shown = shown if len(shown) <= MAX_SHOWN else f"{shown[:MAX_SHOWN]} ..."
    return MemoryFailedError("answer", f"{place} = {shown}: {rule}")
