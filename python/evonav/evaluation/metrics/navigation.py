"""The paper's measures (Sec. C.2), per stage and over stages, with intervals.

Stages of a task share a memory and a house, so intervals resample *tasks*, not stages.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.errors import StoreError
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.significance import Interval, percentile_interval, wilson

SUCCESS_RADIUS_M = 2.0
NUM_RESAMPLES = 10_000
MAX_RESAMPLE_CELLS = 4_000_000
"""Resampled indices held at a time, to bound memory on full splits."""


def stage_spl(is_success: bool, path_length_m: float, reference_length_m: float) -> float:
    """`S L* / max(L, L*)`; 1 for a success that needed no step and took none (where the formula is 0/0)."""
    if not is_success:
        return 0.0
    longest_m = max(path_length_m, reference_length_m)
    return 1.0 if longest_m == 0.0 else reference_length_m / longest_m


def stage_soft_spl(
    start_distance_m: float, terminal_distance_m: float, path_length_m: float, reference_length_m: float
) -> float:
    """SPL with the share of the start distance covered in place of success (0 for an agent that ends farther away)."""
    progress = 1.0 if start_distance_m == 0.0 else max(0.0, 1.0 - terminal_distance_m / start_distance_m)
    longest_m = max(path_length_m, reference_length_m)
    return progress * (1.0 if longest_m == 0.0 else reference_length_m / longest_m)


@dataclass(frozen=True, slots=True)
class Rates:
    """SR and SPL over a set of scored stages; `None` where there are none."""

    n: int
    sr: float | None
    spl: float | None
    sr_ci95: Interval | None = None
    """Percentile bootstrap over tasks."""
    spl_ci95: Interval | None = None
    """Percentile bootstrap over tasks."""
    sr_wilson95: Interval | None = None
    """Wilson's score interval, as if stages were independent: for comparison with tables that give `n` alone."""


@dataclass(frozen=True, slots=True)
class AgentSummary:
    """One row of a table."""

    agent: str
    n: int
    """Scored stages: success or failure."""
    sr: float | None
    spl: float | None
    sr_ci95: Interval | None
    spl_ci95: Interval | None
    sr_wilson95: Interval | None
    soft_spl: float | None
    counts: dict[str, int]
    """Stages by end state; every stage of the run is in exactly one."""
    is_incomplete: bool
    """Some stage is errored or not run: no rate of this row may be quoted as final."""
    num_stages: int
    num_tasks: int
    num_stopped: int
    mean_path_length_m: float | None
    mean_terminal_distance_m: float | None
    splits: dict[str, Rates] = field(default_factory=dict)
    """`stage_1`, `relocated`, `not_relocated` (the paper's strata: stages 2 and on), and one per evolution mode."""


@dataclass(frozen=True, slots=True)
class PairedDifference:
    """Agent `b` less agent `a`, on the stages that both scored; intervals resample tasks."""

    a: str
    b: str
    n: int
    num_tasks: int
    sr: float
    sr_ci95: Interval
    spl: float
    spl_ci95: Interval
    num_only_a: int
    """Stages where only `a` succeeded."""
    num_only_b: int


def bootstrap_means(values: NDArray[np.float64], tasks: Sequence[str], *, seed: int = 0) -> NDArray[np.float64]:
    """95% intervals of column means, resampling tasks with replacement; widened for few (`percentile_interval`).

    Args:
        values: `(N, D)`, one row a stage.
        tasks: `N` task ids; rows of one task are drawn together.
        seed: Of the resampling.

    Returns:
        `(D, 2)` lower and upper ends.
    """
    names = sorted(set(tasks))
    index = {name: i for i, name in enumerate(names)}
    rows = np.fromiter((index[task] for task in tasks), dtype=np.int64, count=len(tasks))
    sums = np.zeros((len(names), values.shape[1]))
    np.add.at(sums, rows, values)
    sizes = np.bincount(rows, minlength=len(names)).astype(np.float64)
    generator = np.random.Generator(np.random.PCG64(seed))
    means = np.empty((NUM_RESAMPLES, values.shape[1]))
    chunk = max(1, MAX_RESAMPLE_CELLS // len(names))
    for start in range(0, NUM_RESAMPLES, chunk):
        count = min(chunk, NUM_RESAMPLES - start)
        drawn = generator.integers(0, len(names), size=(count, len(names)))
        means[start : start + count] = sums[drawn].sum(axis=1) / sizes[drawn].sum(axis=1)[:, None]
    return percentile_interval(means, len(names))


def rates(records: Sequence[StageRecord]) -> Rates:
    """SR and SPL over the scored stages among `records`."""
    scored = [record for record in records if record.is_scored]
    if not scored:
        return Rates(n=0, sr=None, spl=None)
    values = _success_and_spl(scored)
    sr, spl = (float(mean) for mean in values.mean(axis=0))
    ends = bootstrap_means(values, [record.task_id for record in scored])
    return Rates(
        n=len(scored),
        sr=sr,
        spl=spl,
        sr_ci95=_interval(ends[0]),
        spl_ci95=_interval(ends[1]),
        sr_wilson95=wilson(int(values[:, 0].sum()), len(scored)),
    )


def summarise(agent: str, records: Sequence[StageRecord], num_stages: int) -> AgentSummary:
    """One table row. Stages of the run without a record count as not run.

    Raises:
        StoreError: There are more records than stages, or two of one stage: the states would not add up to the run.
    """
    if len({(record.task_id, record.stage) for record in records}) != len(records) or len(records) > num_stages:
        raise StoreError(f"{agent}: {len(records)} records of {num_stages} stages, each at most once: not a run's")
    counts = Counter(record.state for record in records)
    counts[EndState.NOT_RUN] += num_stages - len(records)
    scored = [record for record in records if record.is_scored]
    overall = rates(scored)
    return AgentSummary(
        agent=agent,
        n=overall.n,
        sr=overall.sr,
        spl=overall.spl,
        sr_ci95=overall.sr_ci95,
        spl_ci95=overall.spl_ci95,
        sr_wilson95=overall.sr_wilson95,
        soft_spl=_mean(record.soft_spl for record in scored),
        counts={state.value: counts[state] for state in EndState if state is not EndState.FORCED or counts[state]},
        is_incomplete=overall.n + counts[EndState.FORCED] != num_stages,
        num_stages=num_stages,
        num_tasks=len({record.task_id for record in records}),
        num_stopped=sum(record.has_stopped for record in scored),
        mean_path_length_m=_mean(record.path_length_m for record in scored),
        mean_terminal_distance_m=_mean(record.terminal_distance_m for record in scored),
        splits={name: rates(part) for name, part in _splits(scored).items()},
    )


def paired_differences(records_by_agent: dict[str, list[StageRecord]]) -> list[PairedDifference]:
    """Every pair of agents on the stages that both scored."""
    scored = {
        agent: {(record.task_id, record.stage): record for record in records if record.is_scored}
        for agent, records in records_by_agent.items()
    }
    agents = list(scored)
    differences = []
    for i, a in enumerate(agents):
        for b in agents[i + 1 :]:
            keys = sorted(scored[a].keys() & scored[b].keys())
            if not keys:
                continue
            values_a = _success_and_spl([scored[a][key] for key in keys])
            values_b = _success_and_spl([scored[b][key] for key in keys])
            difference = values_b - values_a
            ends = bootstrap_means(difference, [task_id for task_id, _ in keys])
            sr, spl = (float(mean) for mean in difference.mean(axis=0))
            differences.append(
                PairedDifference(
                    a=a,
                    b=b,
                    n=len(keys),
                    num_tasks=len({task_id for task_id, _ in keys}),
                    sr=sr,
                    sr_ci95=_interval(ends[0]),
                    spl=spl,
                    spl_ci95=_interval(ends[1]),
                    num_only_a=int((difference[:, 0] < 0).sum()),
                    num_only_b=int((difference[:, 0] > 0).sum()),
                )
            )
    return differences


def summary_json(summaries: Sequence[AgentSummary], pairs: Sequence[PairedDifference]) -> dict[str, Any]:
    """The content of `summary.json`."""
    return {
        "schema_version": 1,
        "is_incomplete": any(summary.is_incomplete for summary in summaries),
        "agents": {summary.agent: asdict(summary) for summary in summaries},
        "paired_differences": [asdict(pair) for pair in pairs],
    }


def _splits(scored: Sequence[StageRecord]) -> dict[str, list[StageRecord]]:
    splits: dict[str, list[StageRecord]] = defaultdict(list)
    for record in scored:
        if record.stage == 1:
            splits["stage_1"].append(record)
            continue
        splits["relocated" if record.target.is_relocated else "not_relocated"].append(record)
        splits[record.transition.kind].append(record)
    return dict(sorted(splits.items()))


def _success_and_spl(scored: Sequence[StageRecord]) -> NDArray[np.float64]:
    rows = [(float(record.state is EndState.SUCCESS), record.spl or 0.0) for record in scored]
    return np.array(rows, dtype=np.float64)


def _interval(ends: NDArray[np.float64]) -> Interval:
    return (float(ends[0]), float(ends[1]))


def _mean(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None
