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
from collections import Counter, deque
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from itertools import islice
from typing import Literal, TypeAlias

from evonav.component import import_callable
from evonav.parallel.worker import (
    START_TIMEOUT_S,
    EngineError,
    Host,
    Message,
    Worker,
    WorkerLostError,
    Workforce,
    end_work,
    steps,
)

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


@contextmanager
def open_pool(
    work: str,
    settings: str,
    workforce: Workforce,
    *,
    timeout_s: float,
    max_losses: int = MAX_LOSSES,
    prelude: str = "",
) -> Iterator["Pool"]:
    """Lend a pool of workers, which end at once when the block ends.

    Args:
        work: `module:factory`.
        timeout_s: Longest silence of a job before it is abandoned.
        max_losses: Number of workers that a job may lose before it fails.

    Raises:
        EngineError: Ray is not installed or cannot be reached.
    """
    pool: Pool
    if workforce.engine == "ray":
        from evonav.parallel.ray import RayHost

        host = RayHost(work, settings, workforce)
        num_workers = min(workforce.num_workers, host.max_workers)
        pool = WorkerPool(host, num_workers, timeout_s, max_losses, workforce.jobs_at_once)
    elif workforce.num_workers == 0:
        pool = InlinePool(work, settings)
    else:
        from evonav.parallel.local import ProcessHost, WorkerProgram

        local_host = ProcessHost(WorkerProgram(work, prelude), settings, has_threads=workforce.jobs_at_once > 1)
        pool = WorkerPool(local_host, workforce.num_workers, timeout_s, max_losses, workforce.jobs_at_once)
    with closing(pool):
        yield pool


def answers(pool: "Pool", jobs: Iterable[Job]) -> Iterator[Answer]:
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


class InlinePool:
    """Runs jobs in this process, one after the other: for debuggers and for short work."""

    capacity = 1
    """Number of jobs that may be open at once."""

    def __init__(self, work: str, settings: str) -> None:
        self._work = import_callable(work)(settings, lambda: None)
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


@dataclass(slots=True, eq=False)
class _WorkerJobs:
    """A worker and the jobs that it runs, by their keys."""

    worker: Worker
    is_ready: bool = False
    jobs: dict[int, Job] = field(default_factory=dict)
    heard_s: dict[int, float] = field(default_factory=dict)
    """Time of each job's last message."""
    began_s: float = field(default_factory=time.monotonic)


class WorkerPool:
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
        self._slots: list[_WorkerJobs] = []
        self._losses: Counter[int] = Counter()
        self._num_failed_starts = 0

    def submit(self, job: Job) -> None:
        """Accept a job, and start it if a worker is free."""
        self._queue.append(job)
        self._assign()

    def next_answer(self) -> Answer:
        """Wait for the next message of any job. Call only while a submitted job is open."""
        while not self._answers:
            self._assign()
            busy = [slot for slot in self._slots if slot.jobs or not slot.is_ready]
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

    def _deadline_s(self, slot: _WorkerJobs) -> float:
        """Return when a worker is given up."""
        if not slot.is_ready:
            return slot.began_s + START_TIMEOUT_S
        return min(slot.heard_s[key] + self._limit_s(job) for key, job in slot.jobs.items())

    def _assign(self) -> None:
        while self._queue and (slot := self._free_slot(self._queue[0])) is not None:
            job = self._queue.popleft()
            slot.jobs[job.key], slot.heard_s[job.key] = job, time.monotonic()
            slot.worker.send(job.key, job.text)
        num_starting = sum(not slot.is_ready for slot in self._slots)
        num_missing = min(len(self._queue) - num_starting, self._num_workers - len(self._slots))
        if self._num_failed_starts >= MAX_FAILED_STARTS and self._has_ready:
            return
        self._slots += [_WorkerJobs(self._host.start()) for _ in range(num_missing)]

    def _free_slot(self, job: Job) -> _WorkerJobs | None:
        """Return the worker for the next job: the one with the fewest, which leaves the others their share."""
        are_all_started = self._num_failed_starts >= MAX_FAILED_STARTS
        num_slots = sum(slot.is_ready for slot in self._slots) if are_all_started else self._num_workers
        num_open = len(self._queue) + sum(len(slot.jobs) for slot in self._slots)
        share = math.ceil(num_open / max(1, num_slots))
        most = 1 if job.is_alone else max(1, min(self._jobs_at_once, share))
        free = [
            slot
            for slot in self._slots
            if slot.is_ready and len(slot.jobs) < most and not any(one.is_alone for one in slot.jobs.values())
        ]
        return min(free, key=lambda slot: len(slot.jobs), default=None)

    def _receive(self, slot: _WorkerJobs) -> None:
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
        if message.key not in slot.jobs:
            return
        slot.heard_s[message.key] = time.monotonic()
        if message.kind != "alive":
            answer = _answer(message)
            self._answers.append(answer)
            if answer.is_end:
                self._num_failed_starts = 0
                self._losses.pop(answer.key, None)
                del slot.jobs[message.key]

    def _lose(self, slot: _WorkerJobs, message: str) -> None:
        self._close(slot)
        if not slot.is_ready:
            self._num_failed_starts += 1
            if self._num_failed_starts >= MAX_FAILED_STARTS and not self._has_ready:
                raise EngineError(f"workers do not start: {message}")
        for key, job in reversed(slot.jobs.items()):
            self._losses[key] += 1
            if self._losses[key] <= self._max_losses:
                self._queue.appendleft(job)
            else:
                del self._losses[key]
                is_shared = len(slot.jobs) > 1
                self._answers.append(Answer(key, failure="crash", detail=message, is_shared=is_shared))

    def _give_up(self, slot: _WorkerJobs) -> None:
        """End a worker with a job that was silent for too long."""
        self._close(slot)
        if not slot.is_ready:
            raise EngineError(f"a worker was not ready within {START_TIMEOUT_S:g} s")
        now_s, is_shared = time.monotonic(), len(slot.jobs) > 1
        for key, job in reversed(slot.jobs.items()):
            limit_s = self._limit_s(job)
            if now_s - slot.heard_s[key] >= limit_s:
                detail = f"not done within {limit_s:g} s"
                self._answers.append(Answer(key, failure="timeout", detail=detail, is_shared=is_shared))
            else:
                self._answers.append(Answer(key, is_shared=is_shared, is_displaced=True))

    def _close(self, slot: _WorkerJobs) -> None:
        slot.worker.close()
        self._slots.remove(slot)

    def close(self) -> None:
        """End all workers at once."""
        for slot in list(self._slots):
            self._close(slot)
        self._host.close()


Pool: TypeAlias = InlinePool | WorkerPool
"""Runs jobs in any order."""


def _answer(message: Message) -> Answer:
    if message.kind == "error":
        return Answer(message.key, failure="error", detail=message.text)
    return Answer(message.key, message.text, is_end=message.kind == "done")
