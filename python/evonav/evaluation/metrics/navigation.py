"""Compute the paper's metrics (Sec. C.2) over stages, with intervals.

Stages of a house are not independent, so intervals and verdicts are by house (`evonav.statistics`).
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.errors import StoreError
from evonav.evaluation.metrics.stage_metrics import RecordMetrics
from evonav.evaluation.records.schema import EndState
from evonav.statistics import ClusterBootstrap, Interval, PairedEffect, paired_effects, wilson, with_holm


def house_of(row: RecordMetrics) -> str:
    """Return the house that a stage is resampled with; its task where the record does not name a house."""
    return row.house or row.task_id


@dataclass(frozen=True, slots=True)
class Rates:
    """SR and SPL over a set of scored stages; `None` where there are none."""

    n: int
    """Scored stages: success or failure."""
    sr: float | None
    spl: float | None
    sr_ci95: Interval | None = None
    """Bootstrap by house (`ClusterBootstrap`); `None` of one house, or where all of them agree."""
    spl_ci95: Interval | None = None
    """Bootstrap by house, as `sr_ci95`."""
    sr_wilson95: Interval | None = None
    """Wilson's score interval, as if stages were independent: for comparison with tables that give `n` alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AgentSummary(Rates):
    """One row of a table: an agent's rates over all scored stages, and what lies behind them."""

    agent: str
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

    def rates(self, split: str = "all") -> Rates:
        """Return the rates over a split of the scored stages, by default over all of them."""
        return self if split == "all" else self.splits.get(split, Rates(n=0, sr=None, spl=None))


@dataclass(frozen=True, slots=True)
class AgentPair:
    """Agent `b` against agent `a`, on the stages that both scored."""

    a: str
    b: str
    num_tasks: int
    num_only_a: int
    """Stages where only `a` succeeded."""
    num_only_b: int
    sr: PairedEffect
    """The effect of `b` less `a`, as all effects here. Its verdict allows for the number of pairs, by Holm."""
    spl: PairedEffect

    @property
    def n(self) -> int:
        """Stages that both scored."""
        return self.sr.n


def rates(rows: Sequence[RecordMetrics]) -> Rates:
    """Return SR and SPL over the scored stages among `rows`."""
    scored = [row for row in rows if row.is_scored]
    if not scored:
        return Rates(n=0, sr=None, spl=None)
    values = success_and_spl(scored)
    sr, spl = ClusterBootstrap([house_of(row) for row in scored]).column_means(values)
    return Rates(
        n=len(scored),
        sr=sr.value,
        spl=spl.value,
        sr_ci95=sr.ci95,
        spl_ci95=spl.ci95,
        sr_wilson95=wilson(int(values[:, 0].sum()), len(scored)),
    )


def summarise(agent: str, rows: Sequence[RecordMetrics], num_stages: int) -> AgentSummary:
    """Summarise an agent as a table row. Stages of the run without a record count as not run.

    Raises:
        StoreError: There are more records than stages, or two of one stage: the states would not add up to the run.
    """
    if len({(row.task_id, row.stage) for row in rows}) != len(rows) or len(rows) > num_stages:
        raise StoreError(f"{agent}: {len(rows)} records of {num_stages} stages, each at most once: not a run's")
    counts = Counter(EndState(row.state) for row in rows)
    counts[EndState.NOT_RUN] += num_stages - len(rows)
    scored = [row for row in rows if row.is_scored]
    overall = rates(scored)
    return AgentSummary(
        **asdict(overall),
        agent=agent,
        soft_spl=_mean(row.soft_spl for row in scored),
        counts={state.value: counts[state] for state in EndState if state is not EndState.GUIDED or counts[state]},
        is_incomplete=overall.n + counts[EndState.GUIDED] != num_stages,
        num_stages=num_stages,
        num_tasks=len({row.task_id for row in rows}),
        num_stopped=sum(row.has_stopped for row in scored),
        mean_path_length_m=_mean(row.path_length_m for row in scored),
        mean_terminal_distance_m=_mean(row.terminal_distance_m for row in scored),
        splits={name: rates(part) for name, part in _splits(scored).items()},
    )


def agent_pairs(rows_by_agent: Mapping[str, Sequence[RecordMetrics]]) -> list[AgentPair]:
    """Compare every two agents on the stages that both scored; two without such a stage are left out."""
    scored = {
        agent: {(row.task_id, row.stage): row for row in rows if row.is_scored} for agent, rows in rows_by_agent.items()
    }
    pairs = [
        _agent_pair(a, b, [(scored[a][key], scored[b][key]) for key in sorted(scored[a].keys() & scored[b].keys())])
        for a, b in combinations(scored, 2)
        if scored[a].keys() & scored[b].keys()
    ]
    srs, spls = with_holm([pair.sr for pair in pairs]), with_holm([pair.spl for pair in pairs])
    return [replace(pair, sr=sr, spl=spl) for pair, sr, spl in zip(pairs, srs, spls, strict=True)]


def _agent_pair(a: str, b: str, stages: Sequence[tuple[RecordMetrics, RecordMetrics]]) -> AgentPair:
    values_a, values_b = (success_and_spl(rows) for rows in zip(*stages, strict=True))
    sr, spl = paired_effects(values_a, values_b, [house_of(row) for row, _ in stages])
    return AgentPair(
        a=a,
        b=b,
        num_tasks=len({row.task_id for row, _ in stages}),
        num_only_a=int((values_a[:, 0] > values_b[:, 0]).sum()),
        num_only_b=int((values_b[:, 0] > values_a[:, 0]).sum()),
        sr=sr,
        spl=spl,
    )


def summary_json(summaries: Sequence[AgentSummary], pairs: Sequence[AgentPair]) -> dict[str, Any]:
    """Return the content of `summary.json`."""
    return {
        "schema_version": 1,
        "is_incomplete": any(summary.is_incomplete for summary in summaries),
        "agents": {summary.agent: asdict(summary) for summary in summaries},
        "paired_differences": [
            {
                "a": pair.a,
                "b": pair.b,
                "n": pair.n,
                "num_tasks": pair.num_tasks,
                "num_houses": pair.sr.num_clusters,
                **_effect_json("sr", pair.sr),
                **_effect_json("spl", pair.spl),
                "num_only_a": pair.num_only_a,
                "num_only_b": pair.num_only_b,
            }
            for pair in pairs
        ],
    }


def _effect_json(name: str, effect: PairedEffect) -> dict[str, Any]:
    return {
        name: effect.difference,
        f"{name}_ci95": effect.ci95,
        f"{name}_p": effect.p,
        f"{name}_holm_p": effect.adjusted_p,
        f"{name}_verdict": effect.verdict,
    }


def _splits(scored: Sequence[RecordMetrics]) -> dict[str, list[RecordMetrics]]:
    splits: dict[str, list[RecordMetrics]] = defaultdict(list)
    has_changes = any(row.during is not None for row in scored)
    for row in scored:
        if has_changes:
            splits[row.during or "unchanged_during"].append(row)
        splits[row.stratum].append(row)
        if row.stage > 1:
            splits[row.mode].append(row)
    return dict(sorted(splits.items()))


def success_and_spl(scored: Sequence[RecordMetrics]) -> NDArray[np.float64]:
    """Return `(N, 2)` success, 0 or 1, and SPL of scored stages."""
    rows = [(float(row.state == EndState.SUCCESS), row.spl or 0.0) for row in scored]
    return np.array(rows, dtype=np.float64)


def _mean(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None
