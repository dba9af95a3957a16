"""Schedule episode jobs and commit the workers' results."""

from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path

from evonav.evaluation.episode.outcome import as_errored, as_not_run
from evonav.evaluation.episode.spec import EpisodeSpec, unreadable_task_spec
from evonav.evaluation.metrics.navigation import AgentSummary
from evonav.evaluation.records.encoded import EncodedStage, encode_stage
from evonav.evaluation.records.schema import EndState, ErrorKind, FloorPlan, StageFailure, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.summary import write_summary
from evonav.evaluation.run.worker import CONFIG, EVENT, RETRIED, EpisodeJob, WorkerConfig, floor_plan_if_possible
from evonav.parallel.pool import Answer, Job, Pool
from evonav.tasks.listing import TaskFile


@dataclass(frozen=True, slots=True)
class Progress:
    """The progress of a run."""

    num_done: int
    """Recorded stages, those of earlier calls included."""
    num_stages: int
    latest: EncodedStage | None
    """The stage that was recorded last; `None` at the beginning."""


class RunJobs:
    """The jobs of one run, its recorded stages and its store."""

    def __init__(
        self,
        run_dir: Path,
        config: WorkerConfig,
        limit_s: float,
        agents: Sequence[str],
        tasks: Sequence[TaskFile],
        jobs: Sequence[EpisodeJob],
        states: dict[tuple[str, str, int], EndState],
    ) -> None:
        """Store the arguments; the store opens at its first use.

        Args:
            run_dir: Folder of the run, which holds a store.
            config: Configuration of the episodes.
            limit_s: Longest silence of an episode, in seconds.
            agents: Names of the requested agents.
            tasks: The run's tasks.
            jobs: Episodes with a stage that has no record.
            states: End state of every recorded stage, by agent, task and stage.
        """
        self.jobs = jobs
        self.config = config
        self.config_text = CONFIG.dump_json(config).decode()
        self.limit_s = limit_s
        self.summaries: list[AgentSummary] | None = None
        """A summary of each requested agent, once all jobs have ended."""
        self._num_left = len(jobs)
        self._run_dir = run_dir
        self._agents = agents
        self._tasks = {task.task_id: task for task in tasks}
        self._states = states
        self._keys = {
            (agent, task.task_id, stage)
            for agent in agents
            for task in tasks
            for stage in range(1, task.num_stages + 1)
        }
        self._num_done = len(self._keys & states.keys())
        self._store: RunStore | None = None

    @property
    def store(self) -> RunStore:
        """The run's store, opened at its first use."""
        if self._store is None:
            self._store = RunStore(self._run_dir)
        return self._store

    def close(self) -> None:
        """Close the store; safe to call twice."""
        if self._store is not None:
            self._store.close()
        self._store = None

    def end_job(self) -> None:
        """Note that a job has ended; after the last one, close the store and write the summary."""
        self._num_left -= 1
        if self._num_left == 0:
            self.close()
            self.summarise()

    def summarise(self) -> list[AgentSummary]:
        """Write the run's summary, and return those of the requested agents."""
        self.summaries = write_summary(self._run_dir, only=self._agents)
        return self.summaries

    def progress(self, latest: EncodedStage | None) -> Progress:
        """Return the progress, with the stage that was recorded last."""
        return Progress(self._num_done, len(self._keys), latest)

    def add(self, stage: EncodedStage) -> bool:
        """Commit a stage, unless the same record is stored: a resumed episode runs its recorded stages again.

        An agent that is not deterministic may differ from its record. An episode must not mix two rollouts, so the
        newer rollout then replaces the older from that stage on.
        """
        if stage.floor_plan is not None:
            self.store.add_floor_plan(stage.task_id, stage.stage, stage.floor_plan)
        key = stage.key
        if key in self._states:
            if self.store.record_text(*key) == stage.record:
                return False
            self.store.forget_episode(*key)
            self._states = self.store.states()
            self._num_done = len(self._keys & self._states.keys())
        self.store.add_stage(stage)
        self._states[key] = stage.state
        self._num_done += 1
        return True

    def left_behind(self, job: EpisodeJob, failure: StageFailure) -> Iterator[EncodedStage]:
        """Make up the missing stages of a job that ended early: the first is errored, the rest are not run.

        Yields:
            Stages to `add`.
        """
        task = self._tasks[job.task_id]
        plans: dict[int, FloorPlan | None] = {}
        try:
            case: EpisodeSpec = self.config.backend.tasks.create(task.path)
            if job.sends_floor_plans:
                plans = {stage: floor_plan_if_possible(case, stage) for stage in range(1, task.num_stages + 1)}
        except Exception as error:  # whatever a broken file does to whatever reads it
            message = f"the task cannot be read: {type(error).__name__}: {error}"
            failure = replace(failure, kind=ErrorKind.HARNESS, message=message)
            case = unreadable_task_spec(task.task_id, task.num_stages)
        failed: StageRecord | None = None
        for stage in range(1, task.num_stages + 1):
            if (job.agent, job.task_id, stage) in self._states:
                continue
            blank = case.blank_record(job.agent, stage)
            if failed is None or failed.error is None:
                record = failed = as_errored(blank, failure.kind, failure.message)
            else:
                record = as_not_run(blank, failed.error, failed.stage)
            yield encode_stage(record, wall_s=0.0, cpu_s=0.0, traceback=failure.traceback, floor_plan=plans.get(stage))


@dataclass(slots=True)
class _Episode:
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


class Schedule:
    """The jobs of several runs: those that wait for a worker, and those that a pool runs."""

    def __init__(self, runs: Sequence[RunJobs], num_retries: int) -> None:
        """Let all jobs wait.

        Args:
            num_retries: Number of retries of a stage whose worker was lost.
        """
        self._runs = runs
        self._num_retries = num_retries
        self._waiting = deque(_Episode(index, job) for index, run in enumerate(runs) for job in run.jobs)
        self._under_way: dict[int, _Episode] = {}
        self._numbers = count()

    def fill(self, pool: Pool) -> bool:
        """Submit waiting jobs, as the pool has room.

        Returns:
            True while a job is under way, so that there will be another answer.
        """
        while self._waiting and len(self._under_way) < pool.capacity:
            episode, number = self._waiting.popleft(), next(self._numbers)
            self._under_way[number] = episode
            run = self._runs[episode.index]
            pool.submit(Job(number, episode.job.text(run.config_text), run.limit_s, episode.is_alone))
        return bool(self._under_way)

    def take(self, answer: Answer) -> Iterator[tuple[int, EncodedStage]]:
        """Commit what a worker reports, and summarise a run whose last job has ended.

        Yields:
            Index of the run, and a stage that was committed.
        """
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

    def _is_repeated(self, episode: _Episode, failure: StageFailure, *, is_shared: bool) -> bool:
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


def _event_of(answer: Answer, run: RunJobs) -> EncodedStage | StageFailure | None:
    if answer.failure == "crash":
        return StageFailure(0, ErrorKind.CRASH, answer.detail)
    if answer.failure == "timeout":
        what = "stage" if run.config.hosting.is_in_process else "round"
        return StageFailure(0, ErrorKind.TIMEOUT, f"no {what} ended within {run.limit_s:g} s")
    if answer.failure == "error":
        message = answer.detail.strip().rpartition("\n")[2]
        return StageFailure(0, ErrorKind.HARNESS, message, answer.detail)
    return EVENT.validate_json(answer.text)
