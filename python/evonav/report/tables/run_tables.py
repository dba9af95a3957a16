"""Build all tables of a run, and sentences that claim no more than the numbers allow."""

from collections import Counter

from evonav.evaluation.records.schema import EndState
from evonav.report.compare.breakdown import breakdown_table
from evonav.report.plots.run_plots import run_breakdowns
from evonav.report.run import Run
from evonav.report.tables import table as tables
from evonav.report.tables.numbers import NONE, percent, points
from evonav.statistics import MIN_CLUSTERS


def run_tables(run: Run) -> list[tables.Table]:
    """Return all tables of a run, in reading order."""
    records = run.records_by_agent()
    return [
        tables.headline(run.summaries),
        tables.paired_table(run.pairs),
        tables.stage_table(records),
        tables.relocation_table(run.summaries),
        tables.mode_table(run.summaries),
        tables.cause_table(run.cause_counts()),
        effort_table(run),
        failure_table(run),
        *(breakdown_table(one) for one in run_breakdowns(run)),
    ]


def effort_table(run: Run) -> tables.Table:
    """Build the table of what success cost, and what believing stale entries cost: means per scored stage."""
    columns = ("Agent", "SoftSPL %", "rounds", "walked m", "of it to stale entries m", "stale entries", "ended itself")
    rows = []
    for summary in run.summaries:
        scored = run.scored(summary.agent)
        if not scored:
            continue
        averages = (
            sum(outcome.record.num_rounds for outcome in scored) / len(scored),
            summary.mean_path_length_m or 0.0,
            sum(outcome.row.stale_path_m for outcome in scored) / len(scored),
            sum(outcome.row.num_stale_entries or 0 for outcome in scored) / len(scored),
        )
        ended = f"{summary.num_stopped} of {summary.n}"
        rows.append((summary.agent, percent(summary.soft_spl, None), *(f"{x:.1f}" for x in averages), ended))
    note = (
        "Means a scored stage. Walked to stale entries: in rounds that chose an object entry with no object of its "
        "label there. Stale entries: in memory at the end of a stage."
    )
    return tables.Table("Effort and staleness", columns, tuple(rows), (note,))


def failure_table(run: Run) -> tables.Table:
    """Build the table of failures of agents and models, and of stages that were scored after one; no row without."""
    columns = ("Agent", "errored stages", "failed decisions", "in stages", "scored after a failure", "without memory")
    rows = []
    for agent in run.agents:
        outcomes = [outcome for key, outcome in run.outcomes.items() if key[0] == agent]
        kinds = Counter(
            outcome.record.error.kind.value.replace("_", " ")
            for outcome in outcomes
            if outcome.record.error is not None and outcome.record.state is EndState.ERRORED
        )
        scored = [outcome.record for outcome in outcomes if outcome.record.is_scored]
        counts = (
            sum(outcome.row.num_failed_decisions or 0 for outcome in outcomes),
            sum(bool(outcome.row.num_failed_decisions) for outcome in outcomes),
            sum(bool(record.failed_before) for record in scored),
            sum(record.memory_lost_at is not None for record in scored),
        )
        if kinds or any(counts):
            errored = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items())) or NONE
            rows.append((agent, errored, *map(str, counts)))
    note = (
        "Failed decisions: no valid answer of the model in all tries; the agent then did what it does without one. "
        "Scored after a failure: an earlier stage of the task is errored; without memory: the agent's process was lost "
        "in it."
    )
    return tables.Table("What failed", columns, tuple(rows), (note,))


def statements(run: Run) -> list[str]:
    """Describe what the run shows, in sentences that claim no more than the intervals allow."""
    scored = sorted((s for s in run.summaries if s.sr is not None), key=lambda s: -(s.sr or 0.0))
    if not scored:
        return ["No stage has been scored yet."]
    best = scored[0]
    if any(summary.is_incomplete for summary in run.summaries):
        return ["Not every agent has been scored on every stage: compare agents by their paired differences alone."]
    equal = [summary.agent for summary in scored if summary.sr == best.sr]
    if len(equal) > 1:
        lines = [f"{' and '.join(equal)} have the same success rate, {percent(best.sr, None)} %."]
    else:
        measured = percent(best.sr, best.sr_ci95)
        lines = [f"{best.agent} has the highest success rate, {measured} % of {best.n} stages."]
    pairs = [pair for pair in run.pairs if best.agent in (pair.a, pair.b)]
    if pairs and all(pair.sr.num_clusters < MIN_CLUSTERS for pair in pairs):
        lines.append(f"{pairs[0].sr.num_clusters} houses are too few to tell agents apart.")
        return lines
    for pair in pairs:
        lines.append(
            f"{pair.b} less {pair.a}: {points(pair.sr)} points on the {pair.n} stages that both scored: "
            f"{tables.verdict_words(pair.a, pair.b, pair.sr)}."
        )
    return lines
