"""Evaluate agents on tasks into one folder, with any number of workers; run again to resume."""

import hashlib
import secrets
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from evonav._core import __version__
from evonav.errors import InvalidArgumentError
from evonav.evaluation.episode.spec import opaque_task_id
from evonav.evaluation.hosting.isolation import IS_SUPPORTED, AgentHosting, ProcessSetup, isolation_facts
from evonav.evaluation.hosting.model_relay import is_relayed
from evonav.evaluation.hosting.process import LOG_NAME
from evonav.evaluation.hosting.scratch import agents_scratch
from evonav.evaluation.metrics.navigation import AgentSummary
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.schema import EndState
from evonav.evaluation.records.store import FILE_NAME, RunStore
from evonav.evaluation.run.components import Backend, check_agent_names, check_sandbox
from evonav.evaluation.run.decision_resources import fold_logs
from evonav.evaluation.run.program import PROGRAM
from evonav.evaluation.run.provenance import note_session
from evonav.evaluation.run.scheduler import Progress as Progress  # also for those who import it from here
from evonav.evaluation.run.scheduler import RunJobs, Schedule
from evonav.evaluation.run.settings_model import NUM_RETRIES
from evonav.evaluation.run.summary import MODELS_KEY
from evonav.evaluation.run.worker import EpisodeJob, WorkerConfig
from evonav.parallel.folders import check_same_run, writing
from evonav.parallel.pool import open_pool
from evonav.parallel.worker import Workforce
from evonav.tasks.listing import TaskFile

NAMES_KEY = "key_of_names"
"""Place in a run's header of the secret key of agents' names of tasks; nothing shows it."""


@dataclass(frozen=True, slots=True)
class RunConfig:
    """The configuration that decides a run's records, beside agents and tasks."""

    seed: int = 0
    protocol: ProtocolConfig = field(default_factory=ProtocolConfig)
    backend: Backend = field(default_factory=Backend)
    stage_timeout_s: float = 900.0
    """Seconds after which a stage is errored; for an agent in a process of its own, a round.

    This field and `hosting` are not part of a run's identity.
    """
    hosting: AgentHosting = field(default_factory=AgentHosting)
    """The process in which agents run; with `num_workers=0`, it is always this one."""


@dataclass(frozen=True, slots=True)
class RunRequest:
    """The agents, tasks and folder of a run, or of a cell of a sweep."""

    agents: tuple[str, ...]
    tasks: tuple[TaskFile, ...]
    run_dir: Path
    config: RunConfig = field(default_factory=RunConfig)


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
    request = RunRequest(tuple(agents), tuple(tasks), run_dir, config or RunConfig())
    (summaries,) = evaluate_all(
        [request],
        Workforce(num_workers, jobs_at_once=episodes_at_once),
        num_retries=num_retries,
        retry_errored=retry_errored,
        on_progress=lambda _, progress: on_progress(progress),
    )
    return summaries


def evaluate_all(
    requests: Sequence[RunRequest],
    workforce: Workforce,
    *,
    num_retries: int = NUM_RETRIES,
    retry_errored: bool = False,
    on_progress: Callable[[int, Progress], None] = lambda _, __: None,
) -> list[list[AgentSummary]]:
    """Run what is left of several runs, with one set of workers for all.

    Args:
        requests: Runs, each in a folder of its own.
        workforce: The workers that all runs share.
        num_retries: Number of retries of a stage that lost its worker, its simulator or its agent's process, or in
            which evonav itself failed. Every failure is recorded, see `RunStore.failures`.
        retry_errored: Run errored stages again, and those that were not run because of them.
        on_progress: Called with the index of a request as it begins and after each of its recorded stages.

    Returns:
        For each request, one summary for each agent.

    Raises:
        InvalidArgumentError: An agent is unknown or named twice, or two requests have the same folder.
        StoreError: A folder holds a run of another configuration or cannot be written.
        PerceptionError: Models of a perception are missing.
        EngineError: Workers do not start.
    """
    num_workers = workforce.num_workers
    _check_requests(requests, workforce)
    for request in requests:
        if not (request.run_dir / FILE_NAME).exists():  # a run that cannot begin leaves no folder behind
            request.config.backend.check_perception(request.agents)
    with ExitStack() as stack:
        has_sandbox = any(request.config.hosting.isolation == "sandbox" for request in requests)
        # Deleted at the end, also if a worker could not clean up.
        scratch = stack.enter_context(agents_scratch()) if has_sandbox else None
        runs: list[RunJobs] = []
        for index, request in enumerate(requests):
            stack.enter_context(writing(request.run_dir))
            runs.append(stack.enter_context(closing(_begin(request, workforce, scratch, num_retries, retry_errored))))
            on_progress(index, runs[-1].progress(None))
        if num_jobs := sum(len(run.jobs) for run in runs):
            schedule = Schedule(runs, num_retries)
            with open_pool(
                PROGRAM.work,
                str(workforce.jobs_at_once),
                replace(workforce, num_workers=min(num_workers, num_jobs)),
                timeout_s=max(run.limit_s for run in runs),
                max_losses=0,  # the schedule counts them
                prelude=PROGRAM.prelude,
            ) as pool:
                while schedule.fill(pool):
                    for index, stage in schedule.take(pool.next_answer()):
                        on_progress(index, runs[index].progress(stage))
            for request in requests:
                fold_logs(request.config.backend.decision)
        return [run.summaries or run.summarise() for run in runs]


def _begin(
    request: RunRequest, workforce: Workforce, scratch: str | None, num_retries: int, retry_errored: bool
) -> RunJobs:
    """Claim a run's folder and return the jobs that are left."""
    with RunStore(request.run_dir, create=True) as store:
        _claim(store, request)
        if retry_errored:
            _forget_errored(store, request)
        secret = store.meta(NAMES_KEY)
        states = store.states()
        floor_plans = store.floor_plan_keys()
    config = request.config
    hosting = _hosting(request, workforce)
    processes = _process_setup(request, workforce, scratch)
    worker_config = WorkerConfig(config.backend, config.protocol, hosting, processes, num_retries)
    # An agent in a process of its own has another limit for each answer; the rest of a round has stage_timeout_s.
    limit_s = config.stage_timeout_s + (0.0 if hosting.is_in_process else hosting.timeout_s)
    jobs = []
    names = {task.task_id: opaque_task_id(secret, task.task_id) for task in request.tasks}
    # An agent's process may count its episodes: in the order of the tasks' ids, the number would tell the task.
    for task in sorted(request.tasks, key=lambda task: names[task.task_id]):
        stages = range(1, task.num_stages + 1)
        agents = [name for name in request.agents if any((name, task.task_id, stage) not in states for stage in stages)]
        are_missing = any((task.task_id, stage) not in floor_plans for stage in stages)
        jobs += [
            EpisodeJob(
                agent,
                task.task_id,
                names[task.task_id],
                str(task.path.absolute()),
                agent_seed(config.seed, agent, task.task_id),
                perception_seed(config.seed, task.task_id),
                sends_floor_plans=are_missing and number == 0,
            )
            for number, agent in enumerate(agents)
        ]
    if jobs:
        with RunStore(request.run_dir) as store:
            _claim_models(store, request)
            note_session(store, workforce.num_workers, isolation_facts(hosting))
    return RunJobs(request.run_dir, worker_config, limit_s, request.agents, request.tasks, jobs, states)


def _forget_errored(store: RunStore, request: RunRequest) -> None:
    """Delete the stages of episodes from the first errored one on."""
    first: dict[tuple[str, str], int] = {}
    for (agent, task_id, stage), state in store.states().items():
        if state is EndState.ERRORED:
            first[agent, task_id] = min(stage, first.get((agent, task_id), stage))
    tasks = {task.task_id for task in request.tasks}
    for (agent, task_id), stage in first.items():
        if agent in request.agents and task_id in tasks:
            store.forget_episode(agent, task_id, stage)


def _hosting(request: RunRequest, workforce: Workforce) -> AgentHosting:
    """Return how agents are hosted with these workers: without any, in this process."""
    hosting = request.config.hosting
    has_processes = workforce.num_workers > 0 and IS_SUPPORTED
    return hosting if has_processes or hosting.is_in_process else replace(hosting, isolation="none")


def _process_setup(request: RunRequest, workforce: Workforce, scratch: str | None) -> ProcessSetup:
    is_one_of_many = workforce.jobs_at_once > 1
    is_sandboxed = request.config.hosting.isolation == "sandbox"
    return ProcessSetup(
        log=str(request.run_dir.absolute() / LOG_NAME),
        hidden=tuple(sorted({str(path.absolute()) for path in _hidden_from_agents(request)})),
        scratch=scratch,
        relays_model=(is_sandboxed or is_one_of_many)  # else each process has the client's memory
        and is_relayed(request.config.backend.decision),
        is_one_of_many=is_one_of_many,
    )


def _hidden_from_agents(request: RunRequest) -> Iterator[Path]:
    yield request.run_dir
    yield from (task.path.parent for task in request.tasks)


def agent_seed(seed: int, agent: str, task_id: str) -> int:
    """Return the seed of an agent's random choices, which depends on names and not on order or workers."""
    digest = hashlib.sha256(f"{seed}\0{agent}\0{task_id}".encode()).digest()
    return int.from_bytes(digest[:6], "big")


def perception_seed(seed: int, task_id: str) -> int:
    """Return the seed of a perception's errors, which is the same for all agents."""
    return agent_seed(seed, "", task_id)


def _check_requests(requests: Sequence[RunRequest], workforce: Workforce) -> None:
    if len({request.run_dir.absolute() for request in requests}) != len(requests):
        raise InvalidArgumentError("two runs have the same folder")
    checked: set[tuple[str, str]] = set()
    for request in requests:
        if not request.agents:
            raise InvalidArgumentError("no agent to evaluate")
        if len(set(request.agents)) != len(request.agents):
            raise InvalidArgumentError(f"an agent is named twice: {', '.join(request.agents)}")
        if not request.tasks:
            raise InvalidArgumentError("no task to evaluate on")
        hosting = _hosting(request, workforce)
        if hosting.is_in_process and workforce.jobs_at_once > 1:
            message = "several episodes at once need agents in processes of their own"
            raise InvalidArgumentError(f"episodes_at_once = {workforce.jobs_at_once}: {message}")
        if request.config.hosting.isolation == "sandbox":
            check_sandbox(request.config.backend.decision)
            if hosting.is_in_process:
                reason = "agents run in the evaluator's own process: use one worker or more"
                raise InvalidArgumentError(f"isolation = sandbox: {reason}")
        backend = request.config.backend
        parts = (backend.tasks, backend.simulator, backend.perception, backend.decision)
        for name in (*request.agents, *(part.path for part in parts)):
            if workforce.num_workers and name.startswith("__main__:"):
                raise InvalidArgumentError(
                    f"`{name}`: a worker cannot import the script that is running; move it to a module of its own, "
                    "or use num_workers=0"
                )
        new = [one for one in request.agents if (one, hosting.isolation) not in checked]
        check_agent_names(new, hosting, replace(_process_setup(request, workforce, None), log=None))
        checked.update((agent, hosting.isolation) for agent in request.agents)


def run_identity(tasks: Sequence[TaskFile], config: RunConfig) -> dict[str, Any]:
    """Return the identity of a run: a folder holds one run, of any number of agents."""
    return {
        "evonav": __version__,
        "seed": config.seed,
        "protocol": asdict(config.protocol),
        "backend": config.backend.identity(),
        "tasks": _digest_of(tasks),
        "num_tasks": len(tasks),
    }


def _digest_of(tasks: Sequence[TaskFile]) -> str:
    return hashlib.sha256("".join(f"{t.task_id} {t.digest}\n" for t in tasks).encode()).hexdigest()


def _claim_models(store: RunStore, request: RunRequest) -> None:
    """Store the models of the perception before they are used, or check that they are the stored ones."""
    found = request.config.backend.check_perception(request.agents)
    stored = store.meta(MODELS_KEY) or {}
    both = found.keys() & stored.keys()
    check_same_run({key: stored[key] for key in both}, {key: found[key] for key in both}, request.run_dir)
    if found.keys() - stored.keys():
        store.set_meta(MODELS_KEY, {**stored, **found})


def _claim(store: RunStore, request: RunRequest) -> None:
    """Make the folder this run's, or check that it is."""
    wanted = run_identity(request.tasks, request.config)
    stored = store.meta("config")
    if stored is not None:
        check_same_run(stored, wanted, request.run_dir)
    store.set_header(
        {
            "config": wanted,
            "num_stages": {task.task_id: task.num_stages for task in request.tasks},
            "agents": sorted({*(store.meta("agents") or []), *request.agents}),
            "tasks_dir": str(request.tasks[0].path.absolute().parent),  # for `evonav view`
            "models_dir": request.config.backend.perception.host_options.get("models"),  # likewise
            "task_digests": {task.task_id: task.digest for task in request.tasks},  # for `evonav pack`
            NAMES_KEY: store.meta(NAMES_KEY) or secrets.token_hex(32),  # for agents' names of tasks; never printed
        }
    )
