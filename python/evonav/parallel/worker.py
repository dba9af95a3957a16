"""Describe workers and the hosts that start them, for `evonav.parallel.pool`, and run the jobs of a worker."""

import gc
import os
import threading
import time
import traceback
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

from evonav.component import import_callable
from evonav.errors import EvonavError, InvalidArgumentError
from evonav.parallel import profiling

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
    num_gpus: float = 0.0
    """GPUs that Ray reserves for each worker; may be a fraction of one."""
    jobs_at_once: int = 1
    """Number of jobs that a worker runs at once, on threads; for work that waits and that threads may share."""

    def __post_init__(self) -> None:
        """Check the fields.

        Raises:
            InvalidArgumentError: There are too few workers, jobs or GPUs, or an address is given without Ray.
        """
        if self.num_workers < (1 if self.engine == "ray" else 0):
            raise InvalidArgumentError(f"num_workers = {self.num_workers}: too few for engine {self.engine}")
        if self.ray_address is not None and self.engine != "ray":
            raise InvalidArgumentError(f"a Ray address is for engine ray, not {self.engine}")
        if not self.num_gpus >= 0.0:
            raise InvalidArgumentError(f"num_gpus = {self.num_gpus}: must be 0 or more")
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


# The side of the worker


Work = Callable[[str], str | Generator[str, None, str]]
"""Turns the text of a job into its answer. It may have a method `close`, which is called when its worker ends."""

HEARTBEAT_S = 5.0
"""Shortest time between two heartbeats of a worker."""


def end_work(work: Work) -> None:
    """Call the work's `close`, if it has one."""
    close = getattr(work, "close", None)
    if close is not None:
        close()


def steps(work: Work, text: str) -> Generator[tuple[str, str]]:
    """Run a job and yield its messages: progress, then its answer or the traceback of its exception."""
    try:
        result = work(text)
        if isinstance(result, str):
            answer = result
        else:
            with closing(result):
                try:
                    while True:
                        yield "progress", next(result)
                except StopIteration as end:
                    answer = end.value
    except Exception:
        yield "error", traceback.format_exc()
    else:
        yield "done", answer


class Heartbeat(threading.local):
    """A worker's `alive`: for the job of each thread, sends at most one heartbeat every `HEARTBEAT_S`."""

    def __init__(self, send: Callable[[Message], None]) -> None:
        self._send = send
        self.key: int | None = None
        """Key of the job that this thread runs."""
        self._last_s = time.monotonic()

    def __call__(self) -> None:
        """Send a heartbeat, if it is time."""
        if self.key is not None and time.monotonic() - self._last_s >= HEARTBEAT_S:
            self._last_s = time.monotonic()
            self._send(Message("alive", self.key))


def serve(
    work_name: str,
    settings: str,
    jobs: Iterator[tuple[int, str]],
    send: Callable[[Message], None],
    *,
    has_threads: bool = False,
) -> None:
    """Be a worker: load the work, run all jobs, and send their messages.

    Args:
        has_threads: Run each job on a thread of its own, as it comes. Otherwise the next one is taken when the one
            before has ended.
    """
    lock = threading.Lock()

    def send_whole(message: Message) -> None:
        with lock:
            send(message)

    alive = Heartbeat(send_whole)
    gc.disable()  # imports leave hardly any garbage, and looking for it takes a tenth of their time
    try:
        work = import_callable(work_name)(settings, alive)
    except Exception:
        send(Message("broken", text=traceback.format_exc()))
        return
    look_rarely_for_garbage()
    gc.enable()

    def run(key: int, text: str) -> None:
        alive.key = key
        for kind, message in steps(work, text):
            if kind != "progress":
                profiling.save()  # after its last job, a worker is ended at once
            send_whole(Message(kind, key, message))

    try:
        send(Message("ready"))
        with profiling.sampled("workers"):
            for key, text in jobs:
                if has_threads:
                    threading.Thread(target=_run_or_end, args=(run, key, text), daemon=True).start()
                else:
                    run(key, text)
    finally:
        try:
            end_work(work)
        except SystemExit:  # the parent's signal came in the middle of it, or before its first line
            end_work(work)
            raise


def look_rarely_for_garbage() -> None:
    """Look for garbage rarely, and never among what exists: it took a hundredth of the time of episodes."""
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


def _run_or_end(run: Callable[[int, str], None], key: int, text: str) -> None:
    """Run a job on a thread; what ends a process that runs one job at a time ends this one, too."""
    try:
        run(key, text)
    except OSError:  # the parent has closed the connection, and ends this process
        pass
    except SystemExit as error:
        os._exit(error.code if isinstance(error.code, int) else 1)
    except BaseException:
        traceback.print_exc()
        os._exit(1)
