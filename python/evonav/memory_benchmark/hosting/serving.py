"""Serve a memory in a process of its own, and write its answers as JSON: nothing that it sends is unpickled.

Numbers of entries are the bytes of a float64 array in base64 within the JSON: a hundred times faster to write and to
read than their digits, and the same bits.
"""

import base64
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

from evonav.agents.hosting import serving
from evonav.agents.hosting.error_text import describe
from evonav.component import Component
from evonav.memory_benchmark.answers import MemoryFailedError
from evonav.memory_benchmark.hosting.local import PACKAGE, Cost, LocalMemory, resident_bytes
from evonav.memory_benchmark.protocol import Memory


def main(socket_fd: int, life_fd: int, block_fd: int) -> None:
    """Serve requests on the inherited descriptors; see `evonav.agents.hosting.serving.main`."""
    serving.main(socket_fd, life_fd, block_fd, _MemoryServer().answer)


class _MemoryServer:
    """Makes a memory and calls it; an answer is a set of named parts, each already JSON."""

    def __init__(self) -> None:
        self._memory: LocalMemory | None = None

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

    def do_load(self, _name: str, memory_mb: int | None) -> dict[str, Any]:
        """Limit the memory."""
        if memory_mb is not None:
            serving.limit_memory(memory_mb)
        return {}

    def do_make(self, path: str, keywords: Mapping[str, Any]) -> dict[str, Any]:
        """Import the factory and make the memory."""
        component: Component[Memory] = Component(path, keywords)
        self._memory = LocalMemory(component.create)
        return {"can_locate": self._memory.can_locate}

    def do_call(self, name: str, argument: object) -> dict[str, Any]:
        """Call `reset`, `visit` or `observe`."""
        function: Callable[[object], Cost] = getattr(self._made, name)
        return {"cost": asdict(function(argument)), "rss_bytes": resident_bytes()}

    def do_entries(self) -> dict[str, Any]:
        """Return the entries."""
        entries = self._made.entries()
        columns = {"ids": _text(entries.ids.tobytes()), "numbers": _text(entries.numbers.tobytes())}
        return {"entries": {**columns, "labels": entries.labels}}

    def do_num_bytes(self, num_entries: int) -> dict[str, Any]:
        """Return the size that the memory tells, and the peak of this process in MB."""
        return {"num_bytes": self._made.num_bytes(num_entries), "peak_mb": serving.peak_memory_mb()}

    def do_locate(self, text: str, k: int) -> dict[str, Any]:
        """Ask where something is."""
        places, cost = self._made.locate(text, k)
        return {"places": [(place.position_m, place.score) for place in places], "cost": asdict(cost)}

    @property
    def _made(self) -> LocalMemory:
        assert self._memory is not None, "`make` comes first"
        return self._memory


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
