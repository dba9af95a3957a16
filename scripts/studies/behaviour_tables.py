"""Tabulate what agents did, by their own counters and by how stages ended: it shows why one is ahead of another."""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.report.run import RecordedRun
from evonav.report.tables.causes import CAUSE_NAMES, FailureCause
from evonav.report.tables.numbers import NONE, percent
from evonav.report.tables.table import Table

STRATA = {"stage_1": "stage 1", "relocated": "relocated", "not_relocated": "not relocated"}
"""Names of the paper's strata."""


@dataclass(slots=True)
class BehaviourCounts:
    """Counts of one agent."""

    counters: Counter[str] = field(default_factory=Counter)
    """Over all tasks."""
    ends: Counter[str] = field(default_factory=Counter)
    """Scored stages by why the agent stopped."""
    num_stages: int = 0


def behaviour_of(run: RecordedRun) -> dict[str, BehaviourCounts]:
    """Return counters and stop reasons of every agent.

    Raises:
        StoreError: The run cannot be read.
    """
    found = {agent: BehaviourCounts() for agent in run.agents}
    for task in run.tasks():
        for agent in run.agents:
            records = [record for (name, _), record in sorted(task.records.items()) if name == agent]
            _add(found[agent], records)
    return found


def _add(behaviour: BehaviourCounts, records: Sequence[StageRecord]) -> None:
    # Counters count over a task; an agent that was lost on the way began anew.
    last: Counter[str] = Counter()
    lost_at: int | None = None
    for record in records:
        if record.is_scored:
            behaviour.num_stages += 1
            behaviour.ends[record.stop_reason or "stopped" if record.has_stopped else "budget"] += 1
        if record.memory_lost_at != lost_at:
            behaviour.counters.update(last)
            last, lost_at = Counter(), record.memory_lost_at
        if record.trace:
            last = Counter(record.trace[-1].counters)
    behaviour.counters.update(last)


def counter_table(behaviour: Mapping[str, BehaviourCounts]) -> Table:
    """Tabulate every counter, summed over tasks."""
    names = sorted({name for one in behaviour.values() for name in one.counters})
    rows = tuple(
        (
            name.replace("_", " "),
            *(str(one.counters[name]) if name in one.counters else NONE for one in behaviour.values()),
        )
        for name in names
    )
    return Table("What agents counted", ("Counter", *behaviour), rows, ("Sums over all tasks.",))


def end_table(behaviour: Mapping[str, BehaviourCounts]) -> Table:
    """Tabulate scored stages by why they ended."""
    total: Counter[str] = Counter()
    for one in behaviour.values():
        total.update(one.ends)
    rows = tuple((reason, *(str(one.ends[reason]) for one in behaviour.values())) for reason, _ in total.most_common())
    return Table(
        "How stages ended",
        ("The agent stopped for", *behaviour),
        rows,
        ("Budget: the agent used all its rounds without calling stop.",),
    )


def cause_share_table(run: RecordedRun, stratum: str) -> Table:
    """Tabulate the share of a stratum's scored stages by cause of failure.

    Args:
        run: With outcomes.
        stratum: A key of `STRATA`.
    """
    counts: dict[str, Counter[FailureCause | None]] = {agent: Counter() for agent in run.agents}
    for (agent, _, _), outcome in run.outcomes.items():
        if outcome.row.is_scored and outcome.row.stratum == stratum:
            counts[agent][outcome.cause] += 1
    causes = [cause for cause in FailureCause if any(part[cause] for part in counts.values())]
    totals = {agent: sum(part.values()) for agent, part in counts.items()}
    rows = [("n", *(str(total) for total in totals.values()))]
    for cause in (None, *causes):
        shares = [part[cause] / totals[agent] if totals[agent] else None for agent, part in counts.items()]
        rows.append(("success" if cause is None else CAUSE_NAMES[cause], *(percent(share) for share in shares)))
    title = f"Why stages failed: {STRATA[stratum]}"
    return Table(
        title, ("% of stages", *run.agents), tuple(rows), ("Each stage counts once, under the first cause that fits.",)
    )


def success_by_group(run: RecordedRun, group_of: Mapping[str, str]) -> dict[str, dict[str, tuple[int, int]]]:
    """Return successes and scored stages by group of tasks and agent.

    Args:
        run: With outcomes.
        group_of: A name for each task.
    """
    found: dict[str, dict[str, tuple[int, int]]] = defaultdict(dict)
    for (agent, task_id, _), outcome in run.outcomes.items():
        if outcome.row.is_scored:
            successes, n = found[group_of[task_id]].get(agent, (0, 0))
            is_success = outcome.row.state == EndState.SUCCESS
            found[group_of[task_id]][agent] = (successes + is_success, n + 1)
    return dict(found)
