"""Find the episodes of a run that show the benchmark best: memory misleads one agent and not another."""

from collections import Counter
from collections.abc import Sequence

from evonav.errors import InvalidArgumentError
from evonav.evaluation.records.schema import EndState
from evonav.report.run import RecordedRun, RecordedStage
from evonav.report.tables.causes import FailureCause


def highlights_first(run: RecordedRun, agents: Sequence[str] = ()) -> list[tuple[str, str]]:
    """Return agent and task of every recorded episode of some agents, by default of all, the highlights first.

    A pair shows most: in one stage, an agent that a stale entry misled, and one that succeeded. Of several such agents
    of a task those with the fewest rounds are taken, which are the quickest to run again; a task's other episodes come
    after all pairs.
    """
    num_rounds: Counter[tuple[str, str]] = Counter()
    for (agent, task_id, _), outcome in run.outcomes.items():
        num_rounds[agent, task_id] += outcome.row.num_rounds
    pairs: list[tuple[float, list[tuple[str, str]]]] = []
    rest: list[tuple[str, str]] = []
    for task_id, num_stages in run.num_stages.items():
        stages = range(1, num_stages + 1)
        there = [agent for agent in agents or run.agents if (agent, task_id) in num_rounds]
        quickest = sorted(there, key=lambda agent: num_rounds[agent, task_id])
        best: tuple[float, list[str]] = (-1.0, [])
        for stage in stages:
            found = {
                agent: run.outcomes[agent, task_id, stage]
                for agent in quickest
                if (agent, task_id, stage) in run.outcomes
            }
            best = max(best, _pair(found), key=lambda pair: pair[0])
        pairs.append((best[0], [(agent, task_id) for agent in best[1]]))
        rest += [(agent, task_id) for agent in quickest if agent not in best[1]]
    pairs.sort(key=lambda pair: -pair[0])
    return [episode for _, pair in pairs for episode in pair] + rest


def highlight_task(run: RecordedRun, agents: Sequence[str]) -> str:
    """Return the task of the first highlight of these agents that all of them have recorded.

    Raises:
        InvalidArgumentError: None of the run's tasks has a record of every one of the agents.
    """
    recorded = {(agent, task_id) for agent, task_id, _ in run.outcomes}
    for _, task_id in highlights_first(run, agents):
        if all((agent, task_id) in recorded for agent in agents):
            return task_id
    there = sorted({agent for agent, _ in recorded})
    hint = f"it has some of {', '.join(there)}" if there else "nothing was run yet: `evonav evaluate` goes on"
    raise InvalidArgumentError(f"{run.run_dir}: no task has records of {', '.join(agents)}; {hint}")


def _pair(found: dict[str, RecordedStage]) -> tuple[float, list[str]]:
    """Rate how well a stage shows the benchmark, and name the agents that show it."""
    good = [agent for agent, outcome in found.items() if outcome.row.state == EndState.SUCCESS]
    misled = [agent for agent, outcome in found.items() if outcome.cause is FailureCause.STALE_ENTRY]
    bad = misled or [agent for agent, outcome in found.items() if outcome.row.state == EndState.FAILURE]
    pair = bad[:1] + good[:1]
    if not pair:
        return -1.0, []
    row = found[pair[0]].row
    score = 6.0 * bool(misled) + 3.0 * (len(pair) == 2) + 2.0 * row.is_relocated_now
    return score + (row.mode not in ("first", "static")), pair
