"""Find the episodes of a run that show the benchmark best: memory misleads one agent and not another."""

from collections.abc import Sequence

from evonav.errors import InvalidArgumentError
from evonav.evaluation.metrics.stage_metrics import StageMetrics
from evonav.evaluation.records.schema import EndState
from evonav.report.run import RecordedRun, RecordedStage
from evonav.report.tables.causes import FailureCause

NUM_STAGES = 3
"""Number of stages to show, ending with the highlighted one."""


def best_highlight(run: RecordedRun, agents: Sequence[str]) -> tuple[str, list[int]]:
    """Return the episode that shows the benchmark best, and the stages to show.

    Looks for a stage where one of the agents is misled by a stale entry and another is not, or is misled and recovers;
    then for moved targets, and for change and success on the way there. The first of equals.

    Args:
        agents: Agents whose episodes to show; the last one should succeed.

    Raises:
        InvalidArgumentError: None of the run's tasks has a record of every one of the agents.
    """
    best: tuple[float, str, list[int]] | None = None
    for task_id, last_stage in run.num_stages.items():
        for stage in range(1, last_stage + 1):
            shown = list(range(max(1, stage - NUM_STAGES + 1), stage + 1))
            keys = [(agent, task_id, k) for agent in agents for k in shown]
            if any(key not in run.outcomes for key in keys):
                continue
            score = _score(run, agents, task_id, shown)
            if best is None or score > best[0]:
                best = (score, task_id, shown)
    if best is None:
        there = sorted({agent for agent, _, _ in run.outcomes})
        hint = f"it has some of {', '.join(there)}" if there else "nothing was run yet: `evonav evaluate` goes on"
        raise InvalidArgumentError(f"{run.run_dir}: no task has records of {', '.join(agents)}; {hint}")
    return best[1], best[2]


def highlights_first(run: RecordedRun) -> list[tuple[str, str]]:
    """Return agent and task of every recorded episode, the highlights first.

    A pair shows most: in one stage, an agent that a stale entry misled, and one that succeeded. Of several such agents
    of a task those with the fewest rounds are taken, which are the quickest to run again; a task's other episodes come
    after all pairs.
    """
    pairs: list[tuple[float, list[tuple[str, str]]]] = []
    rest: list[tuple[str, str]] = []
    for task_id, num_stages in run.num_stages.items():
        stages = range(1, num_stages + 1)
        there = [agent for agent in run.agents if any((agent, task_id, k) in run.outcomes for k in stages)]
        quickest = sorted(there, key=lambda agent: _num_rounds(run, agent, task_id))
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
    return score + _is_changed(row), pair


def _num_rounds(run: RecordedRun, agent: str, task_id: str) -> int:
    keys = ((agent, task_id, stage) for stage in range(1, run.num_stages[task_id] + 1))
    return sum(run.outcomes[key].row.num_rounds for key in keys if key in run.outcomes)


def _score(run: RecordedRun, agents: Sequence[str], task_id: str, stages: Sequence[int]) -> float:
    last = [run.outcomes[agent, task_id, stages[-1]] for agent in agents]
    hero = last[-1]
    has_success = hero.row.state == EndState.SUCCESS
    is_misled = any(outcome.cause is FailureCause.STALE_ENTRY for outcome in last)
    score = 6.0 * (is_misled and has_success) + 4.0 * (hero.row.stale_path_m > 0 and has_success)
    score += 2.0 * hero.row.is_relocated_now + 2.0 * has_success + len(stages)
    window = [run.outcomes[agents[-1], task_id, k].row for k in stages]
    score += sum(map(_is_changed, window))
    return score + sum(row.state == EndState.SUCCESS for row in window)


def _is_changed(row: StageMetrics) -> bool:
    return row.mode not in ("first", "static")
