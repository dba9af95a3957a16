"""Jobs on workers that may die or hang: in this process, in processes of this machine, or on a Ray cluster.

A job is a text and so is its answer: nothing that a worker sends is unpickled. What workers do is named, not sent:
`module:factory`. `factory(settings, alive)` is called once a worker and gives its `Work`, which turns a job's text into
its answer's, at once or, where it is a generator, with news on the way; `alive()` says within a job that it goes on. A
worker that dies has its job tried again by another, a job that says nothing for too long ends its worker.
"""

import importlib
import time
import traceback
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from itertools import islice
from types import TracebackType
from typing import Literal, Protocol

from evonav.errors import EvonavError, InvalidArgumentError

EngineName = Literal["local", "ray"]
FailureKind = Literal["crash", "timeout", "error"]
Work = Callable[[str], str | Generator[str, None, str]]
"""May have a method `close`, called when its worker ends."""

MAX_LOSSES = 2
"""Workers that a job may lose before it is given up, unless said otherwise."""
MAX_FAILED_STARTS = 5
"""Workers that may die before they are ready with no job done meanwhile: then no more are started, and if none is at
work, none can be had."""
START_TIMEOUT_S = 300.0
"""For a worker to be ready."""
SIGN_OF_LIFE_S = 5.0
"""Between two that a worker gives, at least."""


class EngineError(EvonavError):
    """Workers cannot be had: they do not start, or what starts them is not installed."""


@dataclass(frozen=True, slots=True)
class Job:
    """Something to do."""

    key: int
    """The caller's."""
    text: str
    timeout_s: float | None = None
    """Without a word of it; default: the pool's."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of a job: a text or a failure; or, before that, news of it."""

    key: int
    text: str = ""
    is_end: bool = True
    """Whether it is more than news."""
    failure: FailureKind | None = None
    detail: str = ""
    """Of a failure: a traceback, or one line."""


@dataclass(frozen=True, slots=True)
class Resources:
    """What a Ray cluster sets aside for each worker."""

    num_cpus: float = 1.0
    num_gpus: float = 0.0
    """May be a part of one."""


class Pool(Protocol):
    """Where jobs are done, in any order."""

    capacity: int
    """Jobs that it takes before one must have ended."""

    def submit(self, job: Job) -> None:
        """Takes a job."""

    def next_answer(self) -> Answer:
        """Waits for what some job says next. Call only while a submitted job has not ended."""

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
    resources: Resources | None = None,
    max_losses: int = MAX_LOSSES,
) -> Pool:
    """Workers, to be used in a `with` statement.

    Args:
        work: `module:factory`.
        settings: What the factory is called with.
        engine: Processes of this machine, or Ray actors.
        num_workers: 0 works in this process (engine `local` only), where nothing is contained but exceptions.
        timeout_s: After which a job that has said nothing is given up.
        ray_address: Of a cluster; default: one on this machine.
        resources: Of each worker, for engine `ray`; default: a CPU.
        max_losses: Workers that a job may lose before it is given up.

    Raises:
        EngineError: Ray is not installed or not to be reached.
        InvalidArgumentError: Of the arguments.
    """
    if num_workers < (1 if engine == "ray" else 0):
        raise InvalidArgumentError(f"num_workers = {num_workers}: too few for engine {engine}")
    if ray_address is not None and engine != "ray":
        raise InvalidArgumentError(f"a Ray address is for engine ray, not {engine}")
    if engine == "ray":
        from evonav.parallel.ray import RayHost

        host = RayHost(work, settings, num_workers, ray_address, resources or Resources())
        return WorkerPool(host, min(num_workers, host.max_workers), timeout_s, max_losses)
    if num_workers == 0:
        return InlinePool(work, settings)
    from evonav.parallel.local import ProcessHost

    return WorkerPool(ProcessHost(work, settings), num_workers, timeout_s, max_losses)


def answers(pool: Pool, jobs: Iterable[Job]) -> Iterator[Answer]:
    """Has jobs done that say nothing before their end, in any order, and keeps the pool busy meanwhile.

    Args:
        pool: Who does it.
        jobs: Taken as there is room for them.
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


class WorkerLostError(EngineError):
    """A worker ended by itself."""


class Worker(Protocol):
    """The pool's side of a worker. It says `ready` once, and then what its jobs say."""

    def send(self, text: str) -> None:
        """Gives it a job; the loss of the worker shows in `receive`."""

    def receive(self) -> tuple[str, str]:
        """What it says next; there is something to receive.

        Returns:
            `("ready", "")`; of a job `("alive", "")`, `("news", text)`, and at its end `("done", answer)` or
            `("error", traceback)`; or `("broken", traceback)` where the factory has failed.

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
        self._work = load_work(work, settings, lambda: None)
        self._key = 0
        self._job: Generator[tuple[str, str]] | None = None

    def submit(self, job: Job) -> None:
        """Takes a job."""
        self._key, self._job = job.key, steps(self._work, job.text)

    def next_answer(self) -> Answer:
        """Does the job until it says something."""
        assert self._job is not None, "`submit` comes first"
        kind, text = next(self._job)
        return _answer(self._key, kind, text)

    def __enter__(self) -> "InlinePool":
        """Nothing."""
        return self

    def __exit__(self, *_: object) -> None:
        """Ends what the job is at."""
        if self._job is not None:
            self._job.close()
        end_work(self._work)


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

    def __init__(self, host: Host, num_workers: int, timeout_s: float, max_losses: int) -> None:
        """Starts nothing yet."""
        self.capacity = 2 * num_workers  # one at work and one waiting, so that no worker ever does
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
        """Takes a job, and has it begun if a worker is free."""
        self._queue.append(job)
        self._assign()

    def next_answer(self) -> Answer:
        """Waits for what some job says next."""
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

    def __enter__(self) -> "WorkerPool":
        """Nothing."""
        return self

    def __exit__(self, *_: object) -> None:
        """Ends all workers at once."""
        for slot in list(self._slots):
            self._close(slot)
        self._host.close()


def load_work(work: str, settings: str, alive: Callable[[], None]) -> Work:
    """What a worker does."""
    module, _, factory = work.partition(":")
    function: Work = getattr(importlib.import_module(module), factory)(settings, alive)
    return function


def end_work(work: Work) -> None:
    """Lets what does the jobs give back what it holds."""
    close = getattr(work, "close", None)
    if close is not None:
        close()


def steps(work: Work, text: str) -> Generator[tuple[str, str]]:
    """What a job says: its news, then its answer or the traceback of what it raised."""
    try:
        said = work(text)
        if isinstance(said, str):
            answer = said
        else:
            with closing(said):
                answer = yield from _news(said)
    except Exception:
        yield "error", traceback.format_exc()
    else:
        yield "done", answer


def _news(said: Generator[str, None, str]) -> Generator[tuple[str, str], None, str]:
    while True:
        try:
            text = next(said)
        except StopIteration as end:
            answer: str = end.value
            return answer
        yield "news", text


def _answer(key: int, kind: str, text: str) -> Answer:
    if kind == "error":
        return Answer(key, failure="error", detail=text)
    return Answer(key, text, is_end=kind == "done")


@dataclass(slots=True)
class Pulse:
    """A worker's `alive`: passes on one sign of life in a while."""

    tell: Callable[[], None]
    told_s: float = field(default_factory=time.monotonic)

    def __call__(self) -> None:
        """The job goes on."""
        if time.monotonic() - self.told_s >= SIGN_OF_LIFE_S:
            self.told_s = time.monotonic()
            self.tell()
