"""One run: its configuration, its folder, and the episodes that are left in it."""

import hashlib
import secrets
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from evonav._core import __version__
from evonav.errors import InvalidArgumentError
from evonav.evaluation.episode.outcome import as_errored, as_not_run
from evonav.evaluation.episode.spec import opaque_task_id, unreadable_task_spec
from evonav.evaluation.hosting.isolation import IS_SUPPORTED, AgentHosting, ProcessSetup, isolation_facts
from evonav.evaluation.hosting.model_relay import is_relayed
from evonav.evaluation.hosting.process import LOG_NAME
from evonav.evaluation.metrics.navigation import AgentSummary
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.encoded import EncodedStage, encode_stage
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import EndState, ErrorKind, StageFailure, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import Backend, check_agent_names, check_sandbox
from evonav.evaluation.run.summary import MODELS_KEY, note_session, write_summary
from evonav.evaluation.run.worker import EpisodeJob, WorkerSetup, floor_plan_if_possible
from evonav.parallel.folders import check_same_run
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
class Progress:
    """The progress of a run."""

    num_done: int
    """Recorded stages, those of earlier calls included."""
    num_stages: int
    latest: EncodedStage | None
    """The stage that was recorded last; `None` at the beginning."""

    @property
    def label(self) -> str:
        """Name of the latest stage; empty at the beginning."""
        return "" if self.latest is None else self.latest.label


@dataclass(eq=False)
class Evaluation:
    """A run, or a cell of a sweep: agents on tasks, into one folder. A folder holds one, of any number of agents."""

    agents: tuple[str, ...]
    tasks: tuple[TaskFile, ...]
    run_dir: Path
    config: RunConfig = field(default_factory=RunConfig)
    jobs: list[EpisodeJob] = field(init=False, default_factory=list)
    """Episodes with a stage that has no record, from `begin` on."""
    setup: WorkerSetup = field(init=False)
    """The part of it that workers are given, from `begin` on."""
    summaries: list[AgentSummary] | None = field(init=False, default=None)
    """A summary of each agent, once all jobs have ended."""
    _states: dict[tuple[str, str, int], EndState] = field(init=False, default_factory=dict)
    """End state of every recorded stage, by agent, task and stage."""
    _keys: set[tuple[str, str, int]] = field(init=False, default_factory=set)
    """Agent, task and stage of every record that the run will have."""
    _num_done: int = field(init=False, default=0)
    _num_left: int = field(init=False, default=0)
    """Number of jobs that have not ended."""
    _store: RunStore | None = field(init=False, default=None)

    @property
    def identity(self) -> dict[str, Any]:
        """Identity that a folder must have for a run to be resumed in it."""
        return {
            "evonav": __version__,
            "seed": self.config.seed,
            "protocol": asdict(self.config.protocol),
            "backend": self.config.backend.identity(),
            "tasks": hashlib.sha256("".join(f"{t.task_id} {t.digest}\n" for t in self.tasks).encode()).hexdigest(),
            "num_tasks": len(self.tasks),
        }

    @property
    def limit_s(self) -> float:
        """Longest silence of an episode, from `begin` on: of a round, or of a stage if agents are in this process."""
        hosting = self.setup.hosting
        # An agent in a process of its own has another limit for each answer; the rest of a round has stage_timeout_s.
        return self.config.stage_timeout_s + (0.0 if hosting.is_in_process else hosting.timeout_s)

    def worker_setup(self, workforce: Workforce, scratch: str | None, num_retries: int) -> WorkerSetup:
        """Return what workers are given of it. Without workers, agents are in this process.

        Args:
            scratch: Folder in which agents in sandboxes may write.
        """
        config, hosting, is_one_of_many = self.config, self.config.hosting, workforce.jobs_at_once > 1
        if not hosting.is_in_process and (workforce.num_workers == 0 or not IS_SUPPORTED):
            hosting = replace(hosting, isolation="none")
        hidden = (self.run_dir, *(task.path.parent for task in self.tasks))
        processes = ProcessSetup(
            log=str(self.run_dir.absolute() / LOG_NAME),
            hidden=tuple(sorted({str(path.absolute()) for path in hidden})),
            scratch=scratch,
            relays_model=(hosting.isolation == "sandbox" or is_one_of_many)  # else processes have the client's memory
            and is_relayed(config.backend.decision),
            is_one_of_many=is_one_of_many,
        )
        return WorkerSetup(config.backend, config.protocol, hosting, processes, num_retries)

    def check(self, workforce: Workforce, known: set[tuple[str, str]]) -> None:
        """Check what can be checked before a run begins.

        Args:
            known: Agents that need no check, with their isolation; those that are checked are added.

        Raises:
            InvalidArgumentError: An agent is unknown or named twice, or the options contradict each other.
        """
        if not self.agents:
            raise InvalidArgumentError("no agent to evaluate")
        if len(set(self.agents)) != len(self.agents):
            raise InvalidArgumentError(f"an agent is named twice: {', '.join(self.agents)}")
        if not self.tasks:
            raise InvalidArgumentError("no task to evaluate on")
        setup, backend = self.worker_setup(workforce, None, 0), self.config.backend
        isolation = setup.hosting.isolation
        if setup.hosting.is_in_process and workforce.jobs_at_once > 1:
            message = "several episodes at once need agents in processes of their own"
            raise InvalidArgumentError(f"episodes_at_once = {workforce.jobs_at_once}: {message}")
        if self.config.hosting.isolation == "sandbox":
            check_sandbox(backend.decision)
            if setup.hosting.is_in_process:
                reason = "agents run in the evaluator's own process: use one worker or more"
                raise InvalidArgumentError(f"isolation = sandbox: {reason}")
        parts = (backend.tasks, backend.simulator, backend.perception, backend.decision)
        for name in (*self.agents, *(part.path for part in parts)):
            if workforce.num_workers and name.startswith("__main__:"):
                raise InvalidArgumentError(
                    f"`{name}`: a worker cannot import the script that is running; move it to a module of its own, "
                    "or use num_workers=0"
                )
        names = [agent for agent in self.agents if (agent, isolation) not in known]
        check_agent_names(names, setup.hosting, replace(setup.processes, log=None))
        known.update((agent, isolation) for agent in names)

    def begin(self, workforce: Workforce, scratch: str | None, num_retries: int, *, retry_errored: bool) -> None:
        """Claim the folder, and list the jobs that are left; for the arguments, see `worker_setup`.

        Raises:
            StoreError: The folder holds a run of another identity, or cannot be written.
            PerceptionError: Models of the perception are missing.
        """
        self.setup, self.summaries = self.worker_setup(workforce, scratch, num_retries), None
        numbered = [(task.task_id, stage) for task in self.tasks for stage in range(1, task.num_stages + 1)]
        self._keys = {(agent, *one) for agent in self.agents for one in numbered}
        with RunStore(self.run_dir, create=True) as store:
            self._claim(store)
            if retry_errored:
                self._forget_errored(store)
            self._states = store.states()
            self.jobs = self._jobs_left(store.meta(NAMES_KEY), store.floor_plan_keys())
            if self.jobs:
                self._claim_models(store)
                note_session(store, workforce.num_workers, isolation_facts(self.setup.hosting))
        self._num_left, self._num_done = len(self.jobs), len(self._keys & self._states.keys())

    def _claim(self, store: RunStore) -> None:
        """Make the folder this run's, or check that it is."""
        stored, wanted = store.meta("config"), self.identity
        if stored is not None:
            check_same_run(stored, wanted, self.run_dir)
        store.set_header(
            {
                "config": wanted,
                "num_stages": {task.task_id: task.num_stages for task in self.tasks},
                "agents": sorted({*(store.meta("agents") or []), *self.agents}),
                "tasks_dir": str(self.tasks[0].path.absolute().parent),  # for `evonav view`
                "models_dir": self.config.backend.perception.host_options.get("models"),  # likewise
                "task_digests": {task.task_id: task.digest for task in self.tasks},  # for `evonav pack`
                NAMES_KEY: store.meta(NAMES_KEY) or secrets.token_hex(32),  # for agents' names of tasks; never printed
            }
        )

    def _claim_models(self, store: RunStore) -> None:
        """Store the models of the perception before they are used, or check that they are the stored ones."""
        found = self.config.backend.check_perception(self.agents)
        stored = store.meta(MODELS_KEY) or {}
        both = found.keys() & stored.keys()
        check_same_run({key: stored[key] for key in both}, {key: found[key] for key in both}, self.run_dir)
        if found.keys() - stored.keys():
            store.set_meta(MODELS_KEY, {**stored, **found})

    def _forget_errored(self, store: RunStore) -> None:
        """Delete the stages of this run's episodes from the first errored one on."""
        for key, state in store.states().items():
            if state is EndState.ERRORED and key in self._keys:
                store.forget_episode(*key)

    def _jobs_left(self, secret: str, floor_plans: set[tuple[str, int]]) -> list[EpisodeJob]:
        """Return a job for each episode with a stage that has no record."""
        jobs, seed = [], self.config.seed
        names = {task.task_id: opaque_task_id(secret, task.task_id) for task in self.tasks}
        # An agent's process may count its episodes: in the order of the tasks' ids, the number would tell the task.
        for task in sorted(self.tasks, key=lambda task: names[task.task_id]):
            name, stages = task.task_id, range(1, task.num_stages + 1)
            agents = [one for one in self.agents if any((one, name, stage) not in self._states for stage in stages)]
            are_missing = any((name, stage) not in floor_plans for stage in stages)
            jobs += [
                EpisodeJob(
                    agent,
                    name,
                    names[name],
                    str(task.path.absolute()),
                    agent_seed(seed, agent, name),
                    perception_seed(seed, name),
                    sends_floor_plans=are_missing and number == 0,
                )
                for number, agent in enumerate(agents)
            ]
        return jobs

    @property
    def store(self) -> RunStore:
        """The run's store, opened at its first use."""
        if self._store is None:
            self._store = RunStore(self.run_dir)
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
        self.summaries = write_summary(self.run_dir, only=self.agents)
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
        """Yield the missing stages of a job that ended early, to `add`: the first is errored, the rest are not run."""
        task = next(task for task in self.tasks if task.task_id == job.task_id)
        plans: dict[int, FloorPlan | None] = {}
        try:
            spec = self.config.backend.tasks.create(task.path)
            if job.sends_floor_plans:
                plans = {stage: floor_plan_if_possible(spec, stage) for stage in range(1, task.num_stages + 1)}
        except Exception as error:  # whatever a broken file does to whatever reads it
            message = f"the task cannot be read: {type(error).__name__}: {error}"
            failure = replace(failure, kind=ErrorKind.HARNESS, message=message)
            spec = unreadable_task_spec(task.task_id, task.num_stages)
        failed: StageRecord | None = None
        for stage in range(1, task.num_stages + 1):
            if (job.agent, job.task_id, stage) in self._states:
                continue
            blank = spec.blank_record(job.agent, stage)
            if failed is None or failed.error is None:
                record = failed = as_errored(blank, failure.kind, failure.message)
            else:
                record = as_not_run(blank, failed.error, failed.stage)
            yield encode_stage(record, wall_s=0.0, cpu_s=0.0, traceback=failure.traceback, floor_plan=plans.get(stage))


def agent_seed(seed: int, agent: str, task_id: str) -> int:
    """Return the seed of an agent's random choices, which depends on names and not on order or workers."""
    digest = hashlib.sha256(f"{seed}\0{agent}\0{task_id}".encode()).digest()
    return int.from_bytes(digest[:6], "big")


def perception_seed(seed: int, task_id: str) -> int:
    """Return the seed of a perception's errors, which is the same for all agents."""
    return agent_seed(seed, "", task_id)
