"""Build all tables and plots of a run, and sentences that claim no more than the numbers allow."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Literal

from evonav.counted import counted
from evonav.evaluation.metrics.belief import belief_summary
from evonav.evaluation.metrics.navigation import AgentSummary
from evonav.evaluation.records.schema import EndState
from evonav.report.compare.breakdown import Breakdown, breakdown, breakdown_plot, breakdown_table
from evonav.report.compare.selection import agents_of
from evonav.report.plots.specs import Gap, GapPlot, Plot
from evonav.report.run import RecordedRun
from evonav.report.tables import table as tables
from evonav.report.tables.numbers import NONE, percent, rate
from evonav.report.tables.verdicts import paired_table, sentence
from evonav.statistics import MIN_CLUSTERS

PLOTTED = (
    ("stratum", "success"),
    ("stratum", "spl"),
    ("mode", "success"),
    ("path-length", "success"),
    ("earlier-stages", "success"),
    ("radius", "success"),
)
"""Breakdowns with a plot: groups and metric."""
TABLED = (("path-length", "success"), ("room-count", "success"), ("radius", "success"))
"""Breakdowns that have no table of their own elsewhere on the page."""
Breakdowns = Mapping[tuple[str, str], Breakdown]
"""Breakdowns by groups and metric."""
_CAPTIONS = {
    "stratum": "First: stage 1. Moved: the target had moved since stage 1, at any time.",
    "mode": "What changed in the house just before the stage.",
    "path-length": "Shortest path from where the agent began the stage to the target.",
    "earlier-stages": "Number of stages of the task before this one, which memory may know.",
    "radius": "The same stages judged by other success radii than the one that the agents ran with.",
}


def run_breakdowns(run: RecordedRun) -> Breakdowns:
    """Return the breakdowns of a run that have a table or a plot, without those that have no group."""
    agents = [one for one in agents_of(run) if any(row.is_scored for row in one.rows.values())]
    wanted = dict.fromkeys((*TABLED, *PLOTTED)) if agents else ()
    found = {(by, metric): breakdown(agents, by, metric) for by, metric in wanted}
    return {key: one for key, one in found.items() if one.groups}


def run_plots(run: RecordedRun, breakdowns: Breakdowns) -> list[tuple[Plot, str]]:
    """Return the plots of a run with their captions, in reading order; none of a run without a scored stage."""
    plots: list[tuple[Plot, str]] = []
    if len(run.pairs) > 0:
        caption = "On the stages that both scored; 95% intervals, bootstrap by house. Blue: ahead, as the table says."
        for name in ("SR", "SPL"):
            effects = [(pair, pair.sr if name == "SR" else pair.spl) for pair in run.pairs]
            gaps = tuple(
                Gap.of(f"{run.names[pair.b]} minus {run.names[pair.a]}", f"n = {pair.n}", effect)
                for pair, effect in effects
            )
            plot = GapPlot(f"{name} differences, points", gaps, "the second is better", "the first is better")
            plots.append((plot, caption))
    for one in (breakdowns[key] for key in PLOTTED if key in breakdowns):
        plots.append((breakdown_plot(one), f"{_CAPTIONS[one.by]} 95% intervals, bootstrap by house."))
    return plots


def run_tables(run: RecordedRun, breakdowns: Breakdowns) -> list[tables.Table]:
    """Return all tables of a run, in reading order."""
    return [
        tables.headline(run.summaries),
        paired_table([(pair.a, pair.b, pair.sr, pair.spl, pair.num_only_a, pair.num_only_b) for pair in run.pairs]),
        tables.stage_table(run.rows_by_agent()),
        *tables.split_tables(run.summaries),
        tables.cause_table(run.cause_counts()),
        effort_table(run),
        belief_table(run),
        failure_table(run),
        *(breakdown_table(breakdowns[key]) for key in TABLED if key in breakdowns),
    ]


def effort_table(run: RecordedRun) -> tables.Table:
    """Build the table of what success cost, and what believing stale entries cost: means per scored stage."""
    columns = ("Agent", "SoftSPL %", "rounds", "path m", "path to stale entries m", "stale entries", "stopped itself")
    rows = []
    for summary in run.summaries:
        scored = run.scored(summary.agent)
        if not scored:
            continue
        averages = (
            sum(outcome.row.num_rounds for outcome in scored) / len(scored),
            summary.mean_path_length_m or 0.0,
            sum(outcome.row.stale_path_m for outcome in scored) / len(scored),
            sum(outcome.row.num_stale_entries or 0 for outcome in scored) / len(scored),
        )
        ended = f"{summary.num_stopped} of {summary.n}"
        rows.append((summary.agent, percent(summary.soft_spl), *(f"{x:.1f}" for x in averages), ended))
    note = (
        "Means over scored stages. Path to stale entries: walked in rounds that chose an object entry with no object "
        "of its label there. Stale entries: in memory at the end of a stage."
    )
    return tables.Table("Effort and staleness", columns, tuple(rows), (note,))


def belief_table(run: RecordedRun) -> tables.Table:
    """Build the table of the probabilities that agents told as stages began; no row for an agent that tells none."""
    columns = ("Agent", "stages", "NLL", "Brier", "ECE", "rank", "entries", "NLL", "Brier", "ECE")
    rows = []
    for agent in run.agents:
        outcomes = (outcome for key, outcome in run.outcomes.items() if key[0] == agent)
        beliefs = [(outcome.target_m, outcome.belief) for outcome in outcomes if outcome.belief]
        found = belief_summary(beliefs, run.success_radius_m)
        place = (found.place_nll, found.place_brier, found.place_ece)
        presence = found.presence
        if found.num_placed == 0 and presence is None:
            continue
        rank = NONE if found.median_rank is None else f"{found.median_rank:.0f}"
        entries = (None, None, None) if presence is None else (presence.nll, presence.brier, presence.ece)
        numbers = [NONE if one is None else f"{one:.2f}" for one in (*place, *entries)]
        counts = str(found.num_placed), "0" if presence is None else str(presence.n)
        rows.append((agent, counts[0], *numbers[:3], rank, counts[1], *numbers[3:]))
    note = (
        "Lower is better. Stages: the belief of where the target is, after the first look; NLL in nats, of the "
        "probability within the success radius of the target; ECE, of the likeliest place; rank, the median of that "
        "of the target's square. Entries: the belief that their objects are still there, as stages begin."
    )
    return tables.Table("Belief as stages began", columns, tuple(rows), (note,))


def failure_table(run: RecordedRun) -> tables.Table:
    """Build the table of failures of agents and models, and of stages that were scored after one; no row without."""
    columns = ("Agent", "errored stages", "failed decisions", "in stages", "scored after a failure", "without memory")
    rows = []
    for agent in run.agents:
        outcomes = [outcome for key, outcome in run.outcomes.items() if key[0] == agent]
        kinds = Counter(
            outcome.error.kind.value.replace("_", " ")
            for outcome in outcomes
            if outcome.error is not None and outcome.row.state == EndState.ERRORED
        )
        scored = [outcome.row for outcome in outcomes if outcome.row.is_scored]
        counts = (
            sum(outcome.row.num_failed_decisions or 0 for outcome in outcomes),
            sum(bool(outcome.row.num_failed_decisions) for outcome in outcomes),
            sum(bool(row.num_failed_before) for row in scored),
            sum(row.has_lost_memory for row in scored),
        )
        if kinds or any(counts):
            errored = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items())) or NONE
            rows.append((agent, errored, *map(str, counts)))
    note = (
        "Failed decisions: the model gave no valid answer in any try, and the agent went on without one. Scored after "
        "a failure: an earlier stage of the task is errored. Without memory: the agent's process ended in that stage."
    )
    return tables.Table("What failed", columns, tuple(rows), (note,))


def statements(run: RecordedRun) -> list[str]:
    """Describe what the run shows, in sentences that claim no more than the intervals allow."""
    scored = [summary for summary in run.summaries if summary.sr is not None]
    if not scored:
        return ["No stage has been scored yet."]
    if any(summary.is_incomplete for summary in run.summaries):
        return ["Not every agent has been scored on every stage: compare agents by their paired differences alone."]
    best, *_ = sorted(scored, key=lambda s: (-(s.sr or 0.0), -(s.spl or 0.0)))
    lines = [_highest("success rate", scored, "sr"), _highest("SPL", scored, "spl")] if len(scored) > 1 else []
    pairs = [pair for pair in run.pairs if best.agent in (pair.a, pair.b)]
    if pairs and all(pair.sr.num_clusters < MIN_CLUSTERS for pair in pairs):
        return [*lines, f"{counted(pairs[0].sr.num_clusters, 'house')}: too few to tell agents apart."]
    for pair in pairs:
        for name, one in (("SR", pair.sr), ("SPL", pair.spl)):
            lines.append(sentence(pair.a, pair.b, one, name, num_pairs=len(run.pairs)))
    return lines


def _highest(title: str, summaries: Sequence[AgentSummary], name: Literal["sr", "spl"]) -> str:
    """Name the agents with the highest rate; `name` is a field of their summaries."""
    values = [(getattr(summary, name) or 0.0, summary) for summary in summaries]
    highest = max(value for value, _ in values)
    first, *others = (summary for value, summary in values if value == highest)
    if others:
        names = [first.agent, *(summary.agent for summary in others)]
        return f"{', '.join(names[:-1])} and {names[-1]} have the same {title}, {percent(highest)}%, the highest."
    measured = rate(highest, getattr(first, f"{name}_ci95"))
    return f"{first.agent} has the highest {title}, {measured} % of {counted(first.n, 'stage')}."
