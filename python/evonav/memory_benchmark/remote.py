"""Run a memory in a process of its own: a crash, a hang or a leak costs only itself.

Frames go to it through one block of shared memory, and JSON comes back; it is the process that agents have
(`evonav.evaluation.hosting.process`), with another server in it.
"""

import base64
import json
from typing import Any

import numpy as np

from evonav.component import Component
from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.hosting.process import AgentFailedError, AgentProcess
from evonav.evaluation.records.schema import ErrorKind
from evonav.memory_benchmark.answers import (
    MAX_ENTRIES,
    NUM_COLUMNS,
    CheckedEntries,
    FailureKind,
    Hosting,
    MemoryFailedError,
    checked,
)
from evonav.memory_benchmark.local import Cost, HostedMemory
from evonav.memory_benchmark.protocol import FoundPlace, Memory

_KINDS: dict[ErrorKind, FailureKind] = {ErrorKind.TIMEOUT: "hung", ErrorKind.CRASH: "died"}


class _MemoryProcess(AgentProcess):
    """A process with a memory in it."""

    noun = "memory"
    serving = "evonav.memory_benchmark.local"
    max_answer_bytes = 400 * MAX_ENTRIES


class RemoteMemory(HostedMemory):
    """A memory in a process of its own; its answers were checked there and are read as plain data."""

    hosting: Hosting = "process"

    def __init__(self, memory: Component[Memory], *, timeout_s: float) -> None:
        """Start the process and make the memory in it.

        Args:
            memory: Import path and keyword arguments of its factory.
            timeout_s: Time limit of a call.

        Raises:
            MemoryFailedError: It cannot be made.
        """
        try:
            self._process = _MemoryProcess(memory.path, AgentHosting(timeout_s=timeout_s))
        except AgentFailedError as error:
            raise MemoryFailedError("load", str(error)) from None
        try:
            parts = self._ask("make", memory.path, memory.keywords)
        except MemoryFailedError as error:
            self.close()
            raise MemoryFailedError("load", str(error)) from None
        self.can_locate = bool(parts["can_locate"])

    def call(self, name: str, argument: object) -> Cost:
        """Call a method that answers nothing."""
        parts = self._ask("call", name, argument, shown=name)
        self.rss_bytes = parts["rss_bytes"]
        return Cost(**parts["cost"])

    def entries(self) -> CheckedEntries:
        """Return the entries."""
        parts = self._ask("entries")["entries"]
        try:
            ids = np.frombuffer(base64.b64decode(parts["ids"]), np.int64)
            numbers = np.frombuffer(base64.b64decode(parts["numbers"]), np.float64).reshape(-1, NUM_COLUMNS)
            entries = CheckedEntries(ids, tuple(map(str, parts["labels"])), numbers)
        except (KeyError, TypeError, ValueError) as error:
            raise MemoryFailedError("died", f"malformed response: entries: {error}") from None
        if not len(ids) == len(numbers) == len(entries.labels):
            raise MemoryFailedError("died", "malformed response: entries: columns of different lengths")
        return checked(entries)

    def num_bytes(self, num_entries: int) -> int | None:
        """Return the size that the memory reports; `None` if it reports none."""
        parts = self._ask("num_bytes", num_entries)
        if parts["peak_mb"] is not None:
            self.peak_rss_bytes = round(float(parts["peak_mb"]) * (1 << 20))
        return None if parts["num_bytes"] is None else int(parts["num_bytes"])

    def locate(self, text: str, k: int) -> tuple[list[FoundPlace], Cost]:
        """Ask where something is."""
        parts = self._ask("locate", text, k)
        return [FoundPlace(tuple(position_m), score) for position_m, score in parts["places"]], Cost(**parts["cost"])

    def close(self) -> None:
        """End the process."""
        self._process.close(is_at_once=True)

    def _ask(self, operation: str, *arguments: object, shown: str | None = None) -> dict[str, Any]:
        try:
            parts = {name: json.loads(part) for name, part in self._process.ask(operation, *arguments).items()}
        except AgentFailedError as error:
            message = str(error).replace(f"`{operation}`", f"`{shown or operation}`")
            raise MemoryFailedError(_KINDS.get(error.kind, "raised"), message) from None
        except ValueError as error:
            raise MemoryFailedError("died", f"malformed response: {error}") from None
        if (failure := parts.get("memory_failure")) is not None:
            raise MemoryFailedError(failure["kind"], failure["message"])
        return parts
