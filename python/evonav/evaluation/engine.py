"""A run: agents x tasks into one folder, resumable, with any number of workers."""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from evonav._core import __version__
from evonav.errors import InvalidArgumentError, TaskError
from evonav.evaluation.agent_process import IS_SUPPORTED, LOG_NAME, AgentHosting
from evonav.evaluation.backend import Backend, check_agent_name
from evonav.evaluation.metrics import AgentSummary, paired_differences, summarise, summary_json
from evonav.evaluation.protocol import (
    EpisodeCase,
    ProtocolConfig,
    StageOutcome,
    as_errored,
    as_not_run,
    unknown_case,
)
from evonav.evaluation.records import EndState, ErrorKind, StageRecord
from evonav.evaluation.store import RunStore
from evonav.evaluation.workers import EpisodeJob, JobEvent, run_here, run_in_workers
from evonav.folders import check_same_run, write_atomically, writing
from evonav.parallel import EngineName
from evonav.tasks.files import task_roots

SUMMARY_NAME = "summary.json"
NUM_RETRIES = 2
"""Of a stage that lost its worker, its simulator or its agent's process."""


@dataclass(frozen=True, slots=True)
class RunConfig:
    """What decides the records of a run, beside agents and tasks."""

    seed: int = 0
    protocol: ProtocolConfig = field(default_factory=ProtocolConfig)
    backend: Backend = field(default_factory=Backend)
    stage_timeout_s: float = 900.0
    """After which a stage is errored (of an agent in a process of its own, a round); like all that follows, not part of
    what makes runs the same."""
    hosting: AgentHosting = field(default_factory=AgentHosting)
    """Where agents run; with `num_workers=0`, always in this process."""


@dataclass(frozen=True, slots=True)
class TaskFile:
    """A task of a run."""

    task_id: str
    path: Path
    num_stages: int
    digest: str
    """Of `task.json`, which holds the checksums of all other files."""


@dataclass(frozen=True, slots=True)
class RunRequest:
    """Agents x tasks into one folder: a run, or a cell of a sweep."""

    agents: tuple[str, ...]
    tasks: tuple[TaskFile, ...]
    run_dir: Path
    config: RunConfig = field(default_factory=RunConfig)


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a run is."""

    num_done: int
    """Recorded stages, those of earlier calls included."""
    num_stages: int
    latest: StageRecord | None


def task_files(directory: Path, limit: int | None = None) -> list[TaskFile]:
    """The tasks of a directory, by task id; contents are checked when they are run.

    Raises:
        TaskError: There is no task, or a header is malformed.
    """
    return [task_file(root) for root in task_roots(directory)[:limit]]


def task_file(root: Path) -> TaskFile:
    """A task by its folder.

    Raises:
        TaskError: The header is malformed.
    """
    path = root / "task.json"
    try:
        data = path.read_bytes()
        header = json.loads(data)
        num_stages = int(header["num_stages"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise TaskError(f"{path}: no task header ({type(error).__name__}: {error})") from error
    return TaskFile(root.name, root, num_stages, hashlib.sha256(data).hexdigest())


def evaluate(
    agents: Sequence[str],
    tasks: Sequence[TaskFile],
    run_dir: Path,
    *,
    config: RunConfig | None = None,
    engine: EngineName = "local",
    num_workers: int = 1,
    ray_address: str | None = None,
    num_retries: int = NUM_RETRIES,
    retry_errored: bool = False,
    on_progress: Callable[[Progress], None] = lambda _: None,
) -> list[AgentSummary]:
    """Evaluates agents on tasks; called again on the same folder, does what is left.

    Args:
        agents: Names, see `evonav agents`.
        tasks: See `task_files`.
        run_dir: Holds `records.sqlite` and `summary.json`.
        config: Must be the run's own when the folder already holds one.
        engine: As for `evaluate_all`, like all that follows.
        num_workers: 0 runs everything in this process.
        ray_address: Of a cluster.
        num_retries: A stage.
        retry_errored: Run errored stages again, and those that were not run because of them.
        on_progress: Called after every recorded stage.

    Returns:
        One summary an agent asked for.

    Raises:
        InvalidArgumentError: An agent is unknown, or asked for twice.
        StoreError: The folder holds a run of another configuration or cannot be written.
        TaskError: A task is malformed.
    """
    request = RunRequest(tuple(agents), tuple(tasks), run_dir, config or RunConfig())
    (summaries,) = evaluate_all(
        [request],
        engine=engine,
        num_workers=num_workers,
        ray_address=ray_address,
        num_retries=num_retries,
        retry_errored=retry_errored,
        on_progress=lambda _, news: on_progress(news),
    )
    return summaries


def evaluate_all(
    requests: Sequence[RunRequest],
    *,
    engine: EngineName = "local",
    num_workers: int = 1,
    ray_address: str | None = None,
    num_retries: int = NUM_RETRIES,
    retry_errored: bool = False,
    on_progress: Callable[[int, Progress], None] = lambda _, __: None,
) -> list[list[AgentSummary]]:
    """Does what is left of several runs, with one set of workers for all.

    Args:
        requests: Runs, each in a folder of its own.
        engine: Processes of this machine, or Ray actors.
        num_workers: Processes or actors; 0 runs everything in this process.
        ray_address: Of a cluster; default: one on this machine.
        num_retries: How often a stage is tried again that lost its worker, its simulator or its agent's process.
        retry_errored: Run errored stages again, and those that were not run because of them.
        on_progress: Called with the index of a request as it begins and after each of its recorded stages.

    Returns:
        By request, one summary an agent asked for.

    Raises:
        InvalidArgumentError: An agent is unknown or asked for twice, or two requests have one folder.
        StoreError: A folder holds a run of another configuration or cannot be written.
        TaskError: A task is malformed.
    """
    folders = [request.run_dir.absolute() for request in requests]
    if len(set(folders)) != len(folders):
        raise InvalidArgumentError("two runs are asked for in one folder")
    hostings = [_hosting(request, num_workers) for request in requests]
    for request, hosting in zip(requests, hostings, strict=True):
        _check_request(request.agents, request.tasks, num_workers, hosting)
    for index, request in enumerate(requests):
        agents, tasks, run_dir, config = request.agents, request.tasks, request.run_dir, request.config
        with writing(run_dir), RunStore(run_dir, create=True) as store:
            _claim(store, run_dir, tasks, config)
            store.set_meta("agents", sorted({*(store.meta("agents") or []), *agents}))
            store.set_meta("tasks_dir", str(tasks[0].path.absolute().parent))  # for `evonav view`
            run = _Run(store, agents, tasks, config)
            if retry_errored:
                run.forget_errored()
            jobs = run.jobs()
            on_progress(index, run.progress(None))
            if num_workers == 0:
                events = run_here(jobs, config.backend, config.protocol)
            else:
                events = run_in_workers(
                    jobs,
                    config.backend,
                    config.protocol,
                    hostings[index],
                    num_workers=num_workers,
                    stage_timeout_s=config.stage_timeout_s,
                )
            for record in run.record_all(events):
                on_progress(index, run.progress(record))
    return [write_summary(request.run_dir, only=request.agents) for request in requests]


def _hosting(request: RunRequest, num_workers: int) -> AgentHosting:
    hosting = request.config.hosting
    return replace(
        hosting,
        is_in_process=hosting.is_in_process or num_workers == 0 or not IS_SUPPORTED,
        log=hosting.log or str(request.run_dir.absolute() / LOG_NAME),
    )


def write_summary(run_dir: Path, only: Sequence[str] | None = None) -> list[AgentSummary]:
    """Computes every agent's measures from the records, and writes `summary.json`.

    Args:
        run_dir: A run.
        only: Agents to return, in this order; default all.

    Raises:
        StoreError: There is no run, or it cannot be read or written.
    """
    with RunStore(run_dir) as store:
        agents: list[str] = store.meta("agents") or []
        num_stages = sum(store.meta("num_stages").values())
        records = {agent: list(store.records(agent, is_brief=True)) for agent in agents}
    summaries = {agent: summarise(agent, records[agent], num_stages) for agent in agents}
    content = summary_json(list(summaries.values()), paired_differences(records))
    write_atomically(run_dir / SUMMARY_NAME, json.dumps(content, indent=2, sort_keys=True) + "\n")
    return [summaries[agent] for agent in only or agents]


class _Run:
    """The bookkeeping of one call."""

    def __init__(self, store: RunStore, agents: Sequence[str], tasks: Sequence[TaskFile], config: RunConfig) -> None:
        self._store = store
        self._agents = agents
        self._tasks = {task.task_id: task for task in tasks}
        self._config = config
        self._states = store.states()
        self._num_stages = len(agents) * sum(task.num_stages for task in tasks)

    def jobs(self) -> list[EpisodeJob]:
        """Episodes with a stage that has no record, task by task."""
        return [
            EpisodeJob(agent, task.task_id, str(task.path), agent_seed(self._config.seed, agent, task.task_id))
            for task in self._tasks.values()
            for agent in self._agents
            if any((agent, task.task_id, stage) not in self._states for stage in range(1, task.num_stages + 1))
        ]

    def forget_errored(self) -> None:
        """Drops episodes' stages from the first errored one on."""
        for task in self._tasks.values():
            for agent in self._agents:
                stages = range(1, task.num_stages + 1)
                first = next(
                    (k for k in stages if self._states.get((agent, task.task_id, k)) is EndState.ERRORED), None
                )
                if first is not None:
                    self._store.forget_episode(agent, task.task_id, first)
        self._states = self._store.states()

    def progress(self, latest: StageRecord | None) -> Progress:
        num_done = sum(agent in self._agents and task_id in self._tasks for agent, task_id, _ in self._states)
        return Progress(num_done, self._num_stages, latest)

    def record_all(self, events: Iterator[JobEvent]) -> Iterator[StageRecord]:
        """Records every outcome. Stages that a job leaves behind are errored or not run, never missing."""
        for event in events:
            if event.outcome is not None:
                record, plan = event.outcome.record, event.outcome.stage_map
                if plan is not None:
                    self._store.add_map(plan)
                if self._add(event.outcome):
                    yield record
            elif event.failure is not None:
                for record in self._left_behind(event.job, *event.failure):
                    if self._add(StageOutcome(record, None, 0.0, 0.0)):
                        yield record

    def _add(self, outcome: StageOutcome) -> bool:
        """Commits a record, unless the same was there: a resumed episode runs its recorded stages again.

        An agent that is not deterministic may do otherwise than recorded. Mixing two rollouts in one episode would join
        what never happened, so the newer rollout then replaces the older from that stage on.
        """
        record = outcome.record
        key = (record.agent, record.task_id, record.stage)
        if key in self._states:
            if self._store.record_text(*key) == record.model_dump_json():
                return False
            self._store.forget_episode(*key)
            self._states = self._store.states()
        self._store.add_stage(
            record,
            wall_s=outcome.wall_s,
            cpu_s=outcome.cpu_s,
            num_simulator_restarts=outcome.num_simulator_restarts,
        )
        self._states[key] = record.state
        return True

    def _left_behind(self, job: EpisodeJob, kind: ErrorKind, message: str) -> Iterator[StageRecord]:
        """Records of the stages of a job that ended early: the first errored, the rest not run."""
        task = self._tasks[job.task_id]
        try:
            case: EpisodeCase = self._config.backend.load_case(task.path)
        except Exception as error:  # whatever a broken file does to whatever reads it
            kind, message = ErrorKind.HARNESS, f"the task cannot be read: {type(error).__name__}: {error}"
            case = unknown_case(task.task_id, task.num_stages)
        failed: StageRecord | None = None
        for stage in range(1, task.num_stages + 1):
            if (job.agent, job.task_id, stage) in self._states:
                continue
            blank = case.blank_record(job.agent, stage)
            if failed is None or failed.error is None:
                failed = as_errored(blank, kind, message)
                yield failed
            else:
                yield as_not_run(blank, failed.error, failed.stage)


def agent_seed(seed: int, agent: str, task_id: str) -> int:
    """The seed of an agent's random choices: a function of names, not of order or workers."""
    digest = hashlib.sha256(f"{seed}\0{agent}\0{task_id}".encode()).digest()
    return int.from_bytes(digest[:6], "big")


def _check_request(agents: Sequence[str], tasks: Sequence[TaskFile], num_workers: int, hosting: AgentHosting) -> None:
    if not agents:
        raise InvalidArgumentError("no agent to evaluate")
    if len(set(agents)) != len(agents):
        raise InvalidArgumentError(f"an agent is named twice: {', '.join(agents)}")
    if not tasks:
        raise InvalidArgumentError("no task to evaluate on")
    if num_workers < 0:
        raise InvalidArgumentError(f"num_workers = {num_workers}: must be >= 0")
    for agent in agents:
        check_agent_name(agent, is_in_process=hosting.is_in_process)


def run_identity(tasks: Sequence[TaskFile], config: RunConfig) -> dict[str, Any]:
    """What makes runs the same: a folder holds one run, of any number of agents."""
    return {
        "evonav": __version__,
        "seed": config.seed,
        "protocol": asdict(config.protocol),
        "backend": config.backend.identity(),
        "tasks": hashlib.sha256("".join(f"{t.task_id} {t.digest}\n" for t in tasks).encode()).hexdigest(),
        "num_tasks": len(tasks),
    }


def _claim(store: RunStore, run_dir: Path, tasks: Sequence[TaskFile], config: RunConfig) -> None:
    """Makes the folder this run's, or checks that it is."""
    asked = run_identity(tasks, config)
    there = store.meta("config")
    if there is None:
        store.set_meta("config", asked)
        store.set_meta("num_stages", {task.task_id: task.num_stages for task in tasks})
    else:
        check_same_run(there, asked, run_dir)
    store.set_meta("task_digests", {task.task_id: task.digest for task in tasks})  # for `evonav pack`
