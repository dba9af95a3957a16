"""Read one flat row per stage of a run, the source of all tables, exports and comparisons, by docs/metrics.md.

The store holds the metrics of each record beside it, so no trace is parsed.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from evonav.evaluation.metrics.stage_metrics import COUNTERS, RecordMetrics, StageMetrics
from evonav.evaluation.records.store import RunStore


@dataclass(frozen=True, slots=True)
class _StoredMetrics:
    """The metrics of a record as the store holds them."""

    metrics: RecordMetrics
    counters: dict[str, int]
    """The agent's cumulative counters at the end of the stage."""
    is_fresh: bool
    """The agent began again in this stage, and its counters with it."""


def read_stage_metrics(store: RunStore, agents: Sequence[str] | None = None) -> list[StageMetrics]:
    """Return a row for every recorded stage, by agent, task and stage.

    Args:
        store: The store of a run, finished or not.
        agents: The agents to read; default: all.

    Raises:
        StoreError: The run cannot be read.
    """
    stored = _stored_metrics(store, agents)
    costs, timings, retries = store.costs(), store.timings(), store.retries()
    rows: list[StageMetrics] = []
    for _, episode in groupby(stored, key=lambda one: (one.metrics.agent, one.metrics.task_id)):
        before: _StoredMetrics | None = None
        counted: dict[str, int] = {}
        for one in episode:
            key = (one.metrics.agent, one.metrics.task_id, one.metrics.stage)
            counted = {} if one.is_fresh else counted
            follows = before is not None and before.metrics.stage == one.metrics.stage - 1
            wall_s, cpu_s = timings.get(key, (None, None))
            values: dict[str, Any] = {
                **vars(one.metrics),
                "wall_s": wall_s,
                "cpu_s": cpu_s,
                **costs.get(key, {}),
                "num_retries": retries[key],
                **{
                    field: one.counters[name] - counted.get(name, 0) if name in one.counters else None
                    for name, field in COUNTERS.items()
                },
                "precision_before": before.metrics.precision if before is not None and follows else None,
            }
            rows.append(StageMetrics(**values))
            before, counted = one, {**counted, **one.counters}
    return rows


def _stored_metrics(store: RunStore, agents: Sequence[str] | None) -> Iterator[_StoredMetrics]:
    """Yield metrics by agent, task and stage."""
    wanted = None if agents is None else set(agents)
    for (agent, _, _), text in store.encoded_metrics():
        if wanted is None or agent in wanted:
            values = json.loads(text)
            yield _StoredMetrics(RecordMetrics(**values["metrics"]), values["counters"], values["is_fresh"])
