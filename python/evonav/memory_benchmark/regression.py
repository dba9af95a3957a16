"""Compare two results: which figures are worse than before, beyond what the houses explain."""

from collections.abc import Iterator

from evonav.memory_benchmark.aggregate import BASELINE, METRICS, bootstrap_of, paired, ratios
from evonav.memory_benchmark.records import BenchmarkResult, MemoryResult
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
    earlier = {result.memory: result for result in before.memories}
    bases = [next((one for one in result.memories if one.memory == baseline), None) for result in (now, before)]
    found: list[BeforeAfter] = []
    for result in now.memories:
        if (old := earlier.get(result.memory)) is None:
            continue
        found += _failures(result, old)
        found += _figures(result, old)
        if bases[0] is not None and bases[1] is not None and result.memory != baseline:
            found += _times(result, old, bases[0], bases[1])
    return found


def _failures(now: MemoryResult, before: MemoryResult) -> Iterator[BeforeAfter]:
    names = {stream.stream for stream in now.streams} & {stream.stream for stream in before.streams}
    counts = [sum(stream.stream in names for stream in result.failures) for result in (before, now)]
    old, new = counts
    yield BeforeAfter(f"{now.memory}: failed_streams", old, new, new > old, new < old)


def _figures(now: MemoryResult, before: MemoryResult) -> Iterator[BeforeAfter]:
    ours, theirs = paired(now.streams, before.streams)
    if not ours:
        return
    bootstrap = bootstrap_of(ours)
    for name, metric in METRICS.items():
        if metric.is_time:
            continue
        new, old = metric.estimate(ours, bootstrap), metric.estimate(theirs, bootstrap)
        if new.value is not None and old.value is not None:
            yield _difference(f"{now.memory}: {name}", new, old, is_higher_better=metric.is_higher_better)


def _times(
    now: MemoryResult, before: MemoryResult, base_now: MemoryResult, base_before: MemoryResult
) -> Iterator[BeforeAfter]:
    ours, theirs = paired(now.streams, before.streams)
    new_ratios = ratios(now.model_copy(update={"streams": tuple(ours)}), base_now)
    old_ratios = ratios(before.model_copy(update={"streams": tuple(theirs)}), base_before)
    for name in (name for name in new_ratios if name in old_ratios and METRICS[name].is_time):
        values = [found[name].value or 0.0 for found in (new_ratios, old_ratios)]
        is_large = max(values) > TIME_TOLERANCE * min(values)
        yield _difference(f"{now.memory}: {name}", new_ratios[name], old_ratios[name], is_large=is_large)


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
