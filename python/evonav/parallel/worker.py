"""Describe workers and the hosts that start them, for `evonav.parallel.pool`."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

from evonav.errors import EvonavError, InvalidArgumentError

EngineName = Literal["local", "ray"]

START_TIMEOUT_S = 300.0
"""Longest time until a worker is ready."""


class EngineError(EvonavError):
    """Workers do not start, or a library that starts them is not installed."""


@dataclass(frozen=True, slots=True)
class Workforce:
    """The workers of a run; they decide how long it takes, and nothing else."""

    num_workers: int = 0
    """Number of processes or actors. 0 runs jobs in this process, where a crash or a hang is not contained."""
    engine: EngineName = "local"
    """Processes of this machine, or actors of a Ray cluster."""
    ray_address: str | None = None
    """Address of a cluster; default: one on this machine."""
    num_cpus: float = 1.0
    """CPUs that Ray reserves for each worker."""
    num_gpus: float = 0.0
    """GPUs that Ray reserves for each worker; may be a fraction of one."""
    jobs_at_once: int = 1
    """Number of jobs that a worker runs at once, on threads; for work that waits and that threads may share."""

    def __post_init__(self) -> None:
        """Check the fields.

        Raises:
            InvalidArgumentError: There are too few workers or jobs, an address is given without Ray, or workers have no
                CPU.
        """
        if self.num_workers < (1 if self.engine == "ray" else 0):
            raise InvalidArgumentError(f"num_workers = {self.num_workers}: too few for engine {self.engine}")
        if self.ray_address is not None and self.engine != "ray":
            raise InvalidArgumentError(f"a Ray address is for engine ray, not {self.engine}")
        if not (self.num_cpus > 0.0 and self.num_gpus >= 0.0):
            raise InvalidArgumentError(f"{self}: a worker needs num_cpus > 0 and num_gpus >= 0")
        if self.jobs_at_once < 1 or (self.jobs_at_once > 1 and self.num_workers == 0):
            raise InvalidArgumentError(f"jobs_at_once = {self.jobs_at_once}: must be 1 or more, and 1 without workers")


class WorkerLostError(EngineError):
    """A worker ended by itself."""


class Message(NamedTuple):
    """A message of a worker."""

    kind: str
    """`ready`, or `broken` if the factory failed; of a job `alive` and `progress`, and at its end `done` or `error`."""
    key: int = 0
    """Key of the job."""
    text: str = ""
    """Progress, answer, or a traceback."""


class Worker(Protocol):
    """The pool's side of a worker, which sends `ready` once and then the messages of its jobs."""

    def send(self, key: int, text: str) -> None:
        """Send a job; if the worker is lost, `receive` raises."""

    def receive(self) -> Message:
        """Return the next message; call only when there is one.

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
