"""Summarise what a memory costs: times, their slopes over entries and frames, and sizes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

MAX_SAMPLES = 200
"""Samples that slopes are taken of."""
NUM_STORED = 50
"""Samples of a stream in its record."""
MIN_SPREAD = 50
"""Smallest difference of the numbers of entries from which a slope over entries is taken."""
MIN_FRAMES = 100
"""Smallest number of frames from which a slope over frames is taken."""


@dataclass(frozen=True, slots=True)
class Percentiles:
    """Times of many calls, in milliseconds."""

    n: int
    mean_ms: float
    p50_ms: float
    p95_ms: float
    p99_ms: float
    max_ms: float


@dataclass(frozen=True, slots=True)
class Sample:
    """The medians of some consecutive frames."""

    frame: float
    entries: float
    ms: float
    """CPU time, or wall time where that alone is known."""


def percentiles(seconds: ArrayLike) -> Percentiles | None:
    """Summarise times in seconds; `None` without any. Percentiles are interpolated linearly."""
    times_ms = np.asarray(seconds, np.float64) * 1e3
    if not times_ms.size:
        return None
    p50, p95, p99 = np.percentile(times_ms, [50, 95, 99]).tolist()
    return Percentiles(times_ms.size, float(times_ms.mean()), p50, p95, p99, float(times_ms.max()))


def thinned(times: NDArray[np.float64], num: int = MAX_SAMPLES) -> list[Sample]:
    """Return at most `num` samples: medians over equal parts of the frames.

    Args:
        times: `(N, 3)`: frame, entries, milliseconds.
    """
    parts = np.array_split(times, num) if len(times) > num else list(times[:, None])
    return [Sample(*np.median(part, axis=0).tolist()) for part in parts]


def theil_sen(x: NDArray[np.float64], y: NDArray[np.float64], is_pair: NDArray[np.bool_] | None = None) -> float | None:
    """Return the median slope over all pairs of points with different `x`; `None` without a pair.

    Sources: Theil 1950; Sen, "Estimates of the Regression Coefficient Based on Kendall's Tau", JASA 1968.

    Args:
        x: `(N,)`.
        y: `(N,)`.
        is_pair: `(N, N)` pairs that count; default: all.
    """
    first, second = np.triu_indices(len(x), 1)
    dx, dy = x[second] - x[first], y[second] - y[first]
    counts = dx != 0.0
    if is_pair is not None:
        counts &= is_pair[first, second]
    return float(np.median(dy[counts] / dx[counts])) if counts.any() else None


def slope_per_100_entries(samples: Sequence[Sample]) -> float | None:
    """Return how many ms a call takes more for 100 more entries (Theil-Sen).

    Returns:
        `None` if the number of entries spreads by less than `MIN_SPREAD`.
    """
    entries = np.array([sample.entries for sample in samples])
    if not entries.size or np.ptp(entries) < MIN_SPREAD:
        return None
    slope = theil_sen(entries, np.array([sample.ms for sample in samples]))
    return None if slope is None else 100.0 * slope


def slope_per_1000_frames(samples: Sequence[Sample]) -> float | None:
    """Return how many ms a call takes more after 1,000 more frames with as many entries: Theil-Sen over such pairs.

    As many entries are numbers that differ by at most 2%, or by one.

    Returns:
        `None` if no such pair is at least `MIN_FRAMES` apart.
    """
    frames = np.array([sample.frame for sample in samples])
    entries = np.array([sample.entries for sample in samples])
    larger = np.maximum(entries[:, None], entries[None, :])
    is_equal = np.abs(entries[:, None] - entries[None, :]) <= np.maximum(1.0, 0.02 * larger)
    if not (is_equal & (frames[None, :] - frames[:, None] >= MIN_FRAMES)).any():
        return None
    slope = theil_sen(frames, np.array([sample.ms for sample in samples]), is_equal)
    return None if slope is None else 1000.0 * slope


MB = 1e6
SILENT_MB = 64.0
"""Growth of the process from which on a claim of far fewer bytes is worth a note."""
SILENT_FACTOR = 10.0


@dataclass(frozen=True, slots=True)
class Size:
    """Memory at the end of a stream; a field is `None` where it is not known."""

    num_entries: int
    num_bytes: int | None
    """Answer of `num_bytes()`."""
    bytes_per_entry: float | None
    rss_growth_mb_per_minute: float | None
    """Theil-Sen slope of the resident memory of its process over the minutes of the stream, visits only."""
    rss_growth_mb: float | None
    """Growth from the end of the warm-up to the end of the stream."""
    peak_rss_mb: float | None


def growth_per_minute(minutes: NDArray[np.float64], megabytes: NDArray[np.float64]) -> float | None:
    """Return the Theil-Sen slope of sizes over time; `None` of fewer than two times.

    Args:
        minutes: `(N,)` ascending.
        megabytes: `(N,)`.
    """
    step = -(-len(minutes) // MAX_SAMPLES) if len(minutes) else 1
    return theil_sen(minutes[::step], megabytes[::step])


def byte_note(num_bytes: int | None, rss_growth_mb: float | None) -> str | None:
    """Return a sentence if the process has grown by far more than the memory says it holds.

    The process also holds libraries and buffers, so this proves nothing: it is a note and no failure.
    """
    if num_bytes is None or rss_growth_mb is None:
        return None
    if rss_growth_mb < SILENT_MB or rss_growth_mb < SILENT_FACTOR * num_bytes / MB:
        return None
    return f"num_bytes() says {num_bytes / MB:.1f} MB, and its process grew by {rss_growth_mb:.1f} MB"
