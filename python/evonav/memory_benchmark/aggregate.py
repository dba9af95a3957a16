"""Aggregate results over streams: every figure with its 95% interval over houses."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from evonav.memory_benchmark.metrics.belief import NUM_BINS, calibration_error
from evonav.memory_benchmark.metrics.costs import Percentiles
from evonav.memory_benchmark.metrics.retrieval import QueryCounts, QueryState
from evonav.memory_benchmark.metrics.staleness import Clock, SpellKind, durations_of, risk_table, survival
from evonav.memory_benchmark.metrics.updates import ChangeCounts, UpdateCounts
from evonav.memory_benchmark.records import BeliefScore, MemoryResult, StreamResult
from evonav.statistics import ClusterBootstrap, Estimate

BASELINE = "never"
"""The memory that others are compared with: it integrates and never forgets."""

NUM_RESAMPLES = 2_000
"""Resamples of houses: five of them have only 126 different ones."""

Streams = Sequence[StreamResult]
Better = Literal["lower", "higher"]


@dataclass(frozen=True, slots=True)
class MemoryMetric:
    """One number of a memory: its name, and how it is taken from streams."""

    name: str
    unit: str
    better: Better
    estimate: Callable[[Streams, ClusterBootstrap], Estimate]
    is_time: bool = False
    """Whether it depends on the machine."""


def estimates(result: MemoryResult, kind: str | None = None) -> dict[str, Estimate]:
    """Return all figures of a memory that its streams give, by name.

    Args:
        kind: Kind of streams, such as `S1`; default: all. Streams in which it failed are left out.
    """
    streams = result.of_kind(kind)
    if not streams:
        return {}
    bootstrap = bootstrap_of(streams)
    found = {figure.name: figure.estimate(streams, bootstrap) for figure in METRICS}
    return {name: estimate for name, estimate in found.items() if estimate.value is not None}


def bootstrap_of(streams: Streams) -> ClusterBootstrap:
    """Return the resamples of the houses of some streams."""
    return ClusterBootstrap([stream.house for stream in streams], num_resamples=NUM_RESAMPLES)


def paired(ours: Streams, theirs: Streams) -> tuple[list[StreamResult], list[StreamResult]]:
    """Return the streams that both have and in which neither failed, in the same order."""
    others = {stream.stream: stream for stream in theirs if stream.failure is None}
    both = [stream for stream in ours if stream.failure is None and stream.stream in others]
    return both, [others[stream.stream] for stream in both]


def ratios(result: MemoryResult, baseline: MemoryResult, kind: str | None = None) -> dict[str, Estimate]:
    """Return times and sizes of a memory divided by those of another in the same run, over the streams of both.

    Args:
        baseline: The other one, `BASELINE` in tables.
        kind: Kind of streams; default: all.
    """
    ours, theirs = paired(result.of_kind(kind), baseline.of_kind(kind))
    if not ours:
        return {}
    bootstrap = bootstrap_of(ours)
    found = {}
    for name, get in RATIOS.items():
        pairs = [(get(one), get(other)) for one, other in zip(ours, theirs, strict=True)]
        values = np.array([(a, b) if a is not None and b is not None else (0.0, 0.0) for a, b in pairs])
        sums = bootstrap.sums(values)
        estimate = bootstrap.ratio(sums[:, 0], sums[:, 1], int(np.count_nonzero(values[:, 1])))
        if estimate.value is not None:
            found[name] = estimate
    return found


# Ways to take an estimate


def _mean(get: Callable[[StreamResult], float | None]) -> Callable[[Streams, ClusterBootstrap], Estimate]:
    """Take the mean over streams that have the value."""

    def estimate(streams: Streams, bootstrap: ClusterBootstrap) -> Estimate:
        values = [get(stream) for stream in streams]
        rows = np.array([(0.0, 0.0) if value is None else (value, 1.0) for value in values])
        sums = bootstrap.sums(rows)
        return bootstrap.ratio(sums[:, 0], sums[:, 1], int(rows[:, 1].sum()))

    return estimate


def _largest(get: Callable[[StreamResult], float | None]) -> Callable[[Streams, ClusterBootstrap], Estimate]:
    def estimate(streams: Streams, bootstrap: ClusterBootstrap) -> Estimate:
        values = [value for stream in streams if (value := get(stream)) is not None]
        return Estimate(max(values, default=None), None, len(values), bootstrap.num_clusters)

    return estimate


def _share(
    get: Callable[[StreamResult], tuple[float, float] | None], scale: float = 1.0
) -> Callable[[Streams, ClusterBootstrap], Estimate]:
    """Take a ratio of sums over streams."""

    def estimate(streams: Streams, bootstrap: ClusterBootstrap) -> Estimate:
        rows = np.array([get(stream) or (0.0, 0.0) for stream in streams], np.float64)
        sums = bootstrap.sums(rows)
        return bootstrap.ratio(scale * sums[:, 0], sums[:, 1], round(float(rows[:, 1].sum())))

    return estimate


def _of_counts(
    get: Callable[[UpdateCounts], tuple[float, float]], scale: float = 1.0
) -> Callable[[Streams, ClusterBootstrap], Estimate]:
    return _share(lambda stream: None if stream.update is None else get(stream.update), scale)


def _half_life(kind: SpellKind, clock: Clock) -> Callable[[Streams, ClusterBootstrap], Estimate]:
    def estimate(streams: Streams, bootstrap: ClusterBootstrap) -> Estimate:
        parts = [durations_of(stream.spells, kind, clock) for stream in streams]
        durations, is_over = (np.concatenate(column) for column in zip(*parts, strict=True))
        if not durations.size:
            return Estimate(None, None, 0, bootstrap.num_clusters)
        houses = np.repeat(bootstrap.cluster_of, [len(part[0]) for part in parts])
        ends, at_risk, over = risk_table(durations, is_over)
        sums = bootstrap.sums(np.hstack([at_risk, over]), houses)
        total, resampled = sums.sum(axis=0), bootstrap.resampled_sums(sums)
        value = float(survival(ends, total[: len(ends)], total[len(ends) :]).half_life)
        half_lives = survival(ends, resampled[:, : len(ends)], resampled[:, len(ends) :]).half_life
        return bootstrap.estimate(value, half_lives, len(durations))

    return estimate


def _not_over(kind: SpellKind) -> Callable[[Streams, ClusterBootstrap], Estimate]:
    def counts(stream: StreamResult) -> tuple[float, float]:
        _, is_over = durations_of(stream.spells, kind, "frames")
        return float((~is_over).sum()), float(len(is_over))

    return _share(counts, 100.0)


def _ece(streams: Streams, bootstrap: ClusterBootstrap) -> Estimate:
    empty = [(0.0, 0.0, 0.0)] * NUM_BINS
    rows = np.array([empty if stream.belief is None else stream.belief.bins for stream in streams], np.float64)
    sums = bootstrap.sums(rows.reshape(len(streams), -1))
    total = sums.sum(axis=0).reshape(NUM_BINS, 3)
    if not total[:, 0].sum():
        return Estimate(None, None, 0, bootstrap.num_clusters)
    resampled = bootstrap.resampled_sums(sums).reshape(-1, NUM_BINS, 3)
    return bootstrap.estimate(float(calibration_error(total)), calibration_error(resampled), int(total[:, 0].sum()))


def _of_belief(get: Callable[[BeliefScore], float]) -> Callable[[Streams, ClusterBootstrap], Estimate]:
    return _share(lambda stream: None if stream.belief is None else (get(stream.belief), stream.belief.n))


def _of_queries(
    state: QueryState, get: Callable[[QueryCounts], float]
) -> Callable[[Streams, ClusterBootstrap], Estimate]:
    def counts(stream: StreamResult) -> tuple[float, float] | None:
        found = None if stream.queries is None else stream.queries.get(state)
        return None if found is None else (get(found), found.n)

    return _share(counts, 100.0)


def _time(call: str, percentile: str) -> Callable[[StreamResult], float | None]:
    def get(stream: StreamResult) -> float | None:
        times: Percentiles | None = None if stream.speed is None else getattr(stream.speed, call)
        return None if times is None else float(getattr(times, percentile))

    return get


def _speed(name: str) -> Callable[[StreamResult], float | None]:
    return lambda stream: None if stream.speed is None else getattr(stream.speed, name)


def _size(name: str) -> Callable[[StreamResult], float | None]:
    return lambda stream: None if stream.size is None else getattr(stream.size, name)


def _f1(*counts: ChangeCounts) -> tuple[float, float]:
    hits = 2.0 * sum(one.hits for one in counts)
    return hits, hits + sum(one.false_alarms + one.misses for one in counts)


def _removal_f1(counts: UpdateCounts) -> tuple[float, float]:
    missed = counts.removals - counts.removals_done
    return 2.0 * counts.removals_done, 2.0 * counts.removals_done + missed + counts.false_forgets


_TIMES = [
    MemoryMetric(
        f"{call}_{clock}_{name}_ms", "ms", "lower", _mean(_time(f"{call}_{clock}", f"{name}_ms")), is_time=True
    )
    for call in ("observe", "locate")
    for clock in ("cpu", "wall")
    for name in ("p50", "p95", "p99")
]
_LARGEST = [
    MemoryMetric(f"{call}_{clock}_max_ms", "ms", "lower", _largest(_time(f"{call}_{clock}", "max_ms")), is_time=True)
    for call in ("observe", "locate")
    for clock in ("cpu", "wall")
]
_SLOPES = [
    MemoryMetric(name, "ms", "lower", _mean(_speed(name)), is_time=True)
    for name in ("slope_per_100_entries_ms", "slope_per_1000_frames_ms")
]
_SIZES = [
    MemoryMetric("bytes_per_entry", "B", "lower", _mean(_size("bytes_per_entry"))),
    MemoryMetric("rss_growth_mb_per_minute", "MB/min", "lower", _mean(_size("rss_growth_mb_per_minute")), is_time=True),
    MemoryMetric("peak_rss_mb", "MB", "lower", _largest(_size("peak_rss_mb")), is_time=True),
]
_UPDATES = [
    MemoryMetric(
        "removal_precision",
        "",
        "higher",
        _of_counts(lambda counts: (counts.removals_done, counts.removals_done + counts.false_forgets)),
    ),
    MemoryMetric("removal_recall", "", "higher", _of_counts(lambda counts: (counts.removals_done, counts.removals))),
    MemoryMetric("removal_f1", "", "higher", _of_counts(_removal_f1)),
    MemoryMetric("addition_recall", "", "higher", _of_counts(lambda counts: (counts.additions_done, counts.additions))),
    MemoryMetric("move_recall", "", "higher", _of_counts(lambda counts: (counts.moves_done, counts.moves))),
    MemoryMetric(
        "false_forgets", "%", "lower", _of_counts(lambda counts: (counts.false_forgets, counts.standing), 100.0)
    ),
    MemoryMetric(
        "false_forgets_at_end",
        "%",
        "lower",
        _of_counts(lambda counts: (counts.false_forgets_at_end, counts.standing), 100.0),
    ),
    MemoryMetric("duplicates", "%", "lower", _of_counts(lambda counts: (counts.duplicates, counts.remembered), 100.0)),
    MemoryMetric("precision", "", "higher", _of_counts(lambda counts: (counts.right_entries, counts.entries))),
    MemoryMetric("recall", "", "higher", _of_counts(lambda counts: (counts.seen_remembered, counts.seen))),
    MemoryMetric("change_f1", "", "higher", _of_counts(lambda counts: _f1(counts.gone, counts.come))),
    MemoryMetric("disappeared_f1", "", "higher", _of_counts(lambda counts: _f1(counts.gone))),
    MemoryMetric("appeared_f1", "", "higher", _of_counts(lambda counts: _f1(counts.come))),
]
_STALENESS = [
    MemoryMetric("half_life_frames", "frames", "lower", _half_life("evident", "frames")),
    MemoryMetric("half_life_evidence_frames", "frames", "lower", _half_life("evident", "evidence_frames")),
    MemoryMetric("half_life_s", "s", "lower", _half_life("evident", "seconds")),
    MemoryMetric("half_life_m", "m", "lower", _half_life("evident", "metres")),
    MemoryMetric("half_life_unseen_frames", "frames", "lower", _half_life("unseen", "frames")),
    MemoryMetric("half_life_to_find_frames", "frames", "lower", _half_life("appeared", "frames")),
    MemoryMetric("never_cleared", "%", "lower", _not_over("evident")),
    MemoryMetric("never_found", "%", "lower", _not_over("appeared")),
]
_BELIEFS = [
    MemoryMetric("brier", "", "lower", _of_belief(lambda belief: belief.squared_error)),
    MemoryMetric("nll", "nats", "lower", _of_belief(lambda belief: belief.log_loss)),
    MemoryMetric("ece", "", "lower", _ece),
]
_STATES: tuple[QueryState, ...] = ("before", "after", "after_evidence")
_QUERIES = [
    figure
    for state in _STATES
    for figure in (
        MemoryMetric(f"hit_at_1_{state}", "%", "higher", _of_queries(state, lambda counts: counts.hits_at_1)),
        MemoryMetric(f"hit_at_5_{state}", "%", "higher", _of_queries(state, lambda counts: counts.hits_at_5)),
        MemoryMetric(f"mrr_{state}", "%", "higher", _of_queries(state, lambda counts: counts.reciprocal_ranks)),
    )
]
_REAL_TIME = MemoryMetric("real_time_factor", "", "higher", _mean(_speed("real_time_factor")), is_time=True)

METRICS: tuple[MemoryMetric, ...] = (
    *_TIMES,
    *_LARGEST,
    *_SLOPES,
    _REAL_TIME,
    *_SIZES,
    *_UPDATES,
    *_STALENESS,
    *_BELIEFS,
    *_QUERIES,
)
"""All figures; docs/memory-benchmark.md defines them."""

RATIOS: dict[str, Callable[[StreamResult], float | None]] = {
    **{
        f"{call}_{clock}_{name}_ms": _time(f"{call}_{clock}", f"{name}_ms")
        for call in ("observe", "locate")
        for clock in ("cpu", "wall")
        for name in ("p50", "p95")
    },
    "bytes_per_entry": _size("bytes_per_entry"),
    "peak_rss_mb": _size("peak_rss_mb"),
}
"""The values that are divided by the baseline's, by figure."""
