"""Run every arm of a controlled analysis (`evonav.controlled.layout`), each into an ordinary run folder."""

from collections.abc import Callable, Sequence
from pathlib import Path

from evonav.controlled.layout import read_controlled, run_of, tasks_of
from evonav.evaluation.metrics.navigation import AgentSummary
from evonav.evaluation.run.evaluate import evaluate_all
from evonav.evaluation.run.run import Evaluation, Progress, RunConfig
from evonav.evaluation.run.run_settings import NUM_RETRIES
from evonav.parallel.worker import Workforce
from evonav.tasks.listing import task_files


def evaluate_controlled(
    directory: Path,
    agents: Sequence[str],
    *,
    config: RunConfig | None = None,
    workforce: Workforce | None = None,
    num_retries: int = NUM_RETRIES,
    retry_errored: bool = False,
    on_progress: Callable[[str, Progress], None] = lambda _arm, _progress: None,
) -> dict[str, list[AgentSummary]]:
    """Evaluate agents on every arm; called again, evaluate what is missing.

    An agent has the same seed in every arm, since its seed is a function of the run's seed and the names of agent and
    task.

    Args:
        workforce: The workers that all arms share. Default: one process, with one episode at a time.
        on_progress: Called with an arm's name after each of its recorded stages.
    """
    arms = [arm.name for arm in read_controlled(directory).arms]
    runs = [
        Evaluation(
            tuple(agents),
            tuple(task_files(tasks_of(directory, arm))),
            run_of(directory, arm),
            config or RunConfig(),
        )
        for arm in arms
    ]
    summaries = evaluate_all(
        runs,
        workforce or Workforce(1),
        num_retries=num_retries,
        retry_errored=retry_errored,
        on_progress=lambda index, progress: on_progress(arms[index], progress),
    )
    return dict(zip(arms, summaries, strict=True))
