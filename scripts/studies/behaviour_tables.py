"""Tabulate how stages ended and why they failed: it shows why one agent is ahead of another."""

from collections import Counter, defaultdict
from collections.abc import Mapping

from evonav.evaluation.records.schema import EndState
from evonav.report.run import RecordedRun
from evonav.report.tables.causes import CAUSE_NAMES, FailureCause
from evonav.report.tables.numbers import percent
from evonav.report.tables.table import Table

STRATA = {"stage_1": "stage 1", "relocated": "relocated", "not_relocated": "not relocated"}
"""Names of the paper's strata."""


def ends_of(run: RecordedRun) -> dict[str, Counter[str]]:
    """Count the scored stages of every agent by why it stopped.

    Raises:
        StoreError: The run cannot be read.
    """
    found: dict[str, Counter[str]] = {agent: Counter() for agent in run.agents}
    for task in run.tasks():
        for (agent, _), record in task.records.items():
            if record.is_scored:
                found[agent][record.stop_reason or "stopped" if record.has_stopped else "budget"] += 1
    return found


def end_table(ends: Mapping[str, Counter[str]]) -> Table:
    """Tabulate scored stages by why they ended."""
    total = sum(ends.values(), Counter[str]())
    rows = tuple((reason, *(str(one[reason]) for one in ends.values())) for reason, _ in total.most_common())
    return Table(
        "How stages ended",
        ("The agent stopped for", *ends),
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
