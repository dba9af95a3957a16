"""Compare two results: which figures are worse than before, beyond what the houses explain."""

from collections.abc import Iterator, Mapping

from evonav.memory_benchmark.aggregate import BASELINE, METRICS, Streams, bootstrap_of, paired, ratios
from evonav.memory_benchmark.records import BenchmarkResult
from evonav.statistics import BeforeAfter, Estimate

TIME_TOLERANCE = 1.25
"""Factor up to which a time is not worse: machines and days differ by so much, also relative to the baseline."""
_EPSILON = 1e-9


def against(now: BenchmarkResult, before: BenchmarkResult, baseline: str = BASELINE) -> list[BeforeAfter]:
    """Compare a result with an earlier one, memory by memory.

    A figure is worse if the interval of its difference lies on the bad side of zero. A time counts only relative to the
    baseline of its own run, and only beyond `TIME_TOLERANCE`; without the baseline in both results, times are left out.

    Args:
        baseline: Name of the memory that times are divided by.

    Returns:
        All figures that both results have, of the memories in both.
    """
    found: list[BeforeAfter] = []
    bases = [one.memories.get(baseline) for one in (now, before)]
    for memory, streams in now.memories.items():
        if (earlier := before.memories.get(memory)) is None:
            continue
        found += _failures(memory, streams, earlier)
        ours, theirs = paired(streams, earlier)
        if ours:
            found += _figures(memory, ours, theirs)
        if bases[0] is not None and bases[1] is not None and memory != baseline:
            found += _times(memory, ratios(ours, bases[0]), ratios(theirs, bases[1]))
    return found


def _failures(memory: str, now: Streams, before: Streams) -> Iterator[BeforeAfter]:
    both = {stream.stream for stream in now} & {stream.stream for stream in before}
    old, new = (sum(one.stream in both and one.failure is not None for one in streams) for streams in (before, now))
    yield BeforeAfter(f"{memory}: failed_streams", old, new, new > old, new < old)


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
    ci95 = new.minus(old).ci95
    low, high = ci95 if ci95 is not None else (new.value - old.value,) * 2
    is_up, is_down = is_large and low > _EPSILON, is_large and high < -_EPSILON
    is_worse, is_better = (is_down, is_up) if is_higher_better else (is_up, is_down)
    return BeforeAfter(name, old.value, new.value, is_worse, is_better, ci95)
