"""Aggregate the metrics of `StageMetrics` for every agent, with intervals over houses.

Every value is a ratio of sums over stages: a share divides a count by the largest possible count, and a mean divides
the sum of a metric by the number of stages that have one. Intervals are by house (`evonav.statistics`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from evonav.evaluation.metrics.navigation import house_of
from evonav.evaluation.metrics.stage_metrics import StageMetrics
from evonav.statistics import ClusterBootstrap, Estimate

RADII_M = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
"""Radii at which success is computed."""

Unit = Literal["%", "", "m", "rounds", "s", "$", "MB"]
Part = tuple[float, float] | None
"""A stage's contribution to numerator and denominator; `None` if the metric does not apply."""


@dataclass(frozen=True, slots=True)
class AggregateMetric:
    """A metric of an agent over stages: a row of a table."""

    name: str
    label: str
    unit: Unit
    part: Callable[[StageMetrics], Part]


def _ratio(
    value: str, weight: str | None, numerator: Callable[[float, float], float]
) -> Callable[[StageMetrics], Part]:
    """Return a stage's parts of a ratio of two fields; the denominator is `weight`, by default 1."""

    def part(row: StageMetrics) -> Part:
        found, num = getattr(row, value), 1.0 if weight is None else getattr(row, weight)
        return None if found is None or not num or not row.is_scored else (float(numerator(found, num)), float(num))

    return part


def _mean(value: str, weight: str | None = None) -> Callable[[StageMetrics], Part]:
    return _ratio(value, weight, lambda value, weight: value * weight)


def _share(num: str, among: str) -> Callable[[StageMetrics], Part]:
    return _ratio(num, among, lambda num, _: num)


def _rest(num: str, among: str) -> Callable[[StageMetrics], Part]:
    return _ratio(num, among, lambda num, among: among - num)


def _later(part: Callable[[StageMetrics], Part]) -> Callable[[StageMetrics], Part]:
    return lambda row: part(row) if row.stage > 1 else None


def _radius(radius_m: float) -> Callable[[StageMetrics], Part]:
    def part(row: StageMetrics) -> Part:
        is_success = row.is_success_at(radius_m)
        return None if is_success is None else (float(is_success), 1.0)

    return part


SUCCESS = (
    AggregateMetric("sr", "success (paper)", "%", _mean("success")),
    AggregateMetric("strict_sr", "strict success", "%", _mean("is_strict_success")),
    AggregateMetric("geodesic_sr", "geodesic success", "%", _mean("is_geodesic_success")),
    AggregateMetric("spl", "SPL", "%", _mean("spl")),
    AggregateMetric("ring_spl", "SPL to the radius", "%", _mean("ring_spl")),
    AggregateMetric("soft_spl", "SoftSPL", "%", _mean("soft_spl")),
    AggregateMetric("spl_after_change", "SPL from a change during the stage on", "%", _mean("spl_after_change")),
    *(
        AggregateMetric(f"sr_{radius_m:g}m", f"success at {radius_m:g} m", "%", _radius(radius_m))
        for radius_m in RADII_M
    ),
)
STALENESS = (
    AggregateMetric("stale_visits", "stale visits", "", _mean("num_stale_visits")),
    AggregateMetric("stale_path_m", "path for stale entries", "m", _mean("stale_path_m")),
    AggregateMetric("stale_path_share", "path for stale entries, share", "%", _share("stale_path_m", "path_length_m")),
    AggregateMetric(
        "stale_evident",
        "stale entries whose empty place was seen",
        "%",
        _share("num_stale_evident", "num_stale_at_start"),
    ),
    AggregateMetric(
        "stale_cleared", "such entries cleared in the stage", "%", _share("num_stale_cleared", "num_stale_evident")
    ),
    AggregateMetric("rounds_to_clear", "rounds until cleared", "rounds", _mean("rounds_to_clear", "num_stale_cleared")),
    AggregateMetric("metres_to_clear", "metres until cleared", "m", _mean("metres_to_clear", "num_stale_cleared")),
    AggregateMetric(
        "moved_found", "moved objects that were seen and got an entry", "%", _share("num_moved_found", "num_moved_seen")
    ),
    AggregateMetric("rounds_to_find", "rounds until they got it", "rounds", _mean("rounds_to_find", "num_moved_found")),
    AggregateMetric("forgotten", "objects forgotten", "", _later(_mean("num_forgotten"))),
)
MEMORY = (
    AggregateMetric("entries", "entries at the end", "", _mean("num_entries")),
    AggregateMetric("precision", "precision at the end", "%", _rest("num_stale_entries", "num_entries")),
    AggregateMetric("recall", "recall at the end", "%", _mean("recall")),
    AggregateMetric("precision_before", "precision before a change", "%", _mean("precision_before")),
    AggregateMetric("precision_at_start", "precision after a change", "%", _later(_mean("precision_at_start"))),
    AggregateMetric("recall_at_start", "recall after a change", "%", _later(_mean("recall_at_start"))),
    AggregateMetric("duplicates", "duplicates", "", _mean("num_duplicates")),
    AggregateMetric("position_error_m", "position error", "m", _mean("position_error_m")),
)
COSTS = (
    AggregateMetric("wall_s", "wall", "s", _mean("wall_s")),
    AggregateMetric("cpu_s", "CPU", "s", _mean("cpu_s")),
    AggregateMetric("simulation_cpu_s", "simulation", "s", _mean("simulation_cpu_s")),
    AggregateMetric("perception_cpu_s", "perception", "s", _mean("perception_cpu_s")),
    AggregateMetric("agent_cpu_s", "agent", "s", _mean("agent_cpu_s")),
    AggregateMetric("decision_cpu_s", "of it decisions", "s", _mean("decision_cpu_s")),
    AggregateMetric("evaluator_cpu_s", "evaluator", "s", _mean("evaluator_cpu_s")),
    AggregateMetric("questions", "questions", "", _mean("num_questions")),
    AggregateMetric("input_tokens", "tokens in", "", _mean("input_tokens")),
    AggregateMetric("output_tokens", "tokens out", "", _mean("output_tokens")),
    AggregateMetric("cost_usd", "money", "$", _mean("cost_usd")),
    AggregateMetric("agent_peak_rss_mb", "agent's memory", "MB", _mean("agent_peak_rss_mb")),
)
METRICS = {"success": SUCCESS, "staleness": STALENESS, "memory": MEMORY, "costs": COSTS}
"""The metrics by kind. `costs` depend on the machine; the others depend on the run's inputs alone."""


def explain(rows: Sequence[StageMetrics], metrics: Sequence[AggregateMetric]) -> dict[str, list[Estimate]]:
    """Estimate metrics for each agent, in the order of the rows.

    Args:
        rows: The stages of a run, or some of them.
        metrics: Metrics of `METRICS`.

    Returns:
        An estimate of each metric by agent; its `n` is the number of stages that have a value.
    """
    agents = dict.fromkeys(row.agent for row in rows)
    return {
        agent: [_estimate_of([row for row in rows if row.agent == agent], one) for one in metrics] for agent in agents
    }


def _estimate_of(rows: Sequence[StageMetrics], metric: AggregateMetric) -> Estimate:
    parts = [(house_of(row), part) for row in rows if (part := metric.part(row)) is not None]
    if not parts:
        return Estimate(None, None, 0, 0)
    bootstrap = ClusterBootstrap([house for house, _ in parts])
    tops, bottoms = bootstrap.sums(np.array([part for _, part in parts])).T
    return bootstrap.ratio(tops, bottoms, len(parts))
