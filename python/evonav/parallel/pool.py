"""Run jobs on workers that may die or hang: in this process, in processes of this machine, or on a Ray cluster.

A job and its answer are text: nothing that a worker sends is unpickled. The work is named, not sent, as
`module:factory`. `factory(settings, alive)` is called once in each worker and returns its `Work`, which turns a job's
text into the answer's text. A work that is a generator yields progress messages first. A job calls `alive()` to show
that it is still running. If a worker dies, another one repeats its job; if a job is silent for too long, its worker is
killed.

A worker may run several jobs at once (`Workforce.jobs_at_once`). If it is lost, nobody knows which of them was the
cause: their answers say that it was shared, and a job that `is_alone` shares its worker with no other.
"""

import math
import time
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Literal

from evonav.parallel.work import end_work, load_work, steps
from evonav.parallel.worker import START_TIMEOUT_S, EngineError, Host, Message, Worker, WorkerLostError, Workforce

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
    is_alone: bool = False
    """Run it on a worker that runs no other job meanwhile."""


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
    is_shared: bool = False
    """True if the worker that was lost ran other jobs, too."""
    is_displaced: bool = False
    """True if it did not fail: its worker was ended because another job there was silent for too long."""


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
    prelude: str = "",
) -> Pool:
    """Open a pool of workers, to be used in a `with` statement.

    Args:
        work: `module:factory`.
        timeout_s: Longest silence of a job before it is abandoned.
        max_losses: Number of workers that a job may lose before it fails.

    Raises:
        EngineError: Ray is not installed or cannot be reached.
    """
    if workforce.engine == "ray":
        from evonav.parallel.ray import RayHost

        host = RayHost(work, settings, workforce)
        num_workers = min(workforce.num_workers, host.max_workers)
        return WorkerPool(host, num_workers, timeout_s, max_losses, workforce.jobs_at_once)
    if workforce.num_workers == 0:
        return InlinePool(work, settings)
    from evonav.parallel.local import ProcessHost, Program

    local_host = ProcessHost(Program(work, prelude), settings, has_threads=workforce.jobs_at_once > 1)
    return WorkerPool(local_host, workforce.num_workers, timeout_s, max_losses, workforce.jobs_at_once)


def answers(pool: Pool, jobs: Iterable[Job]) -> Iterator[Answer]:
    """Run jobs that send no progress, in any order, and yield their answers.

    Args:
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
        return _answer(Message(kind, self._key, text))

    def close(self) -> None:
        """End the job that is running."""
        if self._job is not None:
            self._job.close()
        end_work(self._work)


@dataclass(slots=True)
class _Running:
    """A job that a worker runs."""

    job: Job
    heard_s: float
    """Time of its last message."""


class _Slot:
    """A worker and the jobs that it runs."""

    def __init__(self, worker: Worker) -> None:
        self.worker = worker
        self.is_ready = False
        self.running: dict[int, _Running] = {}
        self.began_s = time.monotonic()

    @property
    def is_idle(self) -> bool:
        return self.is_ready and not self.running

    @property
    def is_lent_whole(self) -> bool:
        return any(one.job.is_alone for one in self.running.values())


class WorkerPool(Pool):
    """Runs jobs on workers, one or several at a time on each."""

    def __init__(self, host: Host, num_workers: int, timeout_s: float, max_losses: int, jobs_at_once: int = 1) -> None:
        """Prepare a pool; workers start with the first jobs."""
        self.capacity = num_workers * (jobs_at_once + 1)  # one of each is waiting, so that no worker waits
        self._host = host
        self._num_workers = num_workers
        self._jobs_at_once = jobs_at_once
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
            left_s = min(self._deadline_s(slot) for slot in busy) - time.monotonic()
            ready = self._host.wait([slot.worker for slot in busy], max(0.0, left_s))
            for slot in busy:
                if slot.worker in ready:
                    self._receive(slot)
                elif time.monotonic() >= self._deadline_s(slot):
                    self._give_up(slot)
        self._assign()
        return self._answers.popleft()

    @property
    def _has_ready(self) -> bool:
        return any(slot.is_ready for slot in self._slots)

    def _limit_s(self, job: Job) -> float:
        return self._timeout_s if job.timeout_s is None else job.timeout_s

    def _deadline_s(self, slot: _Slot) -> float:
        """Return when a worker is given up."""
        if not slot.is_ready:
            return slot.began_s + START_TIMEOUT_S
        return min(one.heard_s + self._limit_s(one.job) for one in slot.running.values())

    def _assign(self) -> None:
        while self._queue and (slot := self._free_slot(self._queue[0])) is not None:
            job = self._queue.popleft()
            slot.running[job.key] = _Running(job, time.monotonic())
            slot.worker.send(job.key, job.text)
        num_starting = sum(not slot.is_ready for slot in self._slots)
        num_missing = min(len(self._queue) - num_starting, self._num_workers - len(self._slots))
        if self._num_failed_starts >= MAX_FAILED_STARTS and self._has_ready:
            return
        self._slots += [_Slot(self._host.start()) for _ in range(num_missing)]

    def _free_slot(self, job: Job) -> _Slot | None:
        """Return the worker for the next job: the one with the fewest, which leaves the others their share."""
        num_open = len(self._queue) + sum(len(slot.running) for slot in self._slots)
        share = math.ceil(num_open / max(1, self._num_slots))
        most = 1 if job.is_alone else max(1, min(self._jobs_at_once, share))
        free = [slot for slot in self._slots if slot.is_ready and len(slot.running) < most and not slot.is_lent_whole]
        return min(free, key=lambda slot: len(slot.running), default=None)

    @property
    def _num_slots(self) -> int:
        """Number of workers that share the jobs: those that run, and those that may still be started."""
        if self._num_failed_starts >= MAX_FAILED_STARTS:
            return sum(slot.is_ready for slot in self._slots)
        return self._num_workers

    def _receive(self, slot: _Slot) -> None:
        try:
            message = slot.worker.receive()
        except WorkerLostError as error:
            self._lose(slot, str(error))
            return
        if message.kind == "broken":
            raise EngineError(f"workers do not start: {message.text.strip().splitlines()[-1]}")
        if message.kind == "ready":
            slot.is_ready = True
            self._num_failed_starts = 0
            return
        running = slot.running.get(message.key)
        if running is None:
            return
        running.heard_s = time.monotonic()
        if message.kind != "alive":
            answer = _answer(message)
            self._answers.append(answer)
            if answer.is_end:
                self._num_failed_starts = 0
                self._losses.pop(answer.key, None)
                del slot.running[message.key]

    def _lose(self, slot: _Slot, message: str) -> None:
        self._close(slot)
        if not slot.is_ready:
            self._num_failed_starts += 1
            if self._num_failed_starts >= MAX_FAILED_STARTS and not self._has_ready:
                raise EngineError(f"workers do not start: {message}")
        for key, running in reversed(slot.running.items()):
            self._losses[key] += 1
            if self._losses[key] <= self._max_losses:
                self._queue.appendleft(running.job)
            else:
                del self._losses[key]
                is_shared = len(slot.running) > 1
                self._answers.append(Answer(key, failure="crash", detail=message, is_shared=is_shared))

    def _give_up(self, slot: _Slot) -> None:
        """End a worker with a job that was silent for too long."""
        self._close(slot)
        if not slot.is_ready:
            raise EngineError(f"a worker was not ready within {START_TIMEOUT_S:g} s")
        now_s, is_shared = time.monotonic(), len(slot.running) > 1
        for key, running in reversed(slot.running.items()):
            limit_s = self._limit_s(running.job)
            is_silent = now_s - running.heard_s >= limit_s
            if is_silent:
                detail = f"not done within {limit_s:g} s"
                self._answers.append(Answer(key, failure="timeout", detail=detail, is_shared=is_shared))
            else:
                self._answers.append(Answer(key, is_shared=is_shared, is_displaced=True))

    def _close(self, slot: _Slot) -> None:
        slot.worker.close()
        self._slots.remove(slot)

    def close(self) -> None:
        """End all workers at once."""
        for slot in list(self._slots):
            self._close(slot)
        self._host.close()


def _answer(message: Message) -> Answer:
    if message.kind == "error":
        return Answer(message.key, failure="error", detail=message.text)
    return Answer(message.key, message.text, is_end=message.kind == "done")
