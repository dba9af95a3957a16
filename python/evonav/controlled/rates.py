"""Compute SR and SPL by evolution rate, and the rate at which searching from scratch overtakes memory."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav.controlled.analysis import BASELINE, METRICS, Analysis, Key, MetricOf, effect_cells
from evonav.report.tables.numbers import estimate_text
from evonav.report.tables.table import Table
from evonav.statistics import ClusterBootstrap, Estimate, Interval


@dataclass(frozen=True, slots=True)
class Crossover:
    """Rate at which the straight line through an agent's lead over the baseline falls to zero."""

    rate: float
    """May lie outside of 0 to 1; -inf: the baseline is ahead at every rate, inf: the lead does not fall to zero."""
    ci95: Interval
    """Bootstrap by house; the rate twice where houses agree, or there is but one."""

    def text(self) -> str:
        """Return the rate with its interval, `0.62 [0.31, >1]`, or that there is none, or that it is undetermined."""
        low, high = self.ci95
        interval = f"[{_rate_words(low)}, {_rate_words(high)}]"
        if low > 1.0:
            return f"none found: not overtaken at any rate {interval}"
        if high < 0.0:
            return f"none found: {BASELINE} is ahead at every rate {interval}"
        found = f"{self.rate:.2f}" if 0.0 <= self.rate <= 1.0 else "none found"
        return f"{found}, undetermined {interval}" if low < 0.0 and high > 1.0 else f"{found} {interval}"


def rate_keys(analysis: Analysis, *agents: str) -> list[Key]:
    """Return the stages that count: before the first one nothing can evolve."""
    return [key for key in analysis.keys(*agents) if key[1] > 1]


def by_rate(analysis: Analysis, agent: str, metric: MetricOf) -> list[tuple[float, Estimate]]:
    """Return rate and mean of each arm, over the stages that the agent has scored in all."""
    keys = rate_keys(analysis, agent)
    if not keys:
        return []
    found = ClusterBootstrap(analysis.houses(keys, agent)).column_means(analysis.values(agent, metric, keys))
    return [(arm.evolve_probability, mean) for arm, mean in zip(analysis.record.arms, found, strict=True)]


def crossover(analysis: Analysis, agent: str, metric: MetricOf) -> Crossover | None:
    """Estimate the rate at which the baseline overtakes an agent; `None` without stages of both."""
    keys = rate_keys(analysis, agent, BASELINE)
    if not keys or agent == BASELINE:
        return None
    leads = analysis.values(agent, metric, keys) - analysis.values(BASELINE, metric, keys)
    rates = np.array([arm.evolve_probability for arm in analysis.record.arms])
    bootstrap = ClusterBootstrap(analysis.houses(keys, agent))
    drawn = bootstrap.resampled_sums(bootstrap.sums(np.column_stack([leads, np.ones(len(leads))])))
    crossed = np.array([_crossing(rates, row[:-1] / row[-1]) for row in drawn])
    rate = _crossing(rates, leads.mean(axis=0))
    return Crossover(rate, bootstrap.estimate(rate, crossed, len(keys)).ci95 or (rate, rate))


def _crossing(rates: NDArray[np.float64], leads: NDArray[np.float64]) -> float:
    """Return the rate at which the least-squares line through the leads falls through zero.

    Returns:
        `inf` where it does not fall and is above zero at rate 1, `-inf` where it does not fall and is not.
    """
    offsets = rates - rates.mean()
    slope = float(offsets @ leads / (offsets @ offsets))
    middle = float(leads.mean())
    if slope >= 0.0:
        return math.inf if middle + slope * (1.0 - float(rates.mean())) > 0.0 else -math.inf
    return float(rates.mean()) - middle / slope


def rate_tables(analysis: Analysis) -> list[Table]:
    """Build the tables of SR and SPL by rate, of leads over the baseline, and of crossovers."""
    tables = []
    for name, metric in METRICS.items():
        rows = []
        for agent in analysis.agents:
            found = by_rate(analysis, agent, metric)
            if found:
                cells = [estimate_text(mean) for _, mean in found]
                rows.append((agent, str(len(rate_keys(analysis, agent))), *cells))
        columns = ("agent", "stages", *(f"p = {arm.evolve_probability:g}" for arm in analysis.record.arms))
        note = "In %, with 95% intervals (bootstrap by house); stages from the second on, the same in every arm."
        tables.append(Table(f"{name} by evolution rate", columns, tuple(rows), (note,)))
    if BASELINE in analysis.agents and len(analysis.agents) > 1:
        tables.append(_lead_table(analysis))
    return tables


def _lead_table(analysis: Analysis) -> Table:
    rows = []
    for agent in analysis.agents:
        keys = rate_keys(analysis, agent, BASELINE)
        if agent == BASELINE or not keys:
            continue
        for name, metric in METRICS.items():
            cells = []
            for arm in analysis.arms:
                _, _, lead, p = effect_cells(analysis.effect((arm, BASELINE), (arm, agent), metric, keys))
                cells.append(f"{lead}, p {p}")
            found = crossover(analysis, agent, metric)
            rows.append((f"{agent}, {name}", *cells, "" if found is None else found.text()))
    columns = (
        "agent, metric",
        *(f"p = {arm.evolve_probability:g}" for arm in analysis.record.arms),
        f"overtaken by {BASELINE} at p",
    )
    notes = (
        f"Points ahead of {BASELINE} on the same stages, with 95% interval and paired p. Overtaken: where the line of "
        "least squares through the leads falls through zero, with the interval of resampled houses.",
    )
    return Table(f"Ahead of {BASELINE}", columns, tuple(rows), notes)


def _rate_words(rate: float) -> str:
    return "<0" if rate < 0.0 else ">1" if rate > 1.0 else f"{rate:.2f}"
