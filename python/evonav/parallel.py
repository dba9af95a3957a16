"""Jobs on workers that may die or hang: in this process, in processes of this machine, or on a Ray cluster.

A job is a text and so is its answer: nothing that a worker sends is unpickled. What workers do is named, not sent:
`module:factory`, where `factory(settings)` is called once a worker and gives the function from a job's text to its
answer's. A worker that dies has its job tried again by another, a job that takes too long ends its worker.
"""

import importlib
import multiprocessing
import os
import signal
import threading
import time
import traceback
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from types import TracebackType
from typing import Literal, Protocol

from evonav.errors import EvonavError, InvalidArgumentError

EngineName = Literal["local", "ray"]
FailureKind = Literal["crash", "timeout", "error"]

MAX_LOSSES = 2
"""Workers that a job may lose before it is given up."""
MAX_FAILED_STARTS = 10
"""Workers in a row that may die before they are ready."""
START_TIMEOUT_S = 300.0
"""For a worker to be ready."""


class EngineError(EvonavError):
    """Workers cannot be had: they do not start, or what starts them is not installed."""


@dataclass(frozen=True, slots=True)
class Job:
    """Something to do."""

    key: int
    """The caller's."""
    text: str


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of a job: a text or a failure."""

    key: int
    text: str = ""
    failure: FailureKind | None = None
    detail: str = ""
    """Of a failure: a traceback, or one line."""


class Pool(Protocol):
    """Where jobs are done, in any order."""

    capacity: int
    """Jobs that it takes before an answer must be fetched."""

    def submit(self, job: Job) -> None:
        """Takes a job."""

    def next_answer(self) -> Answer:
        """Waits for the answer of some job. Call only while a submitted job is unanswered."""

    def __enter__(self) -> "Pool":
        """Nothing."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None, /
    ) -> None:
        """Ends all workers at once."""


def open_pool(
    work: str,
    settings: str,
    *,
    engine: EngineName = "local",
    num_workers: int,
    timeout_s: float,
    ray_address: str | None = None,
) -> Pool:
    """Workers, to be used in a `with` statement.

    Args:
        work: `module:factory`.
        settings: What the factory is called with.
        engine: Processes of this machine, or Ray actors.
        num_workers: 0 works in this process (engine `local` only), where nothing is contained but exceptions.
        timeout_s: After which a job is given up.
        ray_address: Of a cluster; default: one on this machine.

    Raises:
        EngineError: Ray is not installed or not to be reached.
        InvalidArgumentError: Of the arguments.
    """
    if num_workers < (1 if engine == "ray" else 0):
        raise InvalidArgumentError(f"num_workers = {num_workers}: too few for engine {engine}")
    if ray_address is not None and engine != "ray":
        raise InvalidArgumentError(f"a Ray address is for engine ray, not {engine}")
    if engine == "ray":
        from evonav.parallel_ray import RayHost

        host = RayHost(work, settings, num_workers, ray_address)
        return WorkerPool(host, min(num_workers, host.max_workers), timeout_s)
    if num_workers == 0:
        return InlinePool(work, settings)
    return WorkerPool(ProcessHost(work, settings), num_workers, timeout_s)


class WorkerLostError(EngineError):
    """A worker ended by itself."""


class Worker(Protocol):
    """The pool's side of a worker. It says `ready` once, and then one thing a job."""

    def send(self, text: str) -> None:
        """Gives it a job; the loss of the worker shows in `receive`."""

    def receive(self) -> tuple[str, str]:
        """`("ready", "")`, `("done", answer)` or `("error", traceback)`; there is something to receive.

        Raises:
            WorkerLostError: There will be no more.
        """

    def close(self) -> None:
        """Ends it at once; safe to call twice."""


class Host(Protocol):
    """What starts workers."""

    def start(self) -> Worker:
        """Another worker."""

    def wait(self, workers: Sequence[Worker], timeout_s: float) -> Sequence[Worker]:
        """Those with something to receive, as soon as there is one."""

    def close(self) -> None:
        """After all workers were closed."""


class InlinePool:
    """Jobs in this process, one after the other: for debuggers and for short work."""

    capacity = 1

    def __init__(self, work: str, settings: str) -> None:
        """Makes what does the jobs."""
        self._function = load_work(work, settings)
        self._queue: deque[Job] = deque()

    def submit(self, job: Job) -> None:
        """Takes a job."""
        self._queue.append(job)

    def next_answer(self) -> Answer:
        """Does the oldest job."""
        job = self._queue.popleft()
        kind, text = do(self._function, job.text)
        return Answer(job.key, text) if kind == "done" else Answer(job.key, failure="error", detail=text)

    def __enter__(self) -> "InlinePool":
        """Nothing."""
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing."""


class _Slot:
    """A worker and what it is at."""

    def __init__(self, worker: Worker) -> None:
        self.worker = worker
        self.is_ready = False
        self.job: Job | None = None
        self.since_s = time.monotonic()

    @property
    def is_idle(self) -> bool:
        return self.is_ready and self.job is None


class WorkerPool:
    """Jobs on workers, each of which has one at a time."""

    def __init__(self, host: Host, num_workers: int, timeout_s: float) -> None:
        """Starts nothing yet."""
        self.capacity = 2 * num_workers  # one at work and one waiting, so that no worker ever does
        self._host = host
        self._num_workers = num_workers
        self._timeout_s = timeout_s
        self._queue: deque[Job] = deque()
        self._answers: deque[Answer] = deque()
        self._slots: list[_Slot] = []
        self._losses: Counter[int] = Counter()
        self._num_failed_starts = 0

    def submit(self, job: Job) -> None:
        """Takes a job, and has it begun if a worker is free."""
        self._queue.append(job)
        self._assign()

    def next_answer(self) -> Answer:
        """Waits for the answer of some job."""
        while not self._answers:
            self._assign()
            busy = [slot for slot in self._slots if not slot.is_idle]
            now_s = time.monotonic()
            left_s = min(slot.since_s + self._limit_s(slot) - now_s for slot in busy)
            ready = self._host.wait([slot.worker for slot in busy], max(0.0, left_s))
            for slot in busy:
                if slot.worker in ready:
                    self._receive(slot)
                elif time.monotonic() - slot.since_s >= self._limit_s(slot):
                    self._give_up(slot)
        self._assign()
        return self._answers.popleft()

    def _limit_s(self, slot: _Slot) -> float:
        return self._timeout_s if slot.is_ready else START_TIMEOUT_S

    def _assign(self) -> None:
        idle = [slot for slot in self._slots if slot.is_idle]
        for slot in idle[: len(self._queue)]:
            slot.job, slot.since_s = self._queue.popleft(), time.monotonic()
            slot.worker.send(slot.job.text)
        num_starting = sum(not slot.is_ready for slot in self._slots)
        num_missing = min(len(self._queue) - num_starting, self._num_workers - len(self._slots))
        self._slots += [_Slot(self._host.start()) for _ in range(num_missing)]

    def _receive(self, slot: _Slot) -> None:
        try:
            kind, text = slot.worker.receive()
        except WorkerLostError as error:
            self._lose(slot, str(error))
            return
        if kind == "ready":
            slot.is_ready = True
            self._num_failed_starts = 0
        elif slot.job is not None:
            key, slot.job = slot.job.key, None
            self._answers.append(Answer(key, text) if kind == "done" else Answer(key, failure="error", detail=text))

    def _lose(self, slot: _Slot, message: str) -> None:
        self._close(slot)
        if not slot.is_ready:
            self._num_failed_starts += 1
            if self._num_failed_starts >= MAX_FAILED_STARTS:
                raise EngineError(f"workers do not start: {message}")
        if slot.job is None:
            return
        self._losses[slot.job.key] += 1
        if self._losses[slot.job.key] <= MAX_LOSSES:
            self._queue.appendleft(slot.job)
        else:
            self._answers.append(Answer(slot.job.key, failure="crash", detail=message))

    def _give_up(self, slot: _Slot) -> None:
        self._close(slot)
        if slot.job is None:
            raise EngineError(f"a worker was not ready within {START_TIMEOUT_S:g} s")
        detail = f"not done within {self._timeout_s:g} s"
        self._answers.append(Answer(slot.job.key, failure="timeout", detail=detail))

    def _close(self, slot: _Slot) -> None:
        slot.worker.close()
        self._slots.remove(slot)

    def __enter__(self) -> "WorkerPool":
        """Nothing."""
        return self

    def __exit__(self, *_: object) -> None:
        """Ends all workers at once."""
        for slot in list(self._slots):
            self._close(slot)
        self._host.close()


def load_work(work: str, settings: str) -> Callable[[str], str]:
    """What a worker does."""
    module, _, factory = work.partition(":")
    function: Callable[[str], str] = getattr(importlib.import_module(module), factory)(settings)
    return function


def do(function: Callable[[str], str], text: str) -> tuple[str, str]:
    """A job's answer, or the traceback of what it raised."""
    try:
        return "done", function(text)
    except Exception:
        return "error", traceback.format_exc()


class ProcessHost:
    """Processes of this machine."""

    def __init__(self, work: str, settings: str) -> None:
        """Starts nothing yet."""
        self._work, self._settings = work, settings

    def start(self) -> "WorkerProcess":
        """Another process."""
        return WorkerProcess(self._work, self._settings)

    def wait(self, workers: Sequence[Worker], timeout_s: float) -> Sequence[Worker]:
        """Those with something to receive."""
        connections = {worker.connection: worker for worker in workers if isinstance(worker, WorkerProcess)}
        return [connections[ready] for ready in wait(list(connections), timeout_s) if isinstance(ready, Connection)]

    def close(self) -> None:
        """Nothing is left."""


class WorkerProcess:
    """A process that works until its parent hangs up or dies."""

    def __init__(self, work: str, settings: str) -> None:
        """Starts it."""
        context = multiprocessing.get_context("spawn")
        self.connection, far_end = context.Pipe()
        with one_thread_each():
            self._process = context.Process(target=_serve, args=(far_end, work, settings), daemon=True)
            self._process.start()
        far_end.close()

    def send(self, text: str) -> None:
        """Gives it a job."""
        with suppress(BrokenPipeError):
            self.connection.send_bytes(text.encode())

    def receive(self) -> tuple[str, str]:
        """What it says next."""
        try:
            kind, _, text = self.connection.recv_bytes().decode().partition(" ")
        except (EOFError, OSError):
            raise WorkerLostError(f"the worker process died ({cause_of_death(self._process)})") from None
        return kind, text

    def close(self) -> None:
        """Ends it at once."""
        end_process(self._process, self.connection)


def _serve(connection: Connection, work: str, settings: str) -> None:
    """A worker's life: jobs in, answers out."""
    end_with_parent()
    with suppress(EOFError, OSError):  # of the connection: the parent hung up
        function = load_work(work, settings)
        connection.send_bytes(b"ready ")
        while True:
            kind, text = do(function, connection.recv_bytes().decode())
            connection.send_bytes(f"{kind} {text}".encode())


def end_with_parent() -> None:
    """Makes a child leave interrupts to its parent, and end with it by way of every `finally`."""

    def end(number: int, _: object) -> None:
        raise SystemExit(128 + number)

    def watch() -> None:
        parent = multiprocessing.parent_process()
        if parent is not None:
            parent.join()
            os.kill(os.getpid(), signal.SIGTERM)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, end)
    threading.Thread(target=watch, daemon=True).start()


def cause_of_death(process: multiprocessing.process.BaseProcess) -> str:
    """How a process ended that has hung up."""
    process.join(timeout=5.0)
    code = process.exitcode
    return f"killed by signal {-code}" if code is not None and code < 0 else f"exit code {code}"


def end_process(process: multiprocessing.process.BaseProcess, connection: Connection) -> None:
    """Hangs up on a child and ends it; safe to call twice."""
    connection.close()
    if process.is_alive():
        process.terminate()
        process.join(timeout=2.0)
        if process.is_alive():
            process.kill()
    process.join(timeout=5.0)


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Gives children that are started inside one thread each: the parallelism is over jobs."""
    names = ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
    added = [name for name in names if name not in os.environ]
    os.environ.update(dict.fromkeys(added, "1"))
    try:
        yield
    finally:
        for name in added:
            del os.environ[name]
