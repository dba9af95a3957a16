"""Summarise a sweep: a row per cell and agent, and one over the seeds of cells that differ only in the seed.

Rates and intervals are the runs' own; over seeds, stages of one house under several seeds are resampled together.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from evonav.evaluation.metrics.navigation import Rates, rates
from evonav.evaluation.metrics.stage_metrics import StageMetrics
from evonav.evaluation.metrics.stage_rows import read_stage_metrics
from evonav.evaluation.records.schema import EndState
from evonav.evaluation.records.store import FILE_NAME, RunStore
from evonav.evaluation.run.summary import SUMMARY_NAME, write_summary
from evonav.statistics import Interval
from evonav.sweeps import RUNS_NAME
from evonav.sweeps.run import read_claim

AXES = ("simulator", "perception", "decision", "tasks", "seed")
STATES = ("success", "failure", "errored", "not_run")
"""End states of a stage, in the order of tables."""


@dataclass(frozen=True, slots=True)
class SweepRow:
    """An agent in a cell, or over the seeds of cells."""

    cell: str
    """Empty over seeds."""
    simulator: str
    perception: str
    decision: str
    tasks: str
    seed: int | None
    """`None`: over all of them."""
    agent: str
    n: int
    """Scored stages."""
    num_stages: int
    sr: float | None
    sr_ci95: Interval | None
    spl: float | None
    spl_ci95: Interval | None
    counts: Mapping[str, int]
    """Stages by end state; one that was not begun is not run."""

    @property
    def is_incomplete(self) -> bool:
        """Some stage is errored or not run: no rate may be quoted as final."""
        return self.n + self.counts.get(EndState.GUIDED.value, 0) != self.num_stages


def sweep_rows(out: Path) -> list[SweepRow]:
    """Return the rows of a sweep, finished or not: cell by cell, then those over seeds."""
    cells: dict[str, dict[str, Any]] = read_claim(out)["cells"]
    rows: list[SweepRow] = []
    groups: dict[tuple[str, ...], list[str]] = {}
    for name, cell in cells.items():
        rows += _cell_rows(out / RUNS_NAME / name, name, cell)
        axes = cell["axes"]
        groups.setdefault(tuple(str(axes[axis]) for axis in AXES[:-1]), []).append(name)
    for names in groups.values():
        if len(names) > 1:
            rows += _over_seeds(out, {name: cells[name] for name in names}, rows)
    return rows


def sweep_title(out: Path) -> str:
    """Return the name that the sweep's file gives it, else that of its folder."""
    return str(read_claim(out)["settings"]["name"] or out.resolve().name)


def sweep_json(out: Path, rows: list[SweepRow]) -> dict[str, Any]:
    """Return the content of the sweep's `summary.json`."""
    return {
        "schema_version": 1,
        "name": read_claim(out)["settings"]["name"],
        "is_incomplete": any(row.is_incomplete for row in rows),
        "rows": [{**asdict(row), "is_incomplete": row.is_incomplete} for row in rows],
    }


def _cell_rows(run_dir: Path, name: str, cell: Mapping[str, Any]) -> list[SweepRow]:
    found = _run_summary(run_dir)
    num_stages = cell["num_stages"] // len(cell["agents"])
    blank = {**dict.fromkeys(STATES, 0), "not_run": num_stages}
    return [
        _row(name, cell["axes"], agent, num_stages, found.get(agent, {}), found.get(agent, {}).get("counts", blank))
        for agent in cell["agents"]
    ]


def _row(
    cell: str, axes: Mapping[str, Any], agent: str, num_stages: int, found: Mapping[str, Any], counts: Mapping[str, int]
) -> SweepRow:
    """Return a row with the rates in `found`, which is empty for a run without records."""
    return SweepRow(
        cell=cell,
        **axes,
        agent=agent,
        n=found.get("n", 0),
        num_stages=num_stages,
        sr=found.get("sr"),
        sr_ci95=_interval(found.get("sr_ci95")),
        spl=found.get("spl"),
        spl_ci95=_interval(found.get("spl_ci95")),
        counts=counts,
    )


def _run_summary(run_dir: Path) -> dict[str, dict[str, Any]]:
    """Return a run's summary by agent, computed again if its records are newer; empty for a run without records."""
    records, written = run_dir / FILE_NAME, run_dir / SUMMARY_NAME
    if not records.exists():
        return {}
    changed_ns = max(path.stat().st_mtime_ns for path in (records, Path(f"{records}-wal")) if path.exists())
    try:
        if written.stat().st_mtime_ns >= changed_ns:
            agents: dict[str, dict[str, Any]] = json.loads(written.read_text(encoding="utf-8"))["agents"]
            return agents
    except (OSError, ValueError, KeyError):
        pass
    return {summary.agent: asdict(summary) for summary in write_summary(run_dir)}


def _over_seeds(out: Path, cells: Mapping[str, Mapping[str, Any]], rows: list[SweepRow]) -> list[SweepRow]:
    """Return a row for each agent that runs with more than one seed."""
    axes = {**next(iter(cells.values()))["axes"], "seed": None}
    found = []
    for agent in dict.fromkeys(agent for cell in cells.values() for agent in cell["agents"]):
        parts = [row for row in rows if row.cell in cells and row.agent == agent]
        if len(parts) < 2:
            continue
        pooled = asdict(_pooled([out / RUNS_NAME / row.cell for row in parts], agent))
        counts = {state: sum(row.counts[state] for row in parts) for state in STATES}
        found.append(_row("", axes, agent, sum(row.num_stages for row in parts), pooled, counts))
    return found


def _pooled(run_dirs: list[Path], agent: str) -> Rates:
    rows: list[StageMetrics] = []
    for run_dir in run_dirs:
        if (run_dir / FILE_NAME).exists():
            with RunStore(run_dir) as store:
                rows += read_stage_metrics(store, [agent])
    return rates(rows)


def _interval(ends: Any) -> Interval | None:  # noqa: ANN401 - JSON
    return None if ends is None else (float(ends[0]), float(ends[1]))
