"""Test the paper's statements about Fixed / Not Fixed (Sec. 4.3) on the agents that were run."""

from collections.abc import Sequence
from dataclasses import dataclass

from evonav.controlled.analysis import BASELINE, METRICS, Analysis, moved_keys
from evonav.report.tables.numbers import points
from evonav.report.tables.table import Table
from evonav.report.tables.verdicts import p_words
from evonav.statistics import LEVEL, MIN_CLUSTERS, PairedEffect

MEMORY_AGENTS = ("fu", "ftu", "3d-mem", "msgnav")
"""Agents of the paper's figure that keep object entries."""


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement that one number is above another."""

    paper: str
    """Statement of the paper, literally or nearly so."""
    what: str
    effect: PairedEffect
    """Positive where it is as the paper says."""

    @property
    def verdict(self) -> str:
        """Whether it holds, as far as interval and p allow."""
        effect = self.effect
        if effect.difference == 0.0:
            return "no difference"
        if effect.verdict == "few":
            return f"too few houses to tell ({effect.num_clusters})"
        if effect.verdict == "tie":
            return "same direction, not significant" if effect.difference > 0 else "other direction, not significant"
        return "holds" if effect.verdict == "b" else "the opposite holds"


def claims(analysis: Analysis) -> list[Claim]:
    """Return the paper's statements of Sec. 4.3 that can be tested with the agents that were run."""
    fixed, evolved = analysis.arms
    found: list[Claim] = []

    def add(paper: str, what: str, effect: PairedEffect | None) -> None:
        if effect is not None:
            found.append(Claim(paper, what, effect))

    there = [agent for agent in MEMORY_AGENTS if agent in analysis.paired_agents]
    if BASELINE in analysis.paired_agents:
        for agent in there:
            effect = analysis.effect((fixed, BASELINE), (fixed, agent), METRICS["SR"])
            add("Fixed: memory is ahead of Stage-Reset", f"{agent} minus {BASELINE}, Fixed", effect)
        if "fu" in there:
            effect = analysis.effect((evolved, "fu"), (evolved, BASELINE), METRICS["SR"])
            add("Not Fixed: FU is behind Stage-Reset", f"{BASELINE} minus fu, Not Fixed", effect)
            moved = moved_keys(analysis, "fu", BASELINE)
            effect = analysis.effect((evolved, "fu"), (evolved, BASELINE), METRICS["SR"], moved)
            add("the same", f"{BASELINE} minus fu, Not Fixed, where the target moved", effect)
    for agent in there:
        effect = analysis.effect((evolved, agent), (fixed, agent), METRICS["SR"])
        add("Memory drops when the scene evolves", f"{agent}, Fixed minus Not Fixed", effect)
    for careful in ("msgnav", "ftu"):
        for trusting in ("3d-mem", "fu"):
            if careful in there and trusting in there:
                effect = analysis.effect_on_change(trusting, careful, METRICS["SR"])
                add(
                    "MSGNav and FTU drop less than 3D-Mem and FU", f"drop of {trusting} minus that of {careful}", effect
                )
    if "ftu" in there:
        for agent in [*there, BASELINE]:
            if agent != "ftu" and agent in analysis.paired_agents:
                effect = analysis.effect((evolved, agent), (evolved, "ftu"), METRICS["SR"])
                add("Not Fixed: FTU is best", f"ftu minus {agent}, Not Fixed", effect)
    return found


def claim_table(analysis: Analysis) -> Table:
    """Return the claims as a table."""
    rows: Sequence[tuple[str, ...]] = [
        (
            one.paper,
            one.what,
            str(one.effect.n),
            points(one.effect),
            p_words(one.effect.p),
            one.verdict,
        )
        for one in claims(analysis)
    ]
    columns = ("the paper, Sec. 4.3", "here", "pairs", "SR, points", "p", "")
    notes = (
        f"Each by itself; no adjustment for their number. Holds: p is at most {LEVEL:g} and the interval leaves 0 out, "
        f"over at least {MIN_CLUSTERS} houses.",
    )
    return Table("The paper's statements", columns, tuple(rows), notes)
