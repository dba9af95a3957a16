"""Agents under perceptions from perfect to poor: runs them, and writes the tables of docs/studies/perception-errors.md.

    python scripts/studies/perception_results.py --out out/perception --tasks TASKS/uniform-hard-val-75 TASKS/tiny-val

evaluates the agents on a subset of the tasks under every perception and writes curves, and what the paper says of
perception next to what is found here. Run it again to resume; `--write-only` runs nothing. A folder of results holds
one version of the code.
"""

import argparse
from collections.abc import Callable, Mapping

import numpy as np
from results import ROOT, pooled_tasks, run_agents, run_parser, spread, write_parts

from evonav.evaluation.agent_order import PAPER_ORDER
from evonav.evaluation.metrics.navigation import AgentSummary, house_of
from evonav.evaluation.metrics.stage_metrics import StageMetrics
from evonav.evaluation.records.schema import EndState
from evonav.evaluation.run.components import Backend
from evonav.perception.shorthand import parse_perception
from evonav.report.paper.tables import PAPER, PaperResult
from evonav.report.plots.render import write_plots
from evonav.report.plots.specs import CurvePlot, Line
from evonav.report.run import RecordedRun, load_run
from evonav.report.tables.numbers import NONE, rate
from evonav.report.tables.table import Table
from evonav.statistics import Interval, PairedEffect, paired_effect

PERCEPTIONS = (
    "noisy:perfect",
    "noisy:perfect,features=true",
    "noisy:good",
    "noisy:yolo-world-like",
    "noisy:poor",
    "predicted:mini",
)
"""The curves are of the first ones; what a learned detector gives stands next to them in the tables."""
IMAGES = ROOT / "docs" / "images"

Keep = Callable[[StageMetrics], bool]
CLAIMS: tuple[tuple[str, str, str, Keep], ...] = (
    ("MSGNav minus FTU", "ftu", "msgnav", lambda row: True),
    ("3D-Mem minus FU", "fu", "3d-mem", lambda row: True),
    ("Stage-Reset minus FU", "fu", "stage-reset", lambda row: True),
    ("FTU minus FU", "fu", "ftu", lambda row: True),
    ("FTU minus FU, moved", "fu", "ftu", lambda row: row.stratum == "relocated"),
    ("FTU minus FU, not moved", "fu", "ftu", lambda row: row.stratum == "not_relocated"),
)
"""Differences that the paper draws its conclusions about perception from (its Sec. 5, Tables 1 and 2)."""


def main() -> None:
    """See the module."""
    asked = _arguments()
    words = asked.perceptions.split(";")
    subset = spread(pooled_tasks(asked.tasks), asked.houses)
    if not asked.write_only:
        for word in words:
            run_agents(asked.out / folder_of(word), asked.agents.split(","), subset, _backend(word), asked)
    runs = {word: load_run(asked.out / folder_of(word)) for word in words if (asked.out / folder_of(word)).exists()}
    write_parts(parts(runs))


def folder_of(word: str) -> str:
    """Of a perception's run."""
    return word.replace(":", "-").replace(",", "-").replace("=", "")


def name_of(word: str) -> str:
    """Of a perception in tables."""
    return word.partition(":")[2].replace(",features=true", " + features").removesuffix("-like")


def parts(runs: Mapping[str, RecordedRun]) -> dict[str, str]:
    """The marked parts of the page, by name; draws the plots."""
    pictures = []
    for measure in ("sr", "spl"):
        path = write_plots([_plot(runs, measure)], IMAGES / f"perception-{measure}.svg")
        pictures.append(f"![{measure.upper()} by perception](../images/{path.name})")
    tables = [rate_table(runs, "sr"), rate_table(runs, "spl")]
    return {
        "perception-rates": "\n\n".join((*pictures, *(table.markdown() for table in tables))),
        "perception-claims": claim_table(runs).markdown(),
        "perception-costs": cost_table(runs).markdown(),
    }


def rate_table(runs: Mapping[str, RecordedRun], measure: str) -> Table:
    """SR or SPL of every agent under every perception."""
    rows = []
    for agent in _agents(runs):
        found = [_rate(_summary(run, agent), measure) for run in runs.values()]
        rows.append((agent, *(NONE if one is None else rate(*one) for one in found)))
    return Table(
        f"{measure.upper()} by perception", ("Agent", *map(name_of, runs)), tuple(rows), (_words(runs, measure),)
    )


def claim_table(runs: Mapping[str, RecordedRun]) -> Table:
    """Differences in SR between agents under every perception, and the paper's in its two settings."""
    rows = []
    for title, a, b, keep in CLAIMS:
        paper = tuple(_paper_difference(PAPER[half][a], PAPER[half][b], title) for half in ("gt", "prediction"))
        rows.append((title, *paper, *(_points(_between(run, a, run, b, keep)) for run in runs.values())))
    columns = ("SR, points", "paper, GT", "paper, Prediction", *map(name_of, runs))
    return Table(
        "What the paper concludes from",
        columns,
        tuple(rows),
        ("Differences on the same stages; bootstrap over houses.",),
    )


def cost_table(runs: Mapping[str, RecordedRun]) -> Table:
    """What evolution costs an agent that sees perfectly, and what errors of perception cost it."""
    (first, best), *others = runs.items()
    rows = []
    for agent in _agents(runs):
        summary = _summary(best, agent)
        splits = {} if summary is None else summary.splits
        moved, stayed = splits.get("relocated"), splits.get("not_relocated")
        gap = NONE
        if moved is not None and stayed is not None and moved.sr is not None and stayed.sr is not None:
            gap = f"{100 * (moved.sr - stayed.sr):+.1f}"
        costs = (_points(_between(best, agent, run, agent, lambda row: True)) for _, run in others)
        rows.append((agent, gap, *costs))
    columns = (
        "Agent",
        f"relocation, {name_of(first)}",
        *(f"{name_of(word)} minus {name_of(first)}" for word, _ in others),
    )
    note = (
        "Percentage points of SR. Relocation: relocated targets minus targets that were not relocated; these are "
        "different stages. The other columns compare the same stages."
    )
    return Table("What evolution costs, and what perception costs", columns, tuple(rows), (note,))


def _between(run_a: RecordedRun, a: str, run_b: RecordedRun, b: str, keep: Keep) -> PairedEffect | None:
    """Success of `b` in one run less that of `a` in another, over the stages that both scored."""
    ours, theirs = (
        {key[1:]: one.row for key, one in run.outcomes.items() if key[0] == name and one.row.is_scored}
        for run, name in ((run_a, a), (run_b, b))
    )
    keys = [key for key, row in ours.items() if key in theirs and keep(row)]
    if not keys:
        return None
    before, after = (
        np.array([rows[key].state == EndState.SUCCESS for key in keys], np.float64) for rows in (ours, theirs)
    )
    return paired_effect(before, after, [house_of(ours[key]) for key in keys])


def _points(effect: PairedEffect | None) -> str:
    if effect is None:
        return NONE
    ends = "" if effect.ci95 is None else f" [{100 * effect.ci95[0]:+.1f}, {100 * effect.ci95[1]:+.1f}]"
    return f"{100 * effect.difference:+.1f}{ends}"


def _paper_difference(a: PaperResult, b: PaperResult, title: str) -> str:
    if title.endswith("not moved"):
        return f"{100 * (b.num_not_relocated - a.num_not_relocated) / 166:+.1f}"
    if title.endswith(", moved"):
        return f"{100 * (b.num_relocated - a.num_relocated) / 109:+.1f}"
    return f"{100 * (b.num_all - a.num_all) / 365:+.1f}"


def _agents(runs: Mapping[str, RecordedRun]) -> list[str]:
    found = {agent for run in runs.values() for agent in run.agents}
    return [agent for agent in PAPER_ORDER if agent in found]


def _summary(run: RecordedRun, agent: str) -> AgentSummary | None:
    return next((summary for summary in run.summaries if summary.agent == agent), None)


def _rate(summary: AgentSummary | None, measure: str) -> tuple[float, Interval | None] | None:
    if summary is None:
        return None
    value, ends = (summary.sr, summary.sr_ci95) if measure == "sr" else (summary.spl, summary.spl_ci95)
    return None if value is None else (value, ends)


def _words(runs: Mapping[str, RecordedRun], measure: str) -> str:
    run = next(iter(runs.values()))
    num_stages = sum(run.num_stages.values())
    return f"{measure.upper()} %, {len(run.num_stages)} houses, {num_stages} stages; bootstrap over houses."


def _plot(runs: Mapping[str, RecordedRun], measure: str) -> CurvePlot:
    lines = []
    runs = {word: run for word, run in runs.items() if word.startswith("noisy:")}
    for agent in _agents(runs):
        found = [(x, rate) for x, run in enumerate(runs.values()) if (rate := _rate(_summary(run, agent), measure))]
        ends = tuple(None if ci is None else (100 * ci[0], 100 * ci[1]) for _, (_, ci) in found)
        lines.append(Line(agent, tuple((x, 100 * value) for x, (value, _) in found), ends))
    name, x_names = measure.upper(), tuple(name_of(word) for word in runs)
    return CurvePlot(f"{name} by perception", tuple(lines), "perception", f"{name}, %", x_names)


def _backend(word: str) -> Backend:
    return Backend(perception=parse_perception(word))


def _arguments() -> argparse.Namespace:
    parser = run_parser(__doc__, PAPER_ORDER)
    parser.add_argument(
        "--perceptions", default=";".join(PERCEPTIONS), help="words, with ; between them; the best first"
    )
    parser.add_argument("--houses", type=int, default=40)
    return parser.parse_args()


if __name__ == "__main__":
    main()
