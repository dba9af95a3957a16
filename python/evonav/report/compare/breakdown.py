"""Compute rates of agents by kind of stage: by a field of its row, path length, rooms, or success radius."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np

from evonav.errors import InvalidArgumentError
from evonav.evaluation.metrics.navigation import house_of
from evonav.evaluation.metrics.stage_metrics import StageMetrics
from evonav.evaluation.records.store import RunStore
from evonav.report.compare.compare import STRATA, check_metric
from evonav.report.compare.selection import ComparedAgent
from evonav.report.compare.wording import RATES, metric_name, scale_of
from evonav.report.export import csv_text
from evonav.report.plots.specs import CurvePlot, GroupPlot, Line, Plot, Series
from evonav.report.tables.numbers import NONE, estimate_text, number
from evonav.report.tables.table import MODES, STRICT_NOTE, Table
from evonav.statistics import ClusterBootstrap, Estimate

RADII_M = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
RADIUS = "radius"
LENGTH_EDGES_M = (0.0, 2.0, 4.0, 6.0, 8.0, 12.0, 16.0)
ROOM_EDGES = (1, 2, 4, 6, 11)
"""First of each group of rooms: 1, 2-3, 4-5, 6-10, more."""
MAX_PLOTTED = 10
NUM_BINS = 4
"""Number of groups for a field that has no bins of its own: quarters."""


@dataclass(frozen=True, slots=True)
class Breakdown:
    """A metric of every agent by group."""

    by: str
    label: str
    metric: str
    groups: tuple[str, ...]
    agents: tuple[str, ...]
    cells: Mapping[tuple[str, str], Estimate]
    """Means by (group, agent)."""
    note: str


@dataclass(frozen=True, slots=True)
class Grouping:
    """Rule that sorts stages into groups."""

    label: str
    group_of: Callable[[StageMetrics], str | None]
    """`None` for a stage that belongs nowhere."""
    order: Sequence[str] | None
    """Order of the groups; `None`: the largest first."""
    note: str = ""


STANDARD = ("stratum", "mode", "path-length", "earlier-stages", "room-count", "category", RADIUS)
"""Groupings that `evonav breakdown` shows by default."""


def breakdown(compared_agents: Sequence[ComparedAgent], by: str, metric: str = "success") -> Breakdown:
    """Compute a metric by group, for every compared agent.

    Args:
        compared_agents: Agents from `read_compared_agents`.
        by: One of `STANDARD`, or any field of a stage's row.
        metric: Any numeric field of a row; the radius sweep always shows success.

    Raises:
        InvalidArgumentError: There is no such field.
        StoreError: A run cannot be read.
    """
    check_metric(metric)
    if by == RADIUS:
        return _by_radius(compared_agents)
    grouping = _grouping(compared_agents, by)
    rows: dict[tuple[str, str], list[StageMetrics]] = {}
    for compared in compared_agents:
        for row in compared.rows.values():
            group = grouping.group_of(row)
            if group is not None and row.is_scored and getattr(row, metric) is not None:
                rows.setdefault((group, compared.name), []).append(row)
    sizes: dict[str, int] = {}
    for (group, _), part in rows.items():
        sizes[group] = sizes.get(group, 0) + len(part)
    known = grouping.order or sorted(sizes, key=lambda group: (-sizes[group], group))
    return Breakdown(
        by=by,
        label=grouping.label,
        metric=metric,
        groups=tuple(group for group in known if group in sizes),
        agents=tuple(compared.name for compared in compared_agents),
        cells={  # group by group: agents with the same houses share resamples
            key: _cell(part, [float(getattr(row, metric)) for row in part]) for key, part in sorted(rows.items())
        },
        note=grouping.note,
    )


def _cell(rows: Sequence[StageMetrics], values: Sequence[float]) -> Estimate:
    bootstrap = ClusterBootstrap([house_of(row) for row in rows])
    (mean,) = bootstrap.column_means(np.array(values)[:, None])
    return mean


def _by_radius(compared_agents: Sequence[ComparedAgent]) -> Breakdown:
    cells: dict[tuple[str, str], Estimate] = {}
    labels = {f"{radius_m:g} m": radius_m for radius_m in RADII_M}
    for compared in compared_agents:
        scored = [row for row in compared.rows.values() if row.is_scored and row.terminal_distance_m is not None]
        for group, radius_m in labels.items() if scored else ():
            cells[group, compared.name] = _cell(scored, [float(bool(row.is_success_at(radius_m))) for row in scored])
        for name, field in (("strict", "is_strict_success"), ("geodesic", "is_geodesic_success")):
            judged = [row for row in scored if getattr(row, field) is not None]
            if judged:
                cells[name, compared.name] = _cell(judged, [float(getattr(row, field)) for row in judged])
    note = (
        "The agents ran with their own success radius; these are the same stages judged by others. Geodesic success: "
        f"the path to the target is shorter than the radius. {STRICT_NOTE}"
    )
    groups = [group for group in (*labels, "strict", "geodesic") if any(group == key for key, _ in cells)]
    agents = tuple(compared.name for compared in compared_agents)
    return Breakdown(RADIUS, "success radius", "success", tuple(groups), agents, cells, note)


def _grouping(compared_agents: Sequence[ComparedAgent], by: str) -> Grouping:
    if by == "stratum":
        return Grouping("stratum", lambda row: STRATA.get(row.stratum), list(STRATA.values()))
    if by == "mode":
        note = "What changed before the stage; stages 2 and later."
        return Grouping("evolution", lambda row: MODES.get(row.mode), list(MODES.values()), note)
    if by == "path-length":
        names = [f"{a:g}-{b:g} m" for a, b in pairwise(LENGTH_EDGES_M)] + [f"{LENGTH_EDGES_M[-1]:g} m and more"]
        note = "Shortest path from where the stage began to the target, which depends on where the agent was."
        return Grouping("path length", lambda row: _bin(row.reference_length_m, LENGTH_EDGES_M, names), names, note)
    if by == "earlier-stages":
        names = [str(k) for k in range(20)]
        note = "Stages of the task before this one: how long memory has grown, and could grow stale."
        return Grouping("earlier stages", lambda row: str(row.stage - 1), names, note)
    if by == "room-count":
        counts: dict[str, int] = {}
        for run_dir in dict.fromkeys(compared.run.run_dir for compared in compared_agents):
            with RunStore(run_dir) as store:
                counts |= store.num_rooms()
        names = [str(a) if b == a + 1 else f"{a}-{b - 1}" for a, b in pairwise(ROOM_EDGES)]
        names.append(f"{ROOM_EDGES[-1]} and more")
        return Grouping("rooms", lambda row: _bin(counts.get(row.task_id), ROOM_EDGES, names), names)
    return _field_grouping(compared_agents, by.replace("-", "_"))


def _field_grouping(compared_agents: Sequence[ComparedAgent], field: str) -> Grouping:
    known = {one.name for one in fields(StageMetrics)}
    if field not in known:
        raise InvalidArgumentError(
            f"argument `by` is {field!r}, expected one of {', '.join(STANDARD)}, or a field of a stage's row: "
            f"{', '.join(sorted(known))}"
        )
    labels = field.replace("_", " ")
    values = [getattr(row, field) for compared in compared_agents for row in compared.rows.values() if row.is_scored]
    there = [value for value in values if value is not None]
    kinds = {type(value) for value in there}
    if kinds <= {bool}:
        return Grouping(labels, lambda row: {True: "yes", False: "no"}.get(getattr(row, field)), ["yes", "no"])
    if kinds <= {int} and len(set(there)) <= 12:
        return Grouping(labels, lambda row: _text(getattr(row, field)), [str(k) for k in sorted(set(there))])
    if kinds <= {int, float}:
        edges = sorted(
            {float(edge) for edge in np.quantile(np.array(there, dtype=float), np.linspace(0, 1, NUM_BINS + 1))}
        )
        names = [f"{a:.3g} to {b:.3g}" for a, b in pairwise(edges)] or [f"{edges[0]:.3g}"]
        return Grouping(labels, lambda row: _bin(getattr(row, field), edges, names), names, "Quarters of all stages.")
    return Grouping(labels, lambda row: _text(getattr(row, field)), None)


def _text(value: object) -> str | None:
    return None if value is None else str(value)


def _bin(value: float | None, edges: Sequence[float], names: Sequence[str]) -> str | None:
    if value is None:
        return None
    return names[min(len(names) - 1, max(0, int(np.searchsorted(edges, value, side="right")) - 1))]


def breakdown_table(found: Breakdown, *, is_brief: bool = False) -> Table:
    """Build a table with one row per group and one column per agent.

    If `is_brief`, half of an interval's width stands in place of its ends, so that six agents fit a terminal.
    """
    rows = []
    for group in found.groups:
        cells = [found.cells.get((group, agent)) for agent in found.agents]
        sizes = sorted({cell.n for cell in cells if cell is not None})
        scale = scale_of(found.metric)
        shown = (_brief(cell, scale) if is_brief else estimate_text(cell, scale=scale) for cell in cells)
        rows.append((group, "-".join(map(str, sizes[:1] + sizes[1:][-1:])), *shown))
    unit = " %" if found.metric in RATES else ""
    ends = "± half of its 95% interval" if is_brief else "[95% CI]"
    notes = [f"{metric_name(found.metric)}{unit} {ends}, bootstrap by house; n stages of an agent."]
    notes += [found.note] if found.note else []
    columns = (found.label, "n", *found.agents)
    return Table(f"{metric_name(found.metric)} by {found.label}", columns, tuple(rows), tuple(notes))


def _brief(cell: Estimate | None, scale: float) -> str:
    if cell is None or cell.value is None or cell.ci95 is None:
        return NONE if cell is None else number(cell.value, scale=scale)
    half = scale * (cell.ci95[1] - cell.ci95[0]) / 2
    return number(cell.value, scale=scale) + (f" ±{half:.0f}" if scale == 100 else f" ±{half:.2g}")


def breakdown_csv(found: Sequence[Breakdown]) -> str:
    """Return one CSV row per group and agent, unrounded."""
    columns = ("by", "group", "agent", "metric", "n", "num_houses", "value", "low", "high")
    rows = (
        (one.by, group, agent, one.metric, cell.n, cell.num_clusters, cell.value, *(cell.ci95 or (None, None)))
        for one in found
        for group in one.groups
        for agent in one.agents
        if (cell := one.cells.get((group, agent))) is not None
    )
    return csv_text(columns, rows)


def breakdown_plot(found: Breakdown) -> Plot:
    """Plot a breakdown as dots with whiskers, or as lines along the success radius."""
    scale = scale_of(found.metric)
    name = f"{metric_name(found.metric)}, %" if scale == 100 else metric_name(found.metric)
    if found.by == RADIUS:
        radii = [group for group in found.groups if group.endswith(" m")]
        lines = []
        for agent in found.agents:
            there = [(float(group[:-2]), found.cells[group, agent]) for group in radii if (group, agent) in found.cells]
            if there:
                lines.append(Line.of(agent, there))
        return CurvePlot("SR by success radius", tuple(lines), "success radius, m", "SR, %")
    groups = found.groups[:MAX_PLOTTED]
    series = [Series.of(agent, [found.cells.get((group, agent)) for group in groups], scale) for agent in found.agents]
    sizes = [
        {found.cells[group, agent].n for agent in found.agents if (group, agent) in found.cells} for group in groups
    ]
    labels = tuple(
        f"{group}\nn = {min(size)}" + (f"-{max(size)}" if len(size) > 1 else "")
        for group, size in zip(groups, sizes, strict=True)
    )
    more = len(found.groups) - len(groups)
    heading = f"{metric_name(found.metric)} by {found.label}" + (f" (the {MAX_PLOTTED} largest)" if more > 0 else "")
    return GroupPlot(heading, labels, tuple(series), name)
