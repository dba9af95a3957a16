"""Run jobs on workers that may die or hang: in this process, in processes of this machine, or on a Ray cluster.

A job and its answer are text: nothing that a worker sends is unpickled. The work is named, not sent, as
`module:factory`. `factory(settings, alive)` is called once in each worker and returns its `Work`, which turns a job's
text into the answer's text. A work that is a generator yields progress messages first. A job calls `alive()` to show
that it is still running. If a worker dies, another one repeats its job; if a job is silent for too long, its worker is
killed.
"""

import time
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Literal

from evonav.parallel.work import end_work, load_work, steps
from evonav.parallel.worker import START_TIMEOUT_S, EngineError, Host, Worker, WorkerLostError, Workforce

FailureKind = Literal["crash", "timeout", "error"]

MAX_LOSSES = 2
"""Default number of workers that a job may lose before it fails."""
MAX_FAILED_STARTS = 5
"""Failed starts in a row after which no worker is started; if none is running, the pool fails."""


@dataclass(frozen=True, slots=True)
class Job:
    """One unit of work."""

    key: int
    """Chosen by the caller; answers carry it."""
    text: str
    timeout_s: float | None = None
    """Longest silence before the job is abandoned; default: the pool's."""


@dataclass(frozen=True, slots=True)
class Answer:
    """A message of a job: progress, its result, or its failure."""

    key: int
    text: str = ""
    is_end: bool = True
    """False for progress, true for a result or a failure."""
    failure: FailureKind | None = None
    detail: str = ""
    """A traceback or one line, if the job failed."""


class Pool(ABC):
    """Runs jobs in any order; used in a `with` statement, at whose end all workers end at once."""

    capacity: int
    """Number of jobs that may be open at once."""

    @abstractmethod
    def submit(self, job: Job) -> None:
        """Accept a job, and start it if a worker is free."""

    @abstractmethod
    def next_answer(self) -> Answer:
        """Wait for the next message of any job. Call only while a submitted job is open."""

    @abstractmethod
    def close(self) -> None:
        """End all workers at once."""

    def __enter__(self) -> "Pool":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_pool(
    work: str,
    settings: str,
    workforce: Workforce,
    *,
    timeout_s: float,
    max_losses: int = MAX_LOSSES,
) -> Pool:
    """Open a pool of workers, to be used in a `with` statement.

    Args:
        work: `module:factory`.
        settings: Text with which the factory is called.
        workforce: The workers.
        timeout_s: Longest silence of a job before it is abandoned.
        max_losses: Number of workers that a job may lose before it fails.

    Raises:
        EngineError: Ray is not installed or cannot be reached.
    """
    if workforce.engine == "ray":
        from evonav.parallel.ray import RayHost

        host = RayHost(work, settings, workforce)
        return WorkerPool(host, min(workforce.num_workers, host.max_workers), timeout_s, max_losses)
    if workforce.num_workers == 0:
        return InlinePool(work, settings)
    from evonav.parallel.local import ProcessHost

    return WorkerPool(ProcessHost(work, settings), workforce.num_workers, timeout_s, max_losses)


def answers(pool: Pool, jobs: Iterable[Job]) -> Iterator[Answer]:
    """Run jobs that send no progress, in any order, and yield their answers.

    Args:
        pool: The pool that runs them; it is kept busy.
        jobs: Taken one by one, as the pool has room.
    """
    left, num_open = iter(jobs), 0
    while True:
        for job in islice(left, max(0, pool.capacity - num_open)):
            pool.submit(job)
            num_open += 1
        if num_open == 0:
            return
        answer = pool.next_answer()
        num_open -= 1
        yield answer


class InlinePool(Pool):
    """Runs jobs in this process, one after the other: for debuggers and for short work."""

    capacity = 1

    def __init__(self, work: str, settings: str) -> None:
        """Load the work."""
        self._work = load_work(work, settings, lambda: None)
        self._key = 0
        self._job: Generator[tuple[str, str]] | None = None

    def submit(self, job: Job) -> None:
        """Accept a job."""
        self._key, self._job = job.key, steps(self._work, job.text)

    def next_answer(self) -> Answer:
        """Run the job until its next message."""
        assert self._job is not None, "`submit` comes first"
        kind, text = next(self._job)
        return _answer(self._key, kind, text)

    def close(self) -> None:
        """End the job that is running."""
        if self._job is not None:
            self._job.close()
        end_work(self._work)


class _Slot:
    """A worker and the job that it runs."""

    def __init__(self, worker: Worker) -> None:
        self.worker = worker
        self.is_ready = False
        self.job: Job | None = None
        self.since_s = time.monotonic()

    @property
    def is_idle(self) -> bool:
        return self.is_ready and self.job is None


class WorkerPool(Pool):
    """Runs jobs on workers, one at a time on each."""

    def __init__(self, host: Host, num_workers: int, timeout_s: float, max_losses: int) -> None:
        """Prepare a pool; workers start with the first jobs."""
        self.capacity = 2 * num_workers  # one running and one waiting, so that no worker waits
        self._host = host
        self._num_workers = num_workers
        self._timeout_s = timeout_s
        self._max_losses = max_losses
        self._queue: deque[Job] = deque()
        self._answers: deque[Answer] = deque()
        self._slots: list[_Slot] = []
        self._losses: Counter[int] = Counter()
        self._num_failed_starts = 0

    def submit(self, job: Job) -> None:
        """Accept a job, and start it if a worker is free."""
        self._queue.append(job)
        self._assign()

    def next_answer(self) -> Answer:
        """Wait for the next message of any job."""
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

    @property
    def _has_ready(self) -> bool:
        return any(slot.is_ready for slot in self._slots)

    def _limit_s(self, slot: _Slot) -> float:
        if slot.job is None:
            return START_TIMEOUT_S
        return self._timeout_s if slot.job.timeout_s is None else slot.job.timeout_s

    def _assign(self) -> None:
        idle = [slot for slot in self._slots if slot.is_idle]
        for slot in idle[: len(self._queue)]:
            slot.job, slot.since_s = self._queue.popleft(), time.monotonic()
            slot.worker.send(slot.job.text)
        num_starting = sum(not slot.is_ready for slot in self._slots)
        num_missing = min(len(self._queue) - num_starting, self._num_workers - len(self._slots))
        if self._num_failed_starts >= MAX_FAILED_STARTS and self._has_ready:
            return
        self._slots += [_Slot(self._host.start()) for _ in range(num_missing)]

    def _receive(self, slot: _Slot) -> None:
        try:
            kind, text = slot.worker.receive()
        except WorkerLostError as error:
            self._lose(slot, str(error))
            return
        slot.since_s = time.monotonic()
        if kind == "broken":
            raise EngineError(f"workers do not start: {text.strip().splitlines()[-1]}")
        if kind == "ready":
            slot.is_ready = True
            self._num_failed_starts = 0
        elif slot.job is not None and kind != "alive":
            answer = _answer(slot.job.key, kind, text)
            self._answers.append(answer)
            if answer.is_end:
                self._num_failed_starts = 0
                self._losses.pop(answer.key, None)
                slot.job = None

    def _lose(self, slot: _Slot, message: str) -> None:
        self._close(slot)
        if not slot.is_ready:
            self._num_failed_starts += 1
            if self._num_failed_starts >= MAX_FAILED_STARTS and not self._has_ready:
                raise EngineError(f"workers do not start: {message}")
        if slot.job is None:
            return
        self._losses[slot.job.key] += 1
        if self._losses[slot.job.key] <= self._max_losses:
            self._queue.appendleft(slot.job)
        else:
            del self._losses[slot.job.key]
            self._answers.append(Answer(slot.job.key, failure="crash", detail=message))

    def _give_up(self, slot: _Slot) -> None:
        self._close(slot)
        if slot.job is None:
            raise EngineError(f"a worker was not ready within {START_TIMEOUT_S:g} s")
        detail = f"not done within {self._limit_s(slot):g} s"
        self._answers.append(Answer(slot.job.key, failure="timeout", detail=detail))

    def _close(self, slot: _Slot) -> None:
        slot.worker.close()
        self._slots.remove(slot)

    def close(self) -> None:
        """End all workers at once."""
        for slot in list(self._slots):
            self._close(slot)
        self._host.close()


def _answer(key: int, kind: str, text: str) -> Answer:
    if kind == "error":
        return Answer(key, failure="error", detail=text)
    return Answer(key, text, is_end=kind == "done")
