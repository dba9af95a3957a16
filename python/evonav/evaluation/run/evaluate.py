"""Evaluate agents on tasks into one folder or several, with any number of workers; run again to resume."""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from typing import Any

from evonav.component import Component
from evonav.decision.vlm.shared_file import fold_log
from evonav.errors import InvalidArgumentError
from evonav.evaluation.hosting.isolation import agents_scratch
from evonav.evaluation.metrics.navigation import AgentSummary
from evonav.evaluation.records.encoded import EncodedStage
from evonav.evaluation.records.schema import ErrorKind, StageFailure
from evonav.evaluation.records.store import FILE_NAME
from evonav.evaluation.run import PROGRAM
from evonav.evaluation.run.run import Evaluation, Progress, RunConfig
from evonav.evaluation.run.run_settings import NUM_RETRIES
from evonav.evaluation.run.worker import EVENT, RETRIED, EpisodeJob, worker_settings
from evonav.parallel.folders import writing
from evonav.parallel.pool import Answer, Job, Pool, open_pool
from evonav.parallel.worker import Workforce
from evonav.tasks.listing import TaskFile


def evaluate(
    agents: Sequence[str],
    tasks: Sequence[TaskFile],
    run_dir: Path,
    *,
    config: RunConfig | None = None,
    num_workers: int = 1,
    episodes_at_once: int = 1,
    num_retries: int = NUM_RETRIES,
    retry_errored: bool = False,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> list[AgentSummary]:
    """Evaluate agents on tasks with workers on this machine; call it again on the same folder to resume.

    Args:
        agents: Names, see `evonav agents`.
        tasks: See `task_files`.
        run_dir: Holds `records.sqlite` and `summary.json`.
        config: Must be the run's own when the folder already holds one.
        num_workers: Processes of this machine; 0 runs everything in this process.
        episodes_at_once: Episodes that each of them runs at once, with agents in processes of their own.
        num_retries: Number of retries of a stage, see `evaluate_all`.
        retry_errored: Run errored stages again, and those that were not run because of them.
        on_progress: Called after every recorded stage.

    Returns:
        One summary for each agent.

    Raises:
        InvalidArgumentError: An agent is unknown, or named twice.
        StoreError: The folder holds a run of another configuration or cannot be written.
        EngineError: Workers do not start.
    """
    (summaries,) = evaluate_all(
        [Evaluation(tuple(agents), tuple(tasks), run_dir, config or RunConfig())],
        Workforce(num_workers, jobs_at_once=episodes_at_once),
        num_retries=num_retries,
        retry_errored=retry_errored,
        on_progress=lambda _, progress: on_progress(progress),
    )
    return summaries


def evaluate_all(
    runs: Sequence[Evaluation],
    workforce: Workforce,
    *,
    num_retries: int = NUM_RETRIES,
    retry_errored: bool = False,
    on_progress: Callable[[int, Progress], None] = lambda _, __: None,
) -> list[list[AgentSummary]]:
    """Run what is left of several runs, with one set of workers for all.

    Args:
        runs: Each in a folder of its own.
        workforce: The workers that all runs share.
        num_retries: Number of retries of a stage that lost its worker, its simulator or its agent's process, or in
            which evonav itself failed. Every failure is recorded, see `RunStore.failures`.
        retry_errored: Run errored stages again, and those that were not run because of them.
        on_progress: Called with the index of a run as it begins and after each of its recorded stages.

    Returns:
        For each run, one summary for each agent.

    Raises:
        InvalidArgumentError: An agent is unknown or named twice, or two runs have the same folder.
        StoreError: A folder holds a run of another configuration or cannot be written.
        PerceptionError: Models of a perception are missing.
        EngineError: Workers do not start.
    """
    num_workers = workforce.num_workers
    if len({run.run_dir.absolute() for run in runs}) != len(runs):
        raise InvalidArgumentError("two runs have the same folder")
    known: set[tuple[str, str]] = set()
    for run in runs:
        run.check(workforce, known)
    for run in runs:
        if not (run.run_dir / FILE_NAME).exists():  # a run that cannot begin leaves no folder behind
            run.config.backend.check_perception(run.agents)
    with ExitStack() as stack:
        has_sandbox = any(run.config.hosting.isolation == "sandbox" for run in runs)
        # Deleted at the end, also if a worker could not clean up.
        scratch = stack.enter_context(agents_scratch()) if has_sandbox else None
        for index, run in enumerate(runs):
            stack.enter_context(writing(run.run_dir))
            stack.enter_context(closing(run))
            run.begin(workforce, scratch, num_retries, retry_errored=retry_errored)
            on_progress(index, run.progress(None))
        if num_jobs := sum(len(run.jobs) for run in runs):
            schedule = JobSchedule(runs, num_retries)
            with open_pool(
                PROGRAM.work,
                worker_settings(workforce.jobs_at_once, [run.setup for run in runs]),
                replace(workforce, num_workers=min(num_workers, num_jobs)),
                timeout_s=max(run.limit_s for run in runs),
                max_losses=0,  # the schedule counts them
                prelude=PROGRAM.prelude,
            ) as pool:
                while schedule.fill(pool):
                    for index, stage in schedule.take(pool.next_answer()):
                        on_progress(index, runs[index].progress(stage))
            for run in runs:
                _fold_logs(run.config.backend.decision)
        return [run.summaries or run.summarise() for run in runs]


@dataclass(slots=True)
class _JobState:
    """A job and how it goes."""

    index: int
    """Index of its run."""
    job: EpisodeJob
    stage: int = 1
    """Stage that this attempt runs."""
    is_alone: bool = False
    """Run it on a worker that runs no other episode."""
    num_tried: Counter[int] = field(default_factory=Counter)
    """Number of failed attempts by stage."""


class JobSchedule:
    """The jobs of several runs: those that wait for a worker, and those that a pool runs."""

    def __init__(self, runs: Sequence[Evaluation], num_retries: int) -> None:
        """Let all jobs wait."""
        self._runs = runs
        self._num_retries = num_retries
        self._waiting = deque(_JobState(index, job) for index, run in enumerate(runs) for job in run.jobs)
        self._under_way: dict[int, _JobState] = {}
        self._numbers = count()

    def fill(self, pool: Pool) -> bool:
        """Submit waiting jobs, as the pool has room; true while a job is under way, so that an answer will come."""
        while self._waiting and len(self._under_way) < pool.capacity:
            episode, number = self._waiting.popleft(), next(self._numbers)
            self._under_way[number] = episode
            run = self._runs[episode.index]
            pool.submit(Job(number, episode.job.text(episode.index), run.limit_s, episode.is_alone))
        return bool(self._under_way)

    def take(self, answer: Answer) -> Iterator[tuple[int, EncodedStage]]:
        """Commit what a worker reports, with the index of its run, and summarise a run whose last job has ended."""
        episode = self._under_way.pop(answer.key) if answer.is_end else self._under_way[answer.key]
        if answer.is_displaced:  # another episode's fault, which costs this one no retry
            episode.stage = 1
            self._waiting.appendleft(episode)
            return
        run = self._runs[episode.index]
        event = _event_of(answer, run)
        stages: Iterable[EncodedStage] = ()
        if isinstance(event, EncodedStage):
            episode.stage = event.stage + 1
            stages = (event,)
        elif event is not None:
            failure = replace(event, stage=event.stage or episode.stage)
            is_repeated = answer.is_end and self._is_repeated(episode, failure, is_shared=answer.is_shared)
            if is_repeated or not answer.is_end:  # before its end, the worker tries again itself
                run.store.add_retry(episode.job.agent, episode.job.task_id, failure)
                episode.stage = 1
            else:
                stages = run.left_behind(episode.job, failure)
            if is_repeated:
                self._waiting.appendleft(episode)
                return
        for stage in stages:
            if run.add(stage):
                yield episode.index, stage
        if answer.is_end:
            run.end_job()

    def _is_repeated(self, episode: _JobState, failure: StageFailure, *, is_shared: bool) -> bool:
        """Return true if a retry of the stage is left, and use it up.

        A lost worker that ran several episodes does not tell which of them was the cause. So none of them fails by it:
        one without a retry left runs once more, alone.
        """
        if failure.kind not in RETRIED:
            return False
        if episode.num_tried[failure.stage] < self._num_retries:
            episode.num_tried[failure.stage] += 1
            return True
        episode.is_alone = episode.is_alone or is_shared
        return is_shared


def _event_of(answer: Answer, run: Evaluation) -> EncodedStage | StageFailure | None:
    if answer.failure == "crash":
        return StageFailure(0, ErrorKind.CRASH, answer.detail)
    if answer.failure == "timeout":
        what = "stage" if run.setup.hosting.is_in_process else "round"
        return StageFailure(0, ErrorKind.TIMEOUT, f"no {what} ended within {run.limit_s:g} s")
    if answer.failure == "error":
        message = answer.detail.strip().rpartition("\n")[2]
        return StageFailure(0, ErrorKind.HARNESS, message, answer.detail)
    return EVENT.validate_json(answer.text)


def _fold_logs(decision: Component[Any]) -> None:
    """Make the files of a run's answers and costs whole, after the processes that wrote to them have ended."""
    for key in ("cache", "ledger"):
        if (path := decision.host_options.get(key)) is not None:
            fold_log(Path(path))
