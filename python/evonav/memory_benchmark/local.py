"""Call a memory in this process: time the calls, and check what it answers. `main` does so in a process of its own."""

import base64
import json
import mmap
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

from evonav.agents.hosting import serving
from evonav.agents.hosting.error_text import describe
from evonav.component import Component
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


class HostedMemory(ABC):
    """A memory as the runner sees it; every call may raise `MemoryFailedError`."""

    hosting: Hosting
    can_locate = False
    rss_bytes: int | None = None
    """Resident memory of its own process after the last call; `None` without one."""
    peak_rss_bytes: int | None = None
    """Peak of it, known after `num_bytes`."""

    def reset(self, info: StreamInfo) -> None:
        """Begin a stream."""
        self.call("reset", info)

    def visit(self, time_s: float) -> Cost | None:
        """Begin a visit."""
        return self.call("visit", time_s)

    def observe(self, frame: MemoryFrame) -> Cost | None:
        """Hand over a frame; return what it cost, if that is known."""
        return self.call("observe", frame)

    @abstractmethod
    def call(self, name: str, argument: object) -> Cost | None:
        """Call a method that answers nothing."""

    @abstractmethod
    def entries(self) -> CheckedEntries:
        """Return the entries."""

    @abstractmethod
    def num_bytes(self, num_entries: int) -> int | None:
        """Return the size that the memory reports; `None` if it reports none."""

    def locate(self, text: str, k: int) -> tuple[list[FoundPlace], Cost]:
        """Ask where something is."""
        raise NotImplementedError

    @abstractmethod
    def close(self) -> None:
        """Let go of the memory."""


class LocalMemory(HostedMemory):
    """A memory in this process. A call that raises or answers wrongly is a `MemoryFailedError`."""

    hosting: Hosting = "here"

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

    def call(self, name: str, argument: object) -> Cost:
        """Call a method that answers nothing."""
        return self._timed(name, lambda: getattr(self._memory, name)(argument))[1]

    def entries(self) -> CheckedEntries:
        """Return the entries."""
        return read_entries(self._timed("entries", self._memory.entries)[0])

    def num_bytes(self, num_entries: int) -> int | None:
        """Return the size that the memory reports; `None` if it reports none."""
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
        return int(Path("/proc/self/statm").read_bytes().split()[1]) * mmap.PAGESIZE
    except (OSError, IndexError, ValueError):
        return None


def main(socket_fd: int, life_fd: int, block_fd: int) -> None:
    """Serve requests on the inherited descriptors; see `evonav.agents.hosting.serving.main`."""
    serving.main(socket_fd, life_fd, block_fd, _MemoryServer().answer)


class _MemoryServer:
    """Makes a memory and calls it; an answer is a set of named parts, each already JSON: nothing of it is unpickled.

    Numbers of entries are the bytes of a float64 array in base64 within the JSON: a hundred times faster to write and
    to read than their digits, and the same bits.
    """

    def __init__(self) -> None:
        self._made: LocalMemory | None = None

    @property
    def memory(self) -> LocalMemory:
        """The memory that was made."""
        assert self._made is not None, "`make` comes first"
        return self._made

    def answer(self, operation: str, arguments: tuple[Any, ...]) -> dict[str, bytes]:
        """Execute a request; the answer to one that raises is a failure."""
        try:
            parts = getattr(self, f"do_{operation}")(*arguments)
        except MemoryFailedError as error:
            parts = {"memory_failure": {"kind": error.kind, "message": str(error)}}
        except Exception as error:
            message = f"{operation}: {describe(error, caller=PACKAGE)}"
            parts = {"memory_failure": {"kind": "raised", "message": message}}
        return {name: json.dumps(part).encode("ascii", "backslashreplace") for name, part in parts.items()}

    def do_load(self, _name: str, _memory_mb: None) -> dict[str, Any]:
        """Do nothing: `make` imports the memory."""
        return {}

    def do_make(self, path: str, keywords: Mapping[str, Any]) -> dict[str, Any]:
        """Import the factory and make the memory."""
        component: Component[Memory] = Component(path, keywords)
        self._made = LocalMemory(component.create)
        return {"can_locate": self._made.can_locate}

    def do_call(self, name: str, argument: object) -> dict[str, Any]:
        """Call `reset`, `visit` or `observe`."""
        return {"cost": asdict(self.memory.call(name, argument)), "rss_bytes": resident_bytes()}

    def do_entries(self) -> dict[str, Any]:
        """Return the entries."""
        entries = self.memory.entries()
        ids, numbers = (base64.b64encode(column.tobytes()).decode() for column in (entries.ids, entries.numbers))
        return {"entries": {"ids": ids, "numbers": numbers, "labels": entries.labels}}

    def do_num_bytes(self, num_entries: int) -> dict[str, Any]:
        """Return the size that the memory reports, and the peak of this process in MB."""
        return {"num_bytes": self.memory.num_bytes(num_entries), "peak_mb": serving.peak_memory_mb()}

    def do_locate(self, text: str, k: int) -> dict[str, Any]:
        """Ask where something is."""
        places, cost = self.memory.locate(text, k)
        return {"places": [(place.position_m, place.score) for place in places], "cost": asdict(cost)}
