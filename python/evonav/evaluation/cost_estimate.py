"""Estimate the cost of a run: run a few of its tasks with the text matcher and count the tokens of every prompt.

Tokens are estimated by the client, which overestimates. The interval does not include that a model decides differently
from the text matcher, takes more or fewer rounds, and is asked again after malformed answers.
"""

import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from evonav.component import Component
from evonav.decision.vlm.account import Ledger, Usage
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import Progress, RunConfig, agent_seed
from evonav.statistics import student_quantile
from evonav.tasks.listing import TaskFile


@dataclass(frozen=True, slots=True)
class RunEstimate:
    """The estimated cost of one agent."""

    agent: str
    num_stages: int
    """Number of stages of the run."""
    num_stages_run: int
    """Number of stages that were run for the estimate."""
    num_requests: float
    input_tokens: float
    output_tokens: float
    """Number of output tokens, from an assumed length of answers."""
    relative_error: float
    """Half width of a 95% interval of `input_tokens` over tasks, as a share of it; 0 if all were run, `inf` if one."""
    kinds: dict[str, float]
    """Requests by kind of question."""


def total_usage(estimates: Sequence[RunEstimate]) -> Usage:
    """Return the tokens of several estimates together."""
    return Usage(
        int(sum(estimate.input_tokens for estimate in estimates)),
        int(sum(estimate.output_tokens for estimate in estimates)),
    )


def estimate_run(
    agents: Sequence[str],
    tasks: Sequence[TaskFile],
    config: RunConfig,
    options: dict[str, Any],
    *,
    num_tasks: int = 6,
    num_workers: int = 0,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> list[RunEstimate]:
    """Run a few tasks, spread over all, and extrapolate by the number of stages.

    Args:
        config: The run's configuration; its decision model is replaced.
        options: Options of `evonav.decision.backends.counting`, without `ledger`.
        on_progress: Called after every stage.

    Raises:
        InvalidArgumentError: An agent is unknown, or there is no task.
        TaskError: A task is malformed.
    """
    chosen = [tasks[index * len(tasks) // num_tasks] for index in range(num_tasks)] if len(tasks) > num_tasks else tasks
    with tempfile.TemporaryDirectory() as folder:
        ledger = Path(folder) / "counts.sqlite"
        backend = replace(
            config.backend,
            decision=Component("evonav.decision.backends:counting", {**options, "ledger": str(ledger)}),
        )
        hosting = config.hosting
        if hosting.isolation == "sandbox":  # in which the counting model could not write its ledger
            hosting = replace(hosting, isolation="process")
        config = replace(config, backend=backend, hosting=hosting)
        evaluate(agents, chosen, Path(folder) / "run", config=config, num_workers=num_workers, on_progress=on_progress)
        booked = Ledger(ledger)
        rows = booked.spending()
        booked.close()
    num_stages = sum(task.num_stages for task in tasks)
    estimates = []
    for agent in agents:
        names = {str(agent_seed(config.seed, agent, task.task_id)): task for task in chosen}
        mine = [
            (names[name], kind, row) for row in rows for name, _, kind in (row.model.partition(" "),) if name in names
        ]
        num_run = sum(task.num_stages for task in chosen)
        scale = num_stages / num_run
        kinds: dict[str, float] = {}
        for _, kind, row in mine:
            kinds[kind] = kinds.get(kind, 0.0) + scale * row.num_asked
        tokens = [
            (task.num_stages, sum(row.input_tokens for other, _, row in mine if other is task)) for task in chosen
        ]
        estimates.append(
            RunEstimate(
                agent=agent,
                num_stages=num_stages,
                num_stages_run=num_run,
                num_requests=sum(kinds.values()),
                input_tokens=scale * sum(row.input_tokens for _, _, row in mine),
                output_tokens=scale * sum(row.output_tokens for _, _, row in mine),
                relative_error=0.0 if len(chosen) == len(tasks) else ratio_error(tokens),
                kinds=dict(sorted(kinds.items())),
            )
        )
    return estimates


def ratio_error(tokens: Sequence[tuple[int, int]]) -> float:
    """Half width of the 95% interval of tokens a stage, as a share of it.

    Args:
        tokens: Stages and tokens of each task.
    """
    num = len(tokens)
    total = sum(count for _, count in tokens)
    if num < 2:
        return math.inf
    if total == 0:
        return 0.0
    mean = total / sum(stages for stages, _ in tokens)
    variance = sum((count - mean * stages) ** 2 for stages, count in tokens) / (num - 1)
    return student_quantile(num - 1) * math.sqrt(variance / num) / (total / num)
