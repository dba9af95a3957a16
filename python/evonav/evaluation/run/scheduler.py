"""The bookkeeping of runs that are under way: news of workers into records."""

from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path

from evonav.evaluation.episode.outcome import as_errored, as_not_run
from evonav.evaluation.episode.spec import EpisodeSpec, unreadable_task_spec
from evonav.evaluation.records.encoded import EncodedStage, encode_stage
from evonav.evaluation.records.schema import EndState, ErrorKind, FloorPlan, StageFailure, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.worker import RETRIED, EpisodeJob, Setup, decode_event, floor_plan_if_possible
from evonav.parallel.pool import Answer, Job, Pool
from evonav.tasks.listing import TaskFile


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a run is."""

    num_done: int
    """Recorded stages, those of earlier calls included."""
    num_stages: int
    latest: EncodedStage | None
    """The stage that was recorded last; `None` at the beginning."""


class Run:
    """One run's: what is recorded, and what is left."""

    def __init__(
        self,
        run_dir: Path,
        setup: Setup,
        limit_s: float,
        agents: Sequence[str],
        tasks: Sequence[TaskFile],
        jobs: Sequence[EpisodeJob],
        states: dict[tuple[str, str, int], EndState],
    ) -> None:
        """Opens nothing yet.

        Args:
            run_dir: Holds a store.
            setup: Of the episodes.
            limit_s: Without a word of an episode.
            agents: Asked for.
            tasks: Of the run.
            jobs: Episodes with a stage that has no record.
            states: Of all that is recorded.
        """
        self.jobs = jobs
        self.setup = setup
        self.setup_text = setup.text
        self.limit_s = limit_s
        self.num_left = len(jobs)
        self._run_dir = run_dir
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
        """Open from the first use on."""
        if self._store is None:
            self._store = RunStore(self._run_dir)
        return self._store

    def close(self) -> None:
        """Closes the store; safe to call twice."""
        if self._store is not None:
            self._store.close()
        self._store = None

    def progress(self, latest: EncodedStage | None) -> Progress:
        """How far it is."""
        return Progress(self._num_done, len(self._keys), latest)

    def add(self, stage: EncodedStage) -> bool:
        """Commit a stage, unless the same record is stored: a resumed episode runs its recorded stages again.

        An agent that is not deterministic may do otherwise than recorded. Mixing two rollouts in one episode would join
        what never happened, so the newer rollout then replaces the older from that stage on.
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
            case: EpisodeSpec = self.setup.backend.tasks.create(task.path)
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
    """Of its run."""
    job: EpisodeJob
    stage: int = 1
    """That this attempt is at."""
    num_tried: Counter[int] = field(default_factory=Counter)
    """Attempts that failed, by the stage that they were at."""


def run_all(
    runs: Sequence[Run], pool: Pool, num_retries: int, on_done: Callable[[int], None]
) -> Iterator[tuple[int, EncodedStage]]:
    """Has all jobs of runs done and records what comes of them.

    Args:
        runs: Where to.
        pool: Who does it.
        num_retries: Of a stage whose worker was lost.
        on_done: Called with the index of a run of which nothing is left.

    Yields:
        Index of the run, and a stage that was committed.
    """
    waiting = deque(_Episode(index, job) for index, run in enumerate(runs) for job in run.jobs)
    under_way: dict[int, _Episode] = {}
    numbers = count()
    while waiting or under_way:
        while waiting and len(under_way) < pool.capacity:
            episode, number = waiting.popleft(), next(numbers)
            under_way[number] = episode
            run = runs[episode.index]
            pool.submit(Job(number, episode.job.text(run.setup_text), run.limit_s))
        answer = pool.next_answer()
        episode = under_way[answer.key]
        run = runs[episode.index]
        if answer.is_end:
            del under_way[answer.key]
        news = _news_of(answer, run)
        if isinstance(news, EncodedStage):
            episode.stage = news.stage + 1
            if run.add(news):
                yield episode.index, news
        elif news is not None:
            failure = replace(news, stage=news.stage or episode.stage)
            if not answer.is_end:  # the worker tries again itself
                _note_retry(run, episode, failure)
            elif failure.kind in RETRIED and episode.num_tried[failure.stage] < num_retries:
                episode.num_tried[failure.stage] += 1
                _note_retry(run, episode, failure)
                waiting.appendleft(episode)
                continue
            else:
                for stage in run.left_behind(episode.job, failure):
                    if run.add(stage):
                        yield episode.index, stage
        if answer.is_end:
            run.num_left -= 1
            if run.num_left == 0:
                run.close()
                on_done(episode.index)


def _note_retry(run: Run, episode: _Episode, failure: StageFailure) -> None:
    run.store.add_retry(episode.job.agent, episode.job.task_id, failure)
    episode.stage = 1


def _news_of(answer: Answer, run: Run) -> EncodedStage | StageFailure | None:
    if answer.failure == "crash":
        return StageFailure(0, ErrorKind.CRASH, answer.detail)
    if answer.failure == "timeout":
        what = "stage" if run.setup.hosting.is_in_process else "round"
        return StageFailure(0, ErrorKind.TIMEOUT, f"no {what} ended within {run.limit_s:g} s")
    if answer.failure == "error":
        message = answer.detail.strip().rpartition("\n")[2]
        return StageFailure(0, ErrorKind.HARNESS, message, answer.detail)
    return decode_event(answer.text)
