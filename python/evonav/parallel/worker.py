"""Describe workers and the hosts that start them, for `evonav.parallel.pool`."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from evonav.errors import EvonavError

START_TIMEOUT_S = 300.0
"""Longest time until a worker is ready."""


class EngineError(EvonavError):
    """Workers do not start, or a library that starts them is not installed."""


@dataclass(frozen=True, slots=True)
class Resources:
    """Resources that a Ray cluster reserves for each worker."""

    num_cpus: float = 1.0
    num_gpus: float = 0.0
    """May be a fraction of a GPU."""


class WorkerLostError(EngineError):
    """A worker ended by itself."""


class Worker(Protocol):
    """The pool's side of a worker, which sends `ready` once and then the messages of its jobs."""

    def send(self, text: str) -> None:
        """Send a job; if the worker is lost, `receive` raises."""

    def receive(self) -> tuple[str, str]:
        """Return the next message; call only when there is one.

        Returns:
            `("ready", "")`; during a job `("alive", "")` and `("progress", text)`, and at its end `("done", answer)` or
            `("error", traceback)`; `("broken", traceback)` if the factory failed.

        Raises:
            WorkerLostError: The worker ended.
        """

    def close(self) -> None:
        """End the worker at once; safe to call twice."""


class Host(Protocol):
    """Starts workers."""

    def start(self) -> Worker:
        """Start another worker."""

    def wait(self, workers: Sequence[Worker], timeout_s: float) -> Sequence[Worker]:
        """Wait until a worker has a message, and return all that have one."""

    def close(self) -> None:
        """Release the host, after all workers are closed."""
