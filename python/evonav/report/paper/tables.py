"""Compare a run with the paper's Tables 1 and 2, and with its stage-1 results.

Counts are decoded from the paper's percentages: all twelve overall rates lie on k/365, the strata on k/109 and k/166,
and what is left of the sums is stage 1. SPL is as printed.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from evonav.evaluation.agent_order import PAPER_ORDER
from evonav.evaluation.metrics.navigation import AgentPair, AgentSummary, rates
from evonav.evaluation.metrics.stage_metrics import StageMetrics
from evonav.report.run import RecordedRun, RecordedStage
from evonav.report.tables.numbers import NONE, number, percent, points, rate, with_interval
from evonav.report.tables.table import INTERVALS, Table, rates_text
from evonav.report.tables.verdicts import VERDICTS, p_heading, p_words, verdict_words
from evonav.statistics import DETECTABLE_Z, Z_95, Interval, newcombe, power, wilson

Perception = Literal["gt", "prediction"]

NUM_STAGES = {"all": 365, "relocated": 109, "not_relocated": 166, "stage_1": 90}
"""Stages of the paper's 90 tasks, by the names of `AgentSummary.rates`."""
FAR_M = 2.0
"""Distance in metres beyond which a target counts as moved far: the success radius."""


@dataclass(frozen=True, slots=True)
class PaperResult:
    """An agent's stages that succeeded, and its SPL."""

    num_all: int
    spl: float
    num_relocated: int
    num_not_relocated: int

    def num_successes(self, split: str = "all") -> int:
        """Return the successes in a split; stage 1 is in neither stratum."""
        moved, unmoved = self.num_relocated, self.num_not_relocated
        counts = {"all": self.num_all, "relocated": moved, "not_relocated": unmoved}
        return counts.get(split, self.num_all - moved - unmoved)

    def sr(self, split: str = "all") -> float:
        """Return the success rate in a split."""
        return self.num_successes(split) / NUM_STAGES[split]


PAPER: dict[Perception, dict[str, PaperResult]] = {
    "gt": {
        "unigoal": PaperResult(73, 0.149, 14, 31),
        "3d-mem": PaperResult(174, 0.425, 44, 93),
        "msgnav": PaperResult(216, 0.413, 56, 107),
        "fu": PaperResult(223, 0.488, 59, 108),
        "stage-reset": PaperResult(226, 0.451, 66, 102),
        "ftu": PaperResult(246, 0.533, 75, 110),
    },
    "prediction": {
        "unigoal": PaperResult(47, 0.079, 10, 18),
        "3d-mem": PaperResult(161, 0.377, 44, 80),
        "msgnav": PaperResult(200, 0.382, 55, 96),
        "fu": PaperResult(154, 0.325, 32, 83),
        "stage-reset": PaperResult(171, 0.296, 48, 82),
        "ftu": PaperResult(179, 0.358, 57, 80),
    },
}
_PAPER_NOTE = "Paper: Wilson's 95% interval of its counts, as if its stages were independent."
_PAPER_DIFFERENCE_NOTE = (
    "Paper: Newcombe's 95% interval of its counts, as if its agents and stages were independent. Its agents had the "
    "same stages, but it does not publish pairs; with them its intervals would be narrower for agents that are alike."
)
_OURS_NOTE = f"Ours: {INTERVALS}"


def paper_tables(run: RecordedRun, perception: Perception = "gt") -> list[Table]:
    """Return Tables 1 and 2, stage 1, the order of agents, and differences: the paper's beside the run's.

    Args:
        run: Agents that the paper does not have stand without its figures.
        perception: Half of the paper's tables to compare with.
    """
    paper = PAPER[perception]
    return [
        _main_table(run.summaries, paper),
        _relocation_table(run.summaries, paper),
        _far_table(run),
        _first_stage_table(run.summaries, paper),
        _order_table(run.summaries, paper),
        _difference_table(run.pairs, paper),
    ]


def power_table(pairs: Sequence[AgentPair], perception: Perception = "gt") -> Table:
    """Show whether the paper's SR differences could be found on its houses, if they vary as ours do."""
    paper, num_houses = PAPER[perception], NUM_STAGES["stage_1"]
    rows = []
    for pair in pairs:
        if pair.a not in paper or pair.b not in paper or pair.sr.ci95 is None:
            continue
        width = pair.sr.ci95[1] - pair.sr.ci95[0]
        gap = paper[pair.b].sr() - paper[pair.a].sr()
        error = width / (2 * Z_95) * math.sqrt(pair.sr.num_clusters / num_houses)
        chance = power(gap, error)
        least = DETECTABLE_Z * error
        needed = "–" if gap == 0 else f"{math.ceil(num_houses * (least / gap) ** 2)}"
        rows.append(
            (
                f"{pair.b} minus {pair.a}",
                f"{100 * gap:+.1f}",
                f"±{100 * 1.96 * error:.1f}",
                f"{100 * least:.1f}",
                f"{100 * chance:.0f}%",
                needed,
            )
        )
    columns = ("Agents", "SR, paper", "95% interval", "detectable", "power", "houses for 80%")
    notes = (
        f"Percentage points. Interval and detectable difference of {num_houses} houses, {NUM_STAGES['all']} stages, if "
        "paired outcomes vary from house to house as in this run; the paper does not give its pairs. Power: the chance "
        "that such an experiment finds a true difference as large as the paper's, at 5%, two-sided, no adjustment for "
        "several pairs. Houses: how many would find it four times in five.",
    )
    return Table("What the paper's differences could tell", columns, tuple(rows), notes)


def _main_table(summaries: Sequence[AgentSummary], paper: dict[str, PaperResult]) -> Table:
    rows = tuple(
        (
            s.agent,
            _theirs(paper.get(s.agent)),
            rate(s.sr, s.sr_ci95),
            percent(paper[s.agent].spl) if s.agent in paper else NONE,
            rate(s.spl, s.spl_ci95),
            f"{s.n} of {s.num_stages}" if s.is_incomplete else str(s.n),
        )
        for s in summaries
    )
    columns = ("Agent", "SR % paper", "SR % ours", "SPL % paper", "SPL % ours", "n ours")
    notes = (f"Paper: n = {NUM_STAGES['all']}.", _PAPER_NOTE, _OURS_NOTE)
    return Table("Table 1: all stages", columns, rows, notes)


def _relocation_table(summaries: Sequence[AgentSummary], paper: dict[str, PaperResult]) -> Table:
    rows = []
    for s in summaries:
        known, moved, unmoved = paper.get(s.agent), s.rates("relocated").sr, s.rates("not_relocated").sr
        gap = None if known is None else known.sr("relocated") - known.sr("not_relocated")
        ours = None if moved is None or unmoved is None else moved - unmoved
        cells = [
            cell
            for split in ("relocated", "not_relocated")
            for cell in (_theirs(known, split), rates_text(s.rates(split)))
        ]
        rows.append((s.agent, *cells, *(number(value, scale=100, is_signed=True) for value in (gap, ours))))
    columns = (
        "Agent",
        "moved, paper",
        "moved, ours",
        "not moved, paper",
        "not moved, ours",
        "gap, paper",
        "gap, ours",
    )
    note = (
        f"SR %. Moved (the paper: relocated): the target had ever moved since stage 1; paper n = "
        f"{NUM_STAGES['relocated']} and {NUM_STAGES['not_relocated']}. Gap: moved minus not moved, percentage points."
    )
    return Table("Table 2: moved and not moved targets", columns, tuple(rows), (note,))


def _far_table(run: RecordedRun) -> Table:
    """Split moved targets by distance: who stops at the old place of one that moved a little still succeeds."""
    rows = []
    for agent in run.agents:
        far: list[StageMetrics] = []
        near: list[StageMetrics] = []
        for key, outcome in run.outcomes.items():
            moved_m = _moved_m(outcome) if key[0] == agent else None
            if moved_m is not None:
                (far if moved_m > FAR_M else near).append(outcome.row)
        rows.append((agent, rates_text(rates(far)), rates_text(rates(near))))
    note = (
        "SR % of the moved targets of Table 2, by the distance on the ground plane from the place in stage 1. An "
        f"agent that stops at the old place of a target that moved less than the success radius of {FAR_M:g} m may "
        "still succeed. The paper has no such split."
    )
    columns = ("Agent", f"moved more than {FAR_M:g} m", "moved less")
    return Table("Table 2 by how far the target moved", columns, tuple(rows), (note,))


def _moved_m(outcome: RecordedStage) -> float | None:
    """Return how far a moved target stands from its place in stage 1; `None` for others, and where it is unknown."""
    first, now = outcome.first_target_m, outcome.target_m
    if outcome.row.stratum != "relocated" or first is None:
        return None
    return math.dist((first[0], first[2]), (now[0], now[2]))


def _first_stage_table(summaries: Sequence[AgentSummary], paper: dict[str, PaperResult]) -> Table:
    rows = tuple((s.agent, _theirs(paper.get(s.agent), "stage_1"), rates_text(s.rates("stage_1"))) for s in summaries)
    note = (
        "SR %. The paper does not print these rates; they are its overall counts minus the counts of moved and not "
        f"moved targets (n = {NUM_STAGES['stage_1']}). At stage 1 fu and stage-reset are the same program, and ftu "
        "only adds a look on arrival, so the paper's differences between these three are mostly noise."
    )
    return Table("Stage 1", ("Agent", "paper, decoded", "ours"), rows, (note,))


def _order_table(summaries: Sequence[AgentSummary], paper: dict[str, PaperResult]) -> Table:
    agents = [s for s in summaries if s.agent in paper and s.sr is not None]
    splits = {"SR, relocated": "relocated", "SR, not relocated": "not_relocated", "SR, stage 1": "stage_1"}
    rows = [
        (
            name,
            order({s.agent: paper[s.agent].num_successes(split) for s in agents}),
            order({s.agent: s.rates(split).sr for s in agents}),
        )
        for name, split in {"SR": "all", **splits}.items()
    ]
    spl = order({s.agent: paper[s.agent].spl for s in agents}), order({s.agent: s.spl for s in agents})
    rows.insert(1, ("SPL", *spl))
    return Table("Order of the agents", ("Measure", "paper", "ours"), tuple(rows), ("Best first; = for equal rates.",))


def order(values: Mapping[str, float | None]) -> str:
    """Return names from the largest value to the smallest, `a > b = c`; those without a value are left out."""
    known = {agent: value for agent, value in values.items() if value is not None}
    ranked = sorted(known, key=lambda agent: (-known[agent], PAPER_ORDER.index(agent)))
    text = ""
    for before, agent in zip([None, *ranked], ranked, strict=False):
        text += agent if before is None else f" {'=' if known[before] == known[agent] else '>'} {agent}"
    return text or NONE


def _difference_table(pairs: Sequence[AgentPair], paper: dict[str, PaperResult]) -> Table:
    rows = []
    for pair in pairs:
        if pair.a not in paper or pair.b not in paper:
            continue
        a, b = paper[pair.a], paper[pair.b]
        theirs = b.sr() - a.sr()
        their_ends = newcombe(a.num_all, NUM_STAGES["all"], b.num_all, NUM_STAGES["all"])
        rows.append(
            (
                f"{pair.b} minus {pair.a}",
                with_interval(theirs, their_ends, scale=100, is_signed=True),
                points(pair.sr),
                p_words(pair.sr.adjusted_p),
                points(pair.spl),
                str(pair.n),
                verdict_words(pair.a, pair.b, pair.sr),
                _is_in(theirs, pair.sr.ci95),
                _is_in(pair.sr.difference, their_ends),
            )
        )
    columns = (
        "Agents",
        "SR, paper [95% CI]",
        "SR, ours [95% CI]",
        p_heading(len(pairs)),
        "SPL, ours [95% CI]",
        "n",
        "our verdict",
        "paper's in our interval",
        "ours in the paper's interval",
    )
    notes = (f"Percentage points, on the stages that both scored. {INTERVALS} {VERDICTS}", _PAPER_DIFFERENCE_NOTE)
    return Table("Differences between agents", columns, tuple(rows), notes)


def _is_in(value: float, interval: Interval | None) -> str:
    return NONE if interval is None else "yes" if interval[0] <= value <= interval[1] else "no"


def _theirs(known: PaperResult | None, split: str = "all") -> str:
    if known is None:
        return NONE
    return rate(known.sr(split), wilson(known.num_successes(split), NUM_STAGES[split]))
