"""Run rules that look and rules that read, and write docs/studies/rules-that-look.md.

    python scripts/studies/looks_results.py --out out/looks --tasks TASKS/hard-val TASKS/tiny-val TASKS/tiny-train

evaluates the agents on all tasks of the folders with `--decision text` and with `--decision looks`, one after the
other. Run it again to resume; `--write-only` runs nothing.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise

import numpy as np
from results import HEADLINE, ROOT, pooled_tasks, run_agents, run_parser, write_parts

from evonav.component import Component
from evonav.decision.question import DecisionModel
from evonav.evaluation.metrics.stage_metrics import StageMetrics
from evonav.evaluation.records.schema import StageRecord
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.settings import RULES
from evonav.perception.shorthand import parse_perception
from evonav.report.plots.render import write_plots
from evonav.report.plots.specs import CurvePlot, Line
from evonav.report.run import RecordedRun, load_run
from evonav.report.tables.causes import FailureCause
from evonav.report.tables.table import Table
from evonav.statistics import paired_effect, wilson

AGENTS = ("fu", "ftu", "stage-reset", "3d-mem", "msgnav")
PLOT = ROOT / "docs" / "images" / "looks-reliability.svg"
EDGES = (0, 50, 60, 70, 80, 90, 101)
"""Bounds of the bins of probabilities, in percent."""
MEASURES: tuple[tuple[str, Callable[[StageMetrics], float]], ...] = (
    ("SR, %", lambda row: 100.0 * bool(row.success)),
    ("SPL, %", lambda row: 100.0 * (row.spl or 0.0)),
    ("another instance, %", lambda row: 100.0 * (row.cause == FailureCause.WRONG_INSTANCE.value)),
    ("rounds a stage", lambda row: float(row.num_rounds)),
)


def main() -> None:
    """See the module."""
    asked = run_parser(__doc__, AGENTS).parse_args()
    if not asked.write_only:
        tasks = pooled_tasks(asked.tasks)
        for agent in asked.agents.split(","):
            for rule in RULES:
                run_agents(asked.out / rule, [agent], tasks, _backend(rule), asked)
    write_parts(parts(*(load_run(asked.out / rule) for rule in RULES)))


def parts(text: RecordedRun, looks: RecordedRun) -> dict[str, str]:
    """The marked parts of the page, by name; draws the plot."""
    given = {agent: list(last_probabilities(looks, agent)) for agent in looks.agents}
    write_plots([reliability_plot(given)], PLOT)
    picture = f"![Share of stages that succeeded by stated probability](../images/{PLOT.name})"
    return {
        "looks": comparison_table(text, looks).markdown(),
        "looks-probabilities": f"{picture}\n\n{probability_table(given).markdown()}",
    }


def _backend(rule: str) -> Backend:
    decision: Component[DecisionModel] = Component(f"evonav.decision.backends:{RULES[rule]}")
    return Backend(perception=parse_perception(HEADLINE), decision=decision)


def comparison_table(text: RecordedRun, looks: RecordedRun) -> Table:
    """Each agent with both rules, on the stages that both have a score of."""
    rows = []
    for agent in (name for name in text.agents if name in looks.agents):
        pairs = [
            (outcome.row, looks.outcomes[key].row)
            for key, outcome in text.outcomes.items()
            if key[0] == agent and key in looks.outcomes
        ]
        pairs = [(a, b) for a, b in pairs if a.spl is not None and b.spl is not None]
        houses = [a.house for a, _ in pairs]
        cells = []
        for _, value in MEASURES:
            a, b = (np.array([value(pair[side]) for pair in pairs]) for side in (0, 1))
            effect = paired_effect(a, b, houses)
            low, high = effect.ci95 or (float("nan"), float("nan"))
            means = f"{effect.mean_a:.1f}, {effect.mean_b:.1f}"
            cells.append(f"{means}: {effect.difference:+.1f} [{low:+.1f}, {high:+.1f}]")
        rows.append((agent, str(len(pairs)), *cells))
    columns = ("Agent", "stages", *(name for name, _ in MEASURES))
    note = "With `text`, with `looks`, and the difference with its 95% interval, paired, houses resampled."
    return Table("Rules that read and rules that look", columns, tuple(rows), (note,))


def last_probabilities(run: RecordedRun, agent: str) -> Iterable[tuple[float, bool]]:
    """Yield the last probability, in percent, that an agent stated in a stage, and whether the stage succeeded."""
    for task in run.tasks():
        for (name, stage), record in task.records.items():
            outcome = run.outcomes.get((name, task.task_id, stage))
            if name == agent and outcome is not None and outcome.row.success is not None:
                stated = _stated(record)
                if stated:
                    yield stated[-1], outcome.row.success


def _stated(record: StageRecord) -> list[float]:
    reasons = (str(one.details.get("reason", "")) for one in record.trace)
    found = (re.search(r"(\d+)% likely", reason) for reason in reasons)
    return [float(match[1]) for match in found if match]


def _binned(given: Iterable[tuple[float, bool]]) -> list[tuple[float, float, int, int]]:
    """Return mean probability, share of successes, successes and stages of each bin that has any."""
    pairs = list(given)
    bins = []
    for low, high in pairwise(EDGES):
        part = [(stated, success) for stated, success in pairs if low <= stated < high]
        if part:
            successes = sum(success for _, success in part)
            mean = sum(stated for stated, _ in part) / len(part)
            bins.append((mean, 100.0 * successes / len(part), successes, len(part)))
    return bins


def probability_table(given: Mapping[str, list[tuple[float, bool]]]) -> Table:
    """How often a stage succeeded, by the last probability that its agent stated."""
    names = [f"{low}-{min(high, 100)}" for low, high in pairwise(EDGES)]
    rows = []
    for agent, pairs in given.items():
        cells = []
        for low, high in pairwise(EDGES):
            found = _binned((stated, success) for stated, success in pairs if low <= stated < high)
            cells.append(f"{found[0][0]:.0f}, {found[0][1]:.0f} ({found[0][3]})" if found else "–")
        rows.append((agent, *cells))
    note = "Mean of the stated probabilities, share of these stages that succeeded, in %, and their number."
    return Table("Stated probabilities", ("Agent", *(f"{name}%" for name in names)), tuple(rows), (note,))


def reliability_plot(given: Mapping[str, list[tuple[float, bool]]]) -> CurvePlot:
    """Draw the share of successes by stated probability, with Wilson's intervals."""
    lines = []
    for agent, pairs in given.items():
        bins = _binned(pairs)
        intervals = [wilson(successes, n) for _, _, successes, n in bins]
        ends = tuple(None if ci is None else (100 * ci[0], 100 * ci[1]) for ci in intervals)
        lines.append(Line(agent, tuple((mean, share) for mean, share, _, _ in bins), ends))
    return CurvePlot(
        "Success by stated probability",
        tuple(lines),
        "stated probability, %",
        "stages that succeeded, %",
        x_range=(0, 100),
        y_top=100,
        is_square=True,
        has_diagonal=True,
    )


if __name__ == "__main__":
    main()
