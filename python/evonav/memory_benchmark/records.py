"""Define the records of the memory benchmark, and read and write them."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from evonav._core import __version__
from evonav.memory_benchmark.answers import FailureKind, Hosting
from evonav.memory_benchmark.metrics.costs import Percentiles, Sample, Size
from evonav.memory_benchmark.metrics.counts import BeliefScore, QueryCounts, QueryState, UpdateCounts
from evonav.memory_benchmark.metrics.spells import Spell
from evonav.records import Version
from evonav.report.measurements import MeasurementRecord, read_model


class MemoryFailure(MeasurementRecord):
    """The end of a memory in a stream."""

    kind: FailureKind
    message: str
    """One sentence."""
    frame: int | None
    """Index of the last frame that it was given; `None` before the first."""


class Speed(MeasurementRecord):
    """Times of one stream, after the warm-up."""

    observe_cpu: Percentiles | None
    """`None` where only wall times are known."""
    observe_wall: Percentiles
    locate_cpu: Percentiles | None
    locate_wall: Percentiles | None
    visit_wall_max_ms: float | None
    real_time_factor: float
    slope_per_100_entries_ms: float | None
    slope_per_1000_frames_ms: float | None
    samples: tuple[Sample, ...]
    """Time over frames and entries, thinned, for plots."""


class StreamResult(MeasurementRecord):
    """The result of one memory in one stream. A part is `None` if the memory failed or has nothing to show in it."""

    stream: str
    kind: str
    house: str
    hosting: Hosting
    num_frames: int
    """Frames that it was given."""
    num_visits: int
    num_changes: int
    failure: MemoryFailure | None = None
    notes: tuple[str, ...] = ()
    """Sentences about what looks wrong, and proves nothing."""
    speed: Speed | None = None
    size: Size | None = None
    update: UpdateCounts | None = None
    spells: tuple[Spell, ...] = ()
    belief: BeliefScore | None = None
    queries: dict[QueryState, QueryCounts] | None = None
    digest: str | None = None
    """SHA-256 of all entries in their order: equal for equal bits."""
    is_deterministic: bool | None = None
    """Whether a second run gave the same bits; `None` if there was none."""


class BenchmarkResult(MeasurementRecord):
    """All memories of one run of the benchmark."""

    schema_version: Version = 1
    evonav_version: str = __version__
    machine: str
    """The processor and the number of its cores: times of different machines do not compare."""
    memories: dict[str, list[StreamResult]]
    """The results of each memory in all streams, by its name."""


def judged(streams: Iterable[StreamResult], kind: str | None = None) -> list[StreamResult]:
    """Return the streams of a kind in which a memory did not fail; of all kinds for `None`."""
    return [one for one in streams if one.failure is None and kind in (None, one.kind)]


class MemoryHeader(MeasurementRecord):
    """The settings that records of one folder share, and its memories."""

    identity: dict[str, Any]
    memories: dict[str, dict[str, Any]]
    """Import path, options and digest of the file, by name."""


def read_result(path: Path) -> BenchmarkResult:
    """Read a result.

    Raises:
        StoreError: The file cannot be read, or is no result; the message has the first field that is wrong.
    """
    return read_model(BenchmarkResult, path, "expected a result.json of `evonav bench memory`")
