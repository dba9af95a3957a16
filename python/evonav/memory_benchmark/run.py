"""Run memories through a stream: time them, judge them, and let a failure cost a memory this stream only."""

import random
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol

import numpy as np

from evonav.component import Component
from evonav.errors import InvalidArgumentError
from evonav.memory_benchmark.answers import CheckedEntries, Hosting, MemoryFailedError
from evonav.memory_benchmark.hosting.local import Cost, LocalMemory
from evonav.memory_benchmark.hosting.process import RemoteMemory
from evonav.memory_benchmark.metrics import costs
from evonav.memory_benchmark.metrics.retrieval import NUM_PLACES
from evonav.memory_benchmark.protocol import FoundPlace, Memory, MemoryFrame, StreamInfo
from evonav.memory_benchmark.records import BeliefScore, MemoryFailure, Speed, StreamResult
from evonav.memory_benchmark.scoring import Judge
from evonav.memory_benchmark.truth import FrameTruth, Stream

NUM_WARM_UP = 20
"""Frames at the start of a stream whose times do not count."""
EVERY_STATIC = 10
"""Number of frames from one question for the entries to the next in a stream without changes."""
NUM_QUERIES = 10
"""Labels that are asked for at the end of a visit."""

NO_DETECTIONS = "no frame has a detection: a memory that is made from detections has nothing to do"

MemorySource = str | Component[Memory] | Callable[[], Memory]
"""`./file.py:Class` or `package.module:Class`, the same with options, or a function that makes a memory."""


@dataclass(frozen=True, slots=True)
class MeasureSettings:
    """Settings of runs; they decide where a memory runs and how often it is asked."""

    own_process: bool | None = None
    """Run the memory in its own process; default: if it is named, since a function cannot be sent to a process."""
    timeout_s: float = 60.0
    """Time limit of a call in its own process. In this process no call can be ended."""
    memory_mb: int | None = None
    """Largest address space of its own process; default: no limit."""
    every: int | None = None
    """Ask for the entries after every so many frames, and after the last one of each visit.

    Default: after every frame, and after every tenth in a stream in which nothing changes.
    """
    seed: int = 0
    """Seed of the labels that are asked for."""
    runs_twice: bool = False
    """Run the stream a second time and compare the bits of all answers."""

    def __post_init__(self) -> None:
        """Check the fields.

        Raises:
            InvalidArgumentError: `every` or `timeout_s` is not positive.
        """
        if self.every is not None and self.every < 1:
            raise InvalidArgumentError(f"every = {self.every}: must be at least 1")
        if not self.timeout_s > 0.0:
            raise InvalidArgumentError(f"timeout_s = {self.timeout_s}: must be positive")


class HostedMemory(Protocol):
    """A memory as the runner sees it; every call may raise `MemoryFailedError`."""

    hosting: Hosting
    can_locate: bool
    rss_bytes: int | None
    """Resident memory of its own process after the last call; `None` without one."""
    peak_rss_bytes: int | None
    """Peak of it, known after `num_bytes`."""

    def reset(self, info: StreamInfo) -> object:
        """Begin a stream."""

    def visit(self, time_s: float) -> Cost | None:
        """Begin a visit."""

    def observe(self, frame: MemoryFrame) -> Cost | None:
        """Hand over a frame; return what it cost, if that is known."""

    def entries(self) -> CheckedEntries:
        """Return the entries."""

    def num_bytes(self, num_entries: int) -> int | None:
        """Return the size that the memory tells; `None` if it tells none."""

    def locate(self, text: str, k: int) -> tuple[list[FoundPlace], Cost]:
        """Ask where something is."""

    def close(self) -> None:
        """Let go of the memory."""


def measure(memory: MemorySource, stream: Stream, settings: MeasureSettings | None = None) -> StreamResult:
    """Run a memory through a stream and judge it; see `measure_all`."""
    return measure_all([memory], stream, settings)[0]


def measure_all(
    memories: Sequence[MemorySource],
    stream: Stream,
    settings: MeasureSettings | None = None,
    *,
    alive: Callable[[], None] = lambda: None,
) -> list[StreamResult]:
    """Run memories through a stream side by side, so that each frame is rendered once, and judge them.

    Times are of `observe` and `locate` alone, and only one memory is at work at a time. CPU time is the whole process's
    while a call runs, so that threads count, too; what a thread does after `observe` has returned shows in the wall
    time of later calls only.

    Args:
        memories: The memories; fresh ones are made.
        settings: Place and limits of the run, and how often a memory is asked.
        alive: Called after every frame of every memory.

    Returns:
        A result for each memory; one with a `failure` and without figures if it raised, hung, died or answered wrongly.

    Raises:
        InvalidArgumentError: A function was to run in its own process.
    """
    chosen = settings or MeasureSettings()
    hosted = [partial(host, memory, chosen) for memory in memories]
    results = judge_memories(hosted, stream, chosen, alive)
    if not chosen.runs_twice:
        return results
    again = judge_memories(hosted, stream, chosen, alive)
    return [
        one if one.failure is not None else one.model_copy(update={"is_deterministic": one.digest == other.digest})
        for one, other in zip(results, again, strict=True)
    ]


def judge_memories(
    new_memories: Sequence[Callable[[], HostedMemory]],
    stream: Stream,
    settings: MeasureSettings,
    alive: Callable[[], None] = lambda: None,
) -> list[StreamResult]:
    """Run hosted memories through a stream side by side and judge them.

    Args:
        new_memories: Each makes a memory, which is closed at the end.
        settings: They say how often a memory is asked.
        alive: Called after every frame of every memory.
    """
    with ExitStack() as stack:
        runs = [stack.enter_context(closing(_StreamRun(stream, settings, new_memory))) for new_memory in new_memories]
        for frame, truth in stream.frames():
            if all(run.has_failed for run in runs):
                break
            for run in runs:
                run.take(frame, truth)
                alive()
        return [run.result() for run in runs]


def host(memory: MemorySource, settings: MeasureSettings) -> LocalMemory | RemoteMemory:
    """Make a memory, in this process or in its own.

    Raises:
        MemoryFailedError: It cannot be made.
        InvalidArgumentError: A function was to run in its own process.
    """
    component: Component[Memory] | None = Component(memory) if isinstance(memory, str) else None
    if isinstance(memory, Component):
        component = memory
    if component is None:
        if settings.own_process:
            raise InvalidArgumentError("own_process: a function cannot be sent to a process; name it by `module:name`")
        assert callable(memory)
        return LocalMemory(memory)
    if settings.own_process is False:
        return LocalMemory(component.create)
    return RemoteMemory(component, timeout_s=settings.timeout_s, memory_mb=settings.memory_mb)


@dataclass(slots=True)
class _Times:
    """Measurements of a stream, in the order of its frames."""

    observe: list[Cost] = field(default_factory=list)
    locate: list[Cost] = field(default_factory=list)
    visit: list[Cost | None] = field(default_factory=list)
    frames: list[int] = field(default_factory=list)
    num_entries: list[int] = field(default_factory=list)
    rss_mb: list[float] = field(default_factory=list)


class _StreamRun:
    """One run of one memory through one stream. After its first failure, it does nothing more."""

    def __init__(self, stream: Stream, settings: MeasureSettings, new_memory: Callable[[], HostedMemory]) -> None:
        self._stream, self._settings = stream, settings
        self._every = settings.every or (1 if stream.changes else EVERY_STATIC)
        self._judge = Judge(stream.info, stream.changes)
        self._detected: set[str] = set()
        self._times = _Times()
        self._frame: MemoryFrame | None = None
        self._num_frames = self._num_visits = 0
        self._is_answer_due = False
        self._num_entries = 0
        self._memory: HostedMemory | None = None
        self._failure: MemoryFailure | None = None
        with self._failing():
            self._memory = new_memory()
            self._memory.reset(stream.info)

    @property
    def has_failed(self) -> bool:
        return self._failure is not None

    def take(self, frame: MemoryFrame, truth: FrameTruth) -> None:
        """Hand over the next frame."""
        memory = self._memory
        if memory is None or self.has_failed:
            return
        with self._failing():
            if self._frame is None or frame.visit != self._frame.visit:
                self._end_visit(memory)
                self._times.visit.append(memory.visit(frame.time_s))
                self._num_visits += 1
            self._frame = frame
            cost = memory.observe(frame)
            self._judge.look(frame, truth)
            self._detected.update(frame.view.detections.labels)
            self._num_frames += 1
            self._is_answer_due = True
            if self._num_frames % self._every == 0:
                self._ask(memory)
            if self._num_frames > NUM_WARM_UP and cost is not None:
                self._times.observe.append(cost)
                self._times.frames.append(self._num_frames)
                self._times.num_entries.append(self._num_entries)
                if memory.rss_bytes is not None:
                    self._times.rss_mb.append(memory.rss_bytes / costs.MB)

    def result(self) -> StreamResult:
        """End the stream."""
        memory = self._memory
        if memory is not None and not self.has_failed:
            with self._failing():
                self._end_visit(memory)
                return self._judged(memory)
        return self._record(failure=self._failure)

    def close(self) -> None:
        """Let go of the memory."""
        if self._memory is not None:
            self._memory.close()

    @contextmanager
    def _failing(self) -> Iterator[None]:
        """Keep the failure of a call."""
        try:
            yield
        except MemoryFailedError as error:
            frame = None if self._frame is None else self._frame.index
            self._failure = MemoryFailure(kind=error.kind, message=str(error), frame=frame)

    def _ask(self, memory: HostedMemory) -> None:
        entries = memory.entries()
        self._num_entries = len(entries)
        self._judge.believe(entries)
        self._is_answer_due = False

    def _end_visit(self, memory: HostedMemory) -> None:
        if self._frame is None:
            return
        if self._is_answer_due:
            self._ask(memory)
        if memory.can_locate:
            labels = self._judge.labels_to_ask() if self._stream.has_truth else sorted(self._detected)
            draw = random.Random(f"{self._settings.seed}/{self._stream.name}/{self._num_visits}")  # noqa: S311
            for label in draw.sample(labels, min(NUM_QUERIES, len(labels))):
                places, cost = memory.locate(label, NUM_PLACES)
                self._times.locate.append(cost)
                self._judge.take_places(label, places)
        self._judge.end_visit()

    def _judged(self, memory: HostedMemory) -> StreamResult:
        num_bytes = memory.num_bytes(self._num_entries)
        update, spells = self._judge.end()
        sums, queries = self._judge.belief, self._judge.queries.of_state
        its_size = self._size(num_bytes, memory)
        notes = [costs.byte_note(num_bytes, its_size.rss_growth_mb)]
        notes += [] if self._stream.has_truth or self._detected else [NO_DETECTIONS]
        fixed = {
            "notes": tuple(note for note in notes if note is not None),
            "speed": self._speed(),
            "size": its_size,
            "digest": self._judge.digest,
        }
        if not self._stream.has_truth:
            return self._record(**fixed)
        bins = [(float(n), float(p), float(right)) for n, p, right in sums.bins.tolist()]
        belief = BeliefScore(n=sums.n, squared_error=sums.squared_error, log_loss=sums.log_loss, bins=tuple(bins))
        return self._record(
            **fixed,
            update=update,
            spells=tuple(spells),
            belief=belief if sums.n else None,
            queries=queries if memory.can_locate else None,
        )

    def _speed(self) -> Speed | None:
        times = self._times
        wall = costs.percentiles([cost.wall_s for cost in times.observe])
        if wall is None:
            return None
        cpu_s = _known(cost.cpu_s for cost in times.observe)
        seconds = cpu_s or [cost.wall_s for cost in times.observe]
        times_ms = np.array(seconds) * 1e3
        samples = costs.thinned(times.frames, times.num_entries, times_ms)
        return Speed(
            observe_cpu=costs.percentiles(cpu_s),
            observe_wall=wall,
            locate_cpu=costs.percentiles(_known(cost.cpu_s for cost in times.locate)),
            locate_wall=costs.percentiles([cost.wall_s for cost in times.locate]),
            visit_wall_max_ms=max((cost.wall_s * 1e3 for cost in times.visit if cost is not None), default=None),
            real_time_factor=costs.real_time_factor(wall.mean_ms / 1e3, self._stream.info.rate_hz),
            slope_per_100_entries_ms=costs.slope_per_100_entries(samples),
            slope_per_1000_frames_ms=costs.slope_per_1000_frames(samples),
            samples=tuple(costs.thinned(times.frames, times.num_entries, times_ms, costs.NUM_STORED)),
        )

    def _size(self, num_bytes: int | None, memory: HostedMemory) -> costs.Size:
        rss_mb, growth = self._times.rss_mb, None
        if rss_mb:
            minutes = np.array(self._times.frames) / (60.0 * self._stream.info.rate_hz)
            growth = costs.growth_per_minute(minutes, np.array(rss_mb))
        peak = memory.peak_rss_bytes
        return costs.Size(
            num_entries=self._num_entries,
            num_bytes=num_bytes,
            bytes_per_entry=num_bytes / self._num_entries if num_bytes is not None and self._num_entries else None,
            rss_growth_mb_per_minute=growth,
            rss_growth_mb=rss_mb[-1] - rss_mb[0] if rss_mb else None,
            peak_rss_mb=None if peak is None else peak / costs.MB,
        )

    def _record(self, **parts: object) -> StreamResult:
        stream = self._stream
        fixed = {
            "stream": stream.name,
            "kind": stream.kind,
            "house": stream.house,
            "hosting": "here" if self._memory is None else self._memory.hosting,
            "num_frames": self._num_frames,
            "num_visits": self._num_visits,
            "num_changes": len(stream.changes),
        }
        return StreamResult.model_validate({**fixed, **parts})


def _known(values: Iterable[float | None]) -> list[float]:
    return [value for value in values if value is not None]
