"""Summarise how much memory a memory takes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav.memory_benchmark.metrics.speed import MAX_SAMPLES, theil_sen

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
