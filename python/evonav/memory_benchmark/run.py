"""Run memories through a stream: time them, judge them, and let a failure cost a memory this stream only."""

import random
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass

import numpy as np

from evonav.component import Component
from evonav.errors import InvalidArgumentError
from evonav.memory_benchmark.answers import MemoryFailedError
from evonav.memory_benchmark.local import Cost, HostedMemory, LocalMemory
from evonav.memory_benchmark.metrics import costs
from evonav.memory_benchmark.metrics.counts import NUM_PLACES
from evonav.memory_benchmark.protocol import Memory, MemoryFrame
from evonav.memory_benchmark.records import MemoryFailure, Speed, StreamResult
from evonav.memory_benchmark.remote import RemoteMemory
from evonav.memory_benchmark.scoring import Judge
from evonav.memory_benchmark.truth import FrameTruth, Stream

NUM_WARM_UP = 20
"""Frames at the start of a stream whose times do not count."""
EVERY_STATIC = 10
"""Number of frames from one question for the entries to the next in a stream without changes."""
NUM_QUERIES = 10
"""Labels that are asked for at the end of a visit."""

NO_DETECTIONS = "no frame has a detection: a memory that is made from detections has nothing to do"

MemorySource = str | Component[Memory] | Callable[[], Memory] | HostedMemory
"""`./file.py:Class` or `package.module:Class`, the same with options, a function that makes a memory, or one made."""


@dataclass(frozen=True, slots=True)
class MeasureSettings:
    """Settings of runs; they decide where a memory runs and how often it is asked."""

    own_process: bool | None = None
    """Run the memory in its own process; default: if it is named, since a function cannot be sent to a process."""
    timeout_s: float = 60.0
    """Time limit of a call in its own process. In this process no call can be ended."""
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
        settings: Place of the run, and how often a memory is asked.
        alive: Called after every frame of every memory.

    Returns:
        A result for each memory; one with a `failure` and without figures if it raised, hung, died or answered wrongly.

    Raises:
        InvalidArgumentError: A function was to run in its own process.
    """
    chosen = settings or MeasureSettings()

    def judged() -> list[StreamResult]:
        with ExitStack() as stack:
            runs = [stack.enter_context(closing(_StreamRun(stream, chosen, memory))) for memory in memories]
            for frame, truth in stream.frames():
                if all(run.has_failed for run in runs):
                    break
                for run in runs:
                    run.take(frame, truth)
                    alive()
            return [run.result() for run in runs]

    results = judged()
    if not chosen.runs_twice:
        return results
    return [
        one if one.failure is not None else one.model_copy(update={"is_deterministic": one.digest == other.digest})
        for one, other in zip(results, judged(), strict=True)
    ]


def host(memory: MemorySource, settings: MeasureSettings) -> HostedMemory:
    """Make a memory, in this process or in its own.

    Raises:
        MemoryFailedError: It cannot be made.
        InvalidArgumentError: A function was to run in its own process.
    """
    if isinstance(memory, HostedMemory):
        return memory
    if isinstance(memory, str):
        memory = Component(memory)
    if isinstance(memory, Component):
        if settings.own_process is False:
            return LocalMemory(memory.create)
        return RemoteMemory(memory, timeout_s=settings.timeout_s)
    if settings.own_process:
        raise InvalidArgumentError("own_process: a function cannot be sent to a process; name it by `module:name`")
    return LocalMemory(memory)


class _StreamRun:
    """One run of one memory through one stream. After its first failure, it does nothing more."""

    def __init__(self, stream: Stream, settings: MeasureSettings, memory: MemorySource) -> None:
        self._stream, self._settings = stream, settings
        self._every = settings.every or (1 if stream.changes else EVERY_STATIC)
        self._judge = Judge(stream.info, stream.changes)
        self._detected: set[str] = set()
        self._observe: list[Cost] = []
        self._locate: list[Cost] = []
        self._visit_wall_s: list[float] = []
        self._sizes: list[tuple[int, int]] = []
        """Number of the frame, and of entries, at each cost of `_observe`."""
        self._rss_mb: list[float] = []
        self._frame: MemoryFrame | None = None
        self._num_frames = self._num_visits = self._num_entries = 0
        self._is_answer_due = False
        self._memory: HostedMemory | None = None
        self._failure: MemoryFailure | None = None
        with self._failing():
            self._memory = host(memory, settings)
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
                visit = memory.visit(frame.time_s)
                self._visit_wall_s += [] if visit is None else [visit.wall_s]
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
                self._observe.append(cost)
                self._sizes.append((self._num_frames, self._num_entries))
                self._rss_mb += [] if memory.rss_bytes is None else [memory.rss_bytes / costs.MB]

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
                self._locate.append(cost)
                self._judge.take_places(label, places)
        self._judge.end_visit()

    def _judged(self, memory: HostedMemory) -> StreamResult:
        size = self._size(memory)
        update, spells = self._judge.end()
        notes = [costs.byte_note(size.num_bytes, size.rss_growth_mb)]
        notes += [] if self._stream.has_truth or self._detected else [NO_DETECTIONS]
        measured: dict[str, object] = {
            "notes": tuple(note for note in notes if note is not None),
            "speed": self._speed(),
            "size": size,
            "digest": self._judge.digest,
        }
        if self._stream.has_truth:
            measured |= {"update": update, "spells": tuple(spells)}
            measured["belief"] = self._judge.belief if self._judge.belief.n else None
            measured["queries"] = self._judge.queries if memory.can_locate else None
        return self._record(**measured)

    def _speed(self) -> Speed | None:
        wall_s = [cost.wall_s for cost in self._observe]
        wall = costs.percentiles(wall_s)
        if wall is None:
            return None
        cpu_s, locate_cpu_s = (
            [cost.cpu_s for cost in found if cost.cpu_s is not None] for found in (self._observe, self._locate)
        )
        times = np.column_stack([self._sizes, np.array(cpu_s or wall_s) * 1e3])
        samples = costs.thinned(times)
        return Speed(
            observe_cpu=costs.percentiles(cpu_s),
            observe_wall=wall,
            locate_cpu=costs.percentiles(locate_cpu_s),
            locate_wall=costs.percentiles([cost.wall_s for cost in self._locate]),
            visit_wall_max_ms=max(self._visit_wall_s) * 1e3 if self._visit_wall_s else None,
            real_time_factor=1.0 / (self._stream.info.rate_hz * max(wall.mean_ms / 1e3, 1e-9)),
            slope_per_100_entries_ms=costs.slope_per_100_entries(samples),
            slope_per_1000_frames_ms=costs.slope_per_1000_frames(samples),
            samples=tuple(costs.thinned(times, costs.NUM_STORED)),
        )

    def _size(self, memory: HostedMemory) -> costs.Size:
        num_bytes, rss_mb, growth = memory.num_bytes(self._num_entries), self._rss_mb, None
        if rss_mb:
            minutes = np.array([frame for frame, _ in self._sizes]) / (60.0 * self._stream.info.rate_hz)
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
