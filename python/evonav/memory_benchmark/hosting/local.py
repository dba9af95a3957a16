"""Call a memory in this process: time the calls, and check what it answers."""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from evonav.agents.hosting.error_text import describe
from evonav.memory_benchmark.answers import (
    CheckedEntries,
    Hosting,
    MemoryFailedError,
    read_entries,
    read_num_bytes,
    read_places,
)
from evonav.memory_benchmark.protocol import FoundPlace, Memory, MemoryFrame, StreamInfo

PACKAGE = "evonav.memory_benchmark"
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Cost:
    """The cost of a call."""

    cpu_s: float | None
    """CPU time of the whole process while the call ran: threads that the memory starts count, too.

    `None` where it is not known.
    """
    wall_s: float


class LocalMemory:
    """A memory in this process. A call that raises or answers wrongly is a `MemoryFailedError`."""

    hosting: Hosting = "here"
    rss_bytes: int | None = None
    """Resident memory of its own process: it has none."""
    peak_rss_bytes: int | None = None

    def __init__(self, factory: Callable[[], Memory]) -> None:
        """Make the memory.

        Raises:
            MemoryFailedError: The factory raises, or what it makes lacks a method.
        """
        try:
            self._memory = factory()
        except (Exception, SystemExit) as error:
            raise MemoryFailedError("load", f"cannot be made: {describe(error, caller=PACKAGE)}") from error
        missing = [name for name in ("reset", "visit", "observe", "entries") if not callable(_get(self._memory, name))]
        if missing:
            raise MemoryFailedError("load", f"{type(self._memory).__name__} has no method `{missing[0]}`")
        self.can_locate = callable(_get(self._memory, "locate"))
        self._counts_bytes = callable(_get(self._memory, "num_bytes"))

    def reset(self, info: StreamInfo) -> Cost:
        """Begin a stream."""
        return self._timed("reset", lambda: self._memory.reset(info))[1]

    def visit(self, time_s: float) -> Cost:
        """Begin a visit."""
        return self._timed("visit", lambda: self._memory.visit(time_s))[1]

    def observe(self, frame: MemoryFrame) -> Cost:
        """Hand over a frame."""
        return self._timed("observe", lambda: self._memory.observe(frame))[1]

    def entries(self) -> CheckedEntries:
        """Return the entries."""
        return read_entries(self._timed("entries", self._memory.entries)[0])

    def num_bytes(self, num_entries: int) -> int | None:
        """Return the size that the memory tells; `None` if it tells none."""
        if not self._counts_bytes:
            return None
        memory: Any = self._memory
        return read_num_bytes(self._timed("num_bytes", memory.num_bytes)[0], num_entries)

    def locate(self, text: str, k: int) -> tuple[list[FoundPlace], Cost]:
        """Ask where something is."""
        memory: Any = self._memory
        answer, cost = self._timed("locate", lambda: memory.locate(text, k))
        return read_places(answer, k), cost

    def close(self) -> None:
        """Let go of the memory."""
        del self._memory

    def _timed(self, call: str, function: Callable[[], T]) -> tuple[T, Cost]:
        wall_ns, cpu_ns = time.perf_counter_ns(), time.process_time_ns()
        try:
            answer = function()
        except (Exception, SystemExit) as error:
            raise MemoryFailedError("raised", f"{call}() raises {describe(error, caller=PACKAGE)}") from error
        cpu_ns = time.process_time_ns() - cpu_ns
        return answer, Cost(cpu_ns * 1e-9, (time.perf_counter_ns() - wall_ns) * 1e-9)


def _get(memory: object, name: str) -> object:
    try:
        return getattr(memory, name, None)
    except Exception:  # a property of the memory
        return None


def resident_bytes() -> int | None:
    """Return the resident memory of this process; `None` where the system does not report it."""
    try:
        return int(Path("/proc/self/statm").read_bytes().split()[1]) * _page_bytes()
    except (OSError, IndexError, ValueError):
        return None


@cache
def _page_bytes() -> int:
    return os.sysconf("SC_PAGE_SIZE")
