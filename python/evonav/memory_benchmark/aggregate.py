"""Aggregate results over streams, every figure with its 95% interval over houses, and compare two results."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evonav.memory_benchmark.metrics.counts import NUM_BINS, calibration_error
from evonav.memory_benchmark.metrics.spells import Clock, SpellKind, durations_of, half_life, risk_table, survival
from evonav.memory_benchmark.records import BenchmarkResult, StreamResult, judged
from evonav.statistics import BeforeAfter, ClusterBootstrap, Estimate

BASELINE = "never"
"""The memory that others are compared with: it integrates and never forgets."""

NUM_RESAMPLES = 2_000
"""Resamples of houses: five of them have only 126 different ones."""

Streams = Sequence[StreamResult]
Estimator = Callable[[Streams, ClusterBootstrap], Estimate]


@dataclass(frozen=True, slots=True)
class MemoryMetric:
    """One number of a memory."""

    estimate: Estimator
    is_higher_better: bool = False
    is_time: bool = False
    """Whether it depends on the machine."""


def estimates(streams: Streams, kind: str | None = None) -> dict[str, Estimate]:
    """Return all figures that a memory's streams give, by name.

    Args:
        kind: Kind of streams, such as `S1`; default: all. Streams in which it failed are left out.
    """
    streams = judged(streams, kind)
    if not streams:
        return {}
    bootstrap = bootstrap_of(streams)
    found = {name: metric.estimate(streams, bootstrap) for name, metric in METRICS.items()}
    return {name: estimate for name, estimate in found.items() if estimate.value is not None}


def bootstrap_of(streams: Streams) -> ClusterBootstrap:
    """Return the resamples of the houses of some streams."""
    return ClusterBootstrap([stream.house for stream in streams], num_resamples=NUM_RESAMPLES)


def paired(ours: Streams, theirs: Streams, kind: str | None = None) -> tuple[list[StreamResult], list[StreamResult]]:
    """Return the streams that both have and in which neither failed, in the same order."""
    others = {stream.stream: stream for stream in judged(theirs)}
    both = [stream for stream in judged(ours, kind) if stream.stream in others]
    return both, [others[stream.stream] for stream in both]


def ratios(streams: Streams, baseline: Streams, kind: str | None = None) -> dict[str, Estimate]:
    """Return times and sizes of a memory divided by those of another in the same run, over the streams of both.

    Args:
        baseline: Streams of the other one, `BASELINE` in tables.
        kind: Kind of streams; default: all.
    """
    ours, theirs = paired(streams, baseline, kind)
    if not ours:
        return {}
    bootstrap = bootstrap_of(ours)
    found = {}
    for name, path in RATIOS.items():
        pairs = [(_value(one, path), _value(other, path)) for one, other in zip(ours, theirs, strict=True)]
        values = np.array([(a, b) if a is not None and b is not None else (0.0, 0.0) for a, b in pairs])
        sums = bootstrap.sums(values)
        estimate = bootstrap.ratio(sums[:, 0], sums[:, 1], int(np.count_nonzero(values[:, 1])))
        if estimate.value is not None:
            found[name] = estimate
    return found


def _value(stream: StreamResult, path: str) -> float | None:
    """Return a number of a record, such as `speed.observe_cpu.p95_ms`; `None` where a part of the path is missing."""
    value: Any = stream
    for name in path.split("."):
        value = value.get(name) if isinstance(value, dict) else getattr(value, name)
        if value is None:
            return None
    return float(value)


# Ways to take an estimate


def _mean(path: str) -> Estimator:
    """Take the mean over streams that have the value."""

    def estimate(streams: Streams, bootstrap: ClusterBootstrap) -> Estimate:
        values = [_value(stream, path) for stream in streams]
        sums = bootstrap.sums(np.array([(0.0, 0.0) if value is None else (value, 1.0) for value in values]))
        return bootstrap.ratio(sums[:, 0], sums[:, 1], int(sums[:, 1].sum()))

    return estimate


def _largest(path: str) -> Estimator:
    def estimate(streams: Streams, bootstrap: ClusterBootstrap) -> Estimate:
        values = [value for stream in streams if (value := _value(stream, path)) is not None]
        return Estimate(max(values, default=None), None, len(values), bootstrap.num_clusters)

    return estimate


def _share(above: str, below: str, scale: float = 1.0) -> Estimator:
    """Take a ratio of sums over streams; each of both is a sum of numbers of a record: `update.moves + update.seen`."""

    def estimate(streams: Streams, bootstrap: ClusterBootstrap) -> Estimate:
        rows = np.array([[_sum(stream, paths) for paths in (above, below)] for stream in streams])
        sums = bootstrap.sums(rows)
        return bootstrap.ratio(scale * sums[:, 0], sums[:, 1], round(float(rows[:, 1].sum())))

    return estimate


def _sum(stream: StreamResult, paths: str) -> float:
    return sum(_value(stream, path) or 0.0 for path in paths.split(" + "))


def _f1(*claims: str) -> Estimator:
    """Take 2 TP / (2 TP + FP + FN) over claims of some sorts."""
    twice = " + ".join(f"update.{claim}.hits + update.{claim}.hits" for claim in claims)
    wrong = " + ".join(f"update.{claim}.false_alarms + update.{claim}.misses" for claim in claims)
    return _share(twice, f"{twice} + {wrong}")


def _half_life(kind: SpellKind, clock: Clock) -> Estimator:
    def estimate(streams: Streams, bootstrap: ClusterBootstrap) -> Estimate:
        parts = [durations_of(stream.spells, kind, clock) for stream in streams]
        durations, is_over = (np.concatenate(column) for column in zip(*parts, strict=True))
        if not durations.size:
            return Estimate(None, None, 0, bootstrap.num_clusters)
        houses = np.repeat(bootstrap.cluster_of, [len(part[0]) for part in parts])
        ends, at_risk, over = risk_table(durations, is_over)
        sums = bootstrap.sums(np.hstack([at_risk, over]), houses)
        half_lives = [
            half_life(ends, survival(totals[..., : len(ends)], totals[..., len(ends) :]))
            for totals in (sums.sum(axis=0), bootstrap.resampled_sums(sums))
        ]
        return bootstrap.estimate(float(half_lives[0]), half_lives[1], len(durations))

    return estimate


def _not_over(kind: SpellKind) -> Estimator:
    def estimate(streams: Streams, bootstrap: ClusterBootstrap) -> Estimate:
        ended = [durations_of(stream.spells, kind, "frames")[1] for stream in streams]
        sums = bootstrap.sums([(float((~is_over).sum()), float(len(is_over))) for is_over in ended])
        return bootstrap.ratio(100.0 * sums[:, 0], sums[:, 1], round(float(sums[:, 1].sum())))

    return estimate


def _ece(streams: Streams, bootstrap: ClusterBootstrap) -> Estimate:
    empty = np.zeros((NUM_BINS, 3))
    rows = np.array([empty if stream.belief is None else stream.belief.bins for stream in streams])
    sums = bootstrap.sums(rows.reshape(len(streams), -1))
    total = sums.sum(axis=0).reshape(NUM_BINS, 3)
    if not total[:, 0].sum():
        return Estimate(None, None, 0, bootstrap.num_clusters)
    resampled = bootstrap.resampled_sums(sums).reshape(-1, NUM_BINS, 3)
    return bootstrap.estimate(float(calibration_error(total)), calibration_error(resampled), int(total[:, 0].sum()))


_TIMED = [f"{call}_{clock}" for call in ("observe", "locate") for clock in ("cpu", "wall")]
_DONE = "update.removals_done"

METRICS: dict[str, MemoryMetric] = {
    **{
        f"{timed}_{name}_ms": MemoryMetric(_mean(f"speed.{timed}.{name}_ms"), is_time=True)
        for timed in _TIMED
        for name in ("p50", "p95", "p99")
    },
    **{f"{timed}_max_ms": MemoryMetric(_largest(f"speed.{timed}.max_ms"), is_time=True) for timed in _TIMED},
    "slope_per_100_entries_ms": MemoryMetric(_mean("speed.slope_per_100_entries_ms"), is_time=True),
    "slope_per_1000_frames_ms": MemoryMetric(_mean("speed.slope_per_1000_frames_ms"), is_time=True),
    "real_time_factor": MemoryMetric(_mean("speed.real_time_factor"), is_higher_better=True, is_time=True),
    "bytes_per_entry": MemoryMetric(_mean("size.bytes_per_entry")),
    "rss_growth_mb_per_minute": MemoryMetric(_mean("size.rss_growth_mb_per_minute"), is_time=True),
    "peak_rss_mb": MemoryMetric(_largest("size.peak_rss_mb"), is_time=True),
    **{
        name: MemoryMetric(estimator, is_higher_better=True)
        for name, estimator in {
            "removal_precision": _share(_DONE, f"{_DONE} + update.false_forgets"),
            "removal_recall": _share(_DONE, "update.removals"),
            "removal_f1": _share(f"{_DONE} + {_DONE}", f"{_DONE} + update.removals + update.false_forgets"),
            "addition_recall": _share("update.additions_done", "update.additions"),
            "move_recall": _share("update.moves_done", "update.moves"),
            "precision": _share("update.right_entries", "update.entries"),
            "recall": _share("update.seen_remembered", "update.seen"),
            "change_f1": _f1("gone", "come"),
            "disappeared_f1": _f1("gone"),
            "appeared_f1": _f1("come"),
        }.items()
    },
    "false_forgets": MemoryMetric(_share("update.false_forgets", "update.standing", 100.0)),
    "false_forgets_at_end": MemoryMetric(_share("update.false_forgets_at_end", "update.standing", 100.0)),
    "duplicates": MemoryMetric(_share("update.duplicates", "update.remembered", 100.0)),
    "half_life_frames": MemoryMetric(_half_life("evident", "frames")),
    "half_life_evidence_frames": MemoryMetric(_half_life("evident", "evidence_frames")),
    "half_life_s": MemoryMetric(_half_life("evident", "seconds")),
    "half_life_m": MemoryMetric(_half_life("evident", "metres")),
    "half_life_unseen_frames": MemoryMetric(_half_life("unseen", "frames")),
    "half_life_to_find_frames": MemoryMetric(_half_life("appeared", "frames")),
    "never_cleared": MemoryMetric(_not_over("evident")),
    "never_found": MemoryMetric(_not_over("appeared")),
    "brier": MemoryMetric(_share("belief.squared_error", "belief.n")),
    "nll": MemoryMetric(_share("belief.log_loss", "belief.n")),
    "ece": MemoryMetric(_ece),
    **{
        f"{name}_{state}": MemoryMetric(
            _share(f"queries.{state}.{counts}", f"queries.{state}.n", 100.0), is_higher_better=True
        )
        for state in ("before", "after", "after_evidence")
        for name, counts in (("hit_at_1", "hits_at_1"), ("hit_at_5", "hits_at_5"), ("mrr", "reciprocal_ranks"))
    },
}
"""All figures by name; docs/memory-benchmark-metrics.md defines them."""

RATIOS: dict[str, str] = {
    **{f"{timed}_{name}_ms": f"speed.{timed}.{name}_ms" for timed in _TIMED for name in ("p50", "p95")},
    "bytes_per_entry": "size.bytes_per_entry",
    "peak_rss_mb": "size.peak_rss_mb",
}
"""The values that are divided by the baseline's, by figure."""

TIME_TOLERANCE = 1.25
"""Factor up to which a time is not worse: machines and days differ by so much, also relative to the baseline."""
_EPSILON = 1e-9


def against(now: BenchmarkResult, before: BenchmarkResult) -> list[BeforeAfter]:
    """Compare a result with an earlier one, memory by memory.

    A figure is worse if the interval of its difference lies on the bad side of zero. A time counts only relative to the
    baseline of its own run, and only beyond `TIME_TOLERANCE`; without the baseline in both results, times are left out.

    Returns:
        All figures that both results have, of the memories in both.
    """
    found: list[BeforeAfter] = []
    bases = [one.memories.get(BASELINE) for one in (now, before)]
    for memory, streams in now.memories.items():
        if (earlier := before.memories.get(memory)) is None:
            continue
        found += _failures(memory, streams, earlier)
        ours, theirs = paired(streams, earlier)
        if ours:
            found += _figures(memory, ours, theirs)
        if bases[0] is not None and bases[1] is not None and memory != BASELINE:
            found += _times(memory, ratios(ours, bases[0]), ratios(theirs, bases[1]))
    return found


def _failures(memory: str, now: Streams, before: Streams) -> Iterator[BeforeAfter]:
    both = {stream.stream for stream in now} & {stream.stream for stream in before}
    old, new = (sum(one.stream in both and one.failure is not None for one in streams) for streams in (before, now))
    yield BeforeAfter(f"{memory}: failed_streams", old, new, new > old)


def _figures(memory: str, ours: Streams, theirs: Streams) -> Iterator[BeforeAfter]:
    bootstrap = bootstrap_of(ours)
    for name, metric in METRICS.items():
        if metric.is_time:
            continue
        new, old = metric.estimate(ours, bootstrap), metric.estimate(theirs, bootstrap)
        if new.value is not None and old.value is not None:
            yield _difference(f"{memory}: {name}", new, old, is_higher_better=metric.is_higher_better)


def _times(memory: str, now: Mapping[str, Estimate], before: Mapping[str, Estimate]) -> Iterator[BeforeAfter]:
    for name in (name for name in now if name in before and METRICS[name].is_time):
        values = [found[name].value or 0.0 for found in (now, before)]
        is_large = max(values) > TIME_TOLERANCE * min(values)
        yield _difference(f"{memory}: {name}", now[name], before[name], is_large=is_large)


def _difference(
    name: str, new: Estimate, old: Estimate, *, is_higher_better: bool = False, is_large: bool = True
) -> BeforeAfter:
    assert new.value is not None
    assert old.value is not None
    if new.value == old.value:  # also of two infinite ones
        return BeforeAfter(name, old.value, new.value, is_worse=False)
    low, high = new.minus(old).ci95 or (new.value - old.value,) * 2
    is_worse = is_large and (high < -_EPSILON if is_higher_better else low > _EPSILON)
    return BeforeAfter(name, old.value, new.value, is_worse)
