"""Read a controlled analysis: outcomes by arm, how the arms differ, and the paper's statements (docs/controlled.md)."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evonav.controlled.layout import ControlledRecord, read_controlled, run_of
from evonav.counted import counted
from evonav.errors import StoreError
from evonav.evaluation.agent_order import agents_in_order
from evonav.evaluation.metrics.navigation import house_of
from evonav.evaluation.metrics.scoring import SUCCESS_RADIUS_M
from evonav.evaluation.records.schema import EndState
from evonav.report.run import RecordedStage, load_run
from evonav.report.tables.numbers import NONE, points
from evonav.report.tables.table import Table, short_names
from evonav.report.tables.verdicts import p_words
from evonav.statistics import LEVEL, MIN_CLUSTERS, PairedEffect, paired_effect

BASELINE = "stage-reset"
"""Agent that forgets everything between stages; memory is compared with it."""
SPLITS = {
    "target": "the target moved",
    "room": "its room changed, not it",
    "other": "another room changed",
}

Key = tuple[str, int]
"""Task and stage."""
MetricOf = Callable[[RecordedStage], float]
METRICS: dict[str, MetricOf] = {
    "SR": lambda one: float(bool(one.row.success)),
    "SPL": lambda one: one.row.spl or 0.0,
}


@dataclass(frozen=True)
class Analysis:
    """Scored stages of all agents in every arm."""

    directory: Path
    record: ControlledRecord
    agents: tuple[str, ...]
    """The paper's in its order, then others by name."""
    outcomes: Mapping[tuple[str, str], Mapping[Key, RecordedStage]]
    """Scored stages by arm and agent."""
    num_unscored: int
    """Stages that should count and have no score: errored, or not run."""

    @property
    def arms(self) -> tuple[str, ...]:
        """Their names, in order."""
        return tuple(arm.name for arm in self.record.arms)

    @property
    def names(self) -> dict[str, str]:
        """The short names of agents that people read, by agent; see `short_names`."""
        return {agent: agent for agent in self.agents} | short_names(self.agents)

    @property
    def paired_agents(self) -> tuple[str, ...]:
        """Those with a stage that is scored in every arm."""
        return tuple(agent for agent in self.agents if self.keys(agent))

    def keys(self, *agents: str) -> list[Key]:
        """Return the stages that all of some agents have scored in every arm."""
        scored = [set(self.outcomes[arm, agent]) for agent in agents for arm in self.arms]
        return sorted(set.intersection(*scored)) if scored else []

    def houses(self, keys: Sequence[Key], agent: str) -> list[str]:
        """Return the house of each stage, all of which the agent has scored."""
        return [house_of(self.outcomes[self.arms[0], agent][key].row) for key in keys]

    def values(self, agent: str, metric: MetricOf, keys: Sequence[Key]) -> NDArray[np.float64]:
        """Return a metric of some stages of an agent in every arm, `(K, A)`."""
        return np.array([[metric(self.outcomes[arm, agent][key]) for arm in self.arms] for key in keys])

    def effect(
        self, a: tuple[str, str], b: tuple[str, str], metric: MetricOf, keys: Sequence[Key] | None = None
    ) -> PairedEffect | None:
        """Compare `b` with `a`, each an arm and an agent, over the stages that both scored in every arm.

        Returns:
            `None` without a stage.
        """
        keys = self.keys(a[1], b[1]) if keys is None else keys
        if not keys:
            return None
        before, after = (self.values(agent, metric, keys)[:, self.arms.index(arm)] for arm, agent in (a, b))
        return paired_effect(before, after, self.houses(keys, a[1]))

    def effect_on_change(self, a: str, b: str, metric: MetricOf) -> PairedEffect | None:
        """Estimate how much more agent `b` gains from the first arm to the last than agent `a`, pair by pair."""
        keys = self.keys(a, b)
        if not keys:
            return None
        gain_a, gain_b = (found[:, -1] - found[:, 0] for found in (self.values(name, metric, keys) for name in (a, b)))
        return paired_effect(gain_a, gain_b, self.houses(keys, a))


def load_analysis(directory: Path) -> Analysis:
    """Read the runs of a controlled analysis, finished or not."""
    record = read_controlled(directory)
    outcomes: dict[tuple[str, str], dict[Key, RecordedStage]] = {}
    agents: set[str] = set()
    num_unscored = 0
    for arm in record.arms:
        run_dir = run_of(directory, arm.name)
        if not run_dir.is_dir():
            raise StoreError(f"{run_dir}: no run here yet: `evonav controlled evaluate {directory}` first")
        for (agent, task_id, stage), one in load_run(run_dir).outcomes.items():
            agents.add(agent)
            if one.row.is_scored:
                outcomes.setdefault((arm.name, agent), {})[task_id, stage] = one
            elif one.row.state != EndState.GUIDED:
                num_unscored += 1
    if not agents:
        raise StoreError(f"{directory}: no agent was run: `evonav controlled evaluate {directory}` first")
    ordered = agents_in_order(agents)
    for arm in record.arms:
        for agent in ordered:
            outcomes.setdefault((arm.name, agent), {})
    return Analysis(directory, record, ordered, outcomes, num_unscored)


def moved_keys(analysis: Analysis, *agents: str) -> list[Key]:
    """Return the pairs of agents whose target moved."""
    last = analysis.arms[-1]
    keys = analysis.keys(*agents)
    return [key for key in keys if split_of(analysis.outcomes[last, agents[0]][key]) == "target"]


def split_of(evolved: RecordedStage) -> str:
    """Return what a pair's change touched: a key of `SPLITS`."""
    if evolved.row.is_relocated_now:
        return "target"
    return "room" if evolved.is_change_around_target else "other"


def has_moved_far(evolved: RecordedStage) -> bool:
    """Return whether the target left the success radius around its old place; if not, it is found there too."""
    if not evolved.row.is_relocated_now or evolved.first_target_m is None:
        return False
    (x0, _, z0), (x1, _, z1) = evolved.first_target_m, evolved.target_m
    return math.dist((x0, z0), (x1, z1)) > SUCCESS_RADIUS_M


def pair_tables(analysis: Analysis) -> list[Table]:
    """Build the tables: Fixed / Not Fixed in all, by what changed, against Stage-Reset, and how stages ended."""
    tables = [_drop_table(analysis), _split_table(analysis)]
    if BASELINE in analysis.paired_agents and len(analysis.paired_agents) > 1:
        tables.append(_baseline_table(analysis))
    return [*tables, _ends_table(analysis)]


def _drop_table(analysis: Analysis) -> Table:
    fixed, evolved = analysis.arms
    rows = []
    for name, metric in METRICS.items():
        for agent in analysis.paired_agents:
            effect = analysis.effect((fixed, agent), (evolved, agent), metric)
            rows.append((f"{agent}, {name}", str(len(analysis.keys(agent))), *effect_cells(effect)))
    keys = {(fixed, agent, key) for agent in analysis.paired_agents for key in analysis.keys(agent)}
    num_houses = len({house_of(analysis.outcomes[arm, agent][key].row) for arm, agent, key in keys})
    notes = (
        f"{counted(num_houses, 'house')}. Rates in %; changes in points, Not Fixed minus Fixed, with 95% "
        "intervals (bootstrap by house) and paired two-sided p (signs exchanged by house).",
        *_caveats(analysis),
    )
    return Table("Fixed / Not Fixed", ("agent", "pairs", "Fixed", "Not Fixed", "change", "p"), tuple(rows), notes)


def _caveats(analysis: Analysis) -> list[str]:
    """Return the warnings about the pairs."""
    first = analysis.arms[0]
    radius_m = SUCCESS_RADIUS_M
    near = {
        key
        for agent in analysis.paired_agents
        for key in analysis.keys(agent)
        if (analysis.outcomes[first, agent][key].row.start_distance_m or 0.0) < radius_m
    }
    found = []
    if near:
        found.append(f"In {counted(len(near), 'pair')} the evaluated stage begins within {radius_m:g} m of the target.")
    if analysis.num_unscored:
        found.append(f"Left out with their pairs, as errored or not run: {counted(analysis.num_unscored, 'stage')}.")
    return found


def _split_table(analysis: Analysis) -> Table:
    fixed, evolved = analysis.arms
    rows = []
    parts: list[tuple[str, Callable[[RecordedStage], bool]]] = [
        (name, lambda one, split=split: split_of(one) == split)  # type: ignore[misc]
        for split, name in SPLITS.items()
    ]
    parts.insert(1, (f"of these by more than {SUCCESS_RADIUS_M:g} m", has_moved_far))
    for name, is_part in parts:
        for agent in analysis.paired_agents:
            keys = analysis.keys(agent)
            part = [key for key in keys if is_part(analysis.outcomes[evolved, agent][key])]
            effect = analysis.effect((fixed, agent), (evolved, agent), METRICS["SR"], part)
            rows.append((f"{name}: {agent}", str(len(part)), *effect_cells(effect)))
    columns = ("what changed, agent", "pairs", "SR Fixed", "Not Fixed", "change", "p")
    return Table("By what changed", columns, tuple(rows))


def _baseline_table(analysis: Analysis) -> Table:
    rows = []
    for agent in analysis.paired_agents:
        if agent == BASELINE:
            continue
        row = [agent, str(len(analysis.keys(agent, BASELINE)))]
        for arm in analysis.arms:
            row += effect_cells(analysis.effect((arm, BASELINE), (arm, agent), METRICS["SR"]))[2:]
        row += effect_cells(analysis.effect_on_change(BASELINE, agent, METRICS["SR"]))[2:]
        rows.append(tuple(row))
    columns = ("agent", "pairs", "Fixed", "p", "Not Fixed", "p", "what the change does to it", "p")
    notes = (f"SR of the agent minus that of {BASELINE} on the same pairs, in points; last, Not Fixed minus Fixed.",)
    return Table("Against searching from scratch", columns, tuple(rows), notes)


def _ends_table(analysis: Analysis) -> Table:
    rows = []
    for agent in analysis.paired_agents:
        keys = analysis.keys(agent)
        for arm, arm_name in zip(analysis.arms, ("Fixed", "Not Fixed"), strict=True):
            found = [analysis.outcomes[arm, agent][key].row for key in keys]
            rows.append(
                (
                    f"{agent}, {arm_name}",
                    str(len(found)),
                    str(sum(not row.success for row in found)),
                    str(sum(row.cause == "stale_entry" for row in found)),
                    f"{sum(row.num_stale_visits for row in found) / len(found):.2f}",
                    f"{sum(row.stale_path_m for row in found) / len(found):.2f}",
                    f"{sum(row.path_length_m or 0.0 for row in found) / len(found):.1f}",
                    f"{sum(row.num_rounds for row in found) / len(found):.1f}",
                )
            )
    columns = (
        "agent, arm",
        "stages",
        "failures",
        "stopped at a stale entry",
        "visits to stale entries a stage",
        "metres on them",
        "metres in all",
        "rounds",
    )
    return Table("How the evaluated stages went", columns, tuple(rows))


def effect_cells(effect: PairedEffect | None) -> list[str]:
    """Return the mean of a, the mean of b, their difference with interval, and p."""
    if effect is None:
        return [NONE] * 4
    return [
        f"{100 * effect.mean_a:.1f}",
        f"{100 * effect.mean_b:.1f}",
        points(effect),
        p_words(effect.p),
    ]


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
