"""Run episodes in a worker of `evonav.parallel.pool`: one episode per job, with an event for each stage.

Agents run in processes of their own (`evonav.evaluation.hosting`), unless they are oracle baselines or this is switched
off. A worker that dies or hangs costs its episode, not the run.

A stage that was lost to the machine is retried: its episode runs from the beginning, with a fresh agent and the same
seed. This brings a deterministic agent to the state in which it began the stage, which no snapshot would do for every
agent; for another agent, the newer rollout replaces the older. The worker retries after a lost simulator, a lost agent
process or a failure of the harness; `evonav.evaluation.run.evaluate` retries after a lost worker.

A worker may run several episodes at once, each on a thread. One of them computes at a time; the others wait for their
agents, which are in processes of their own and wait for a model most of the time. So nothing here, nor a simulator, a
perception or a reader of tasks, has to expect two threads at once.
"""

import json
import math
import threading
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager, nullcontext
from dataclasses import asdict, dataclass, replace
from inspect import GEN_CLOSED, getgeneratorstate
from pathlib import Path
from weakref import WeakValueDictionary

from pydantic import TypeAdapter

from evonav.agents.agent import Agent
from evonav.agents.hosting import error_text
from evonav.errors import HouseError
from evonav.evaluation.baselines import ORACLE_BASELINE_NAMES
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.observer import EpisodeObserver
from evonav.evaluation.episode.outcome import StageOutcome
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.hosting.agent import HostedAgent, LocalAgent, RemoteAgent, post_mortem
from evonav.evaluation.hosting.isolation import NO_SETUP, AgentHosting, ProcessSetup
from evonav.evaluation.hosting.processes import AgentProcesses
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.encoded import EncodedStage, encode_stage
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import ErrorKind, RoundRecord, StageFailure
from evonav.evaluation.run.components import Backend, make_agent
from evonav.parallel.local import EndedError
from evonav.world.simulator import Simulator

RETRIED = (ErrorKind.HARNESS, ErrorKind.SIMULATOR_LOST, ErrorKind.CRASH, ErrorKind.TIMEOUT)
"""Failures that a retry may avoid; an exception of an agent or simulator would be the same again."""
MAX_CONTEXTS = 2
"""Largest number of contexts of a worker; the least recently used one is closed, unless an episode uses it."""
END_TIMEOUT_S = 1.0
"""Time that a worker which ends gives the episode that computes."""


@dataclass(frozen=True, slots=True)
class WorkerSetup:
    """The things that episodes of a run need besides the task and the agent."""

    backend: Backend
    protocol: ProtocolConfig
    hosting: AgentHosting
    processes: ProcessSetup = NO_SETUP
    """Setup of agents' processes, if they have some."""
    num_retries: int = 0
    """Number of retries of a stage."""


@dataclass(frozen=True, slots=True)
class EpisodeJob:
    """One agent, one task."""

    agent: str
    task_id: str
    opaque_id: str
    """The task's name for the agent."""
    path: str
    """Folder of the task."""
    seed: int
    """The agent's."""
    perception_seed: int
    """The perception's."""
    sends_floor_plans: bool = False
    """Send the floor plans of the task's stages: one episode of a task does, for all agents."""

    def text(self, run: int) -> str:
        """Return the text of the job for a worker; `run` numbers its run among the setups that the worker has."""
        return f"{run}\n{json.dumps(asdict(self))}"


SETUPS = TypeAdapter(tuple[WorkerSetup, ...])
"""Writes and reads the setups of runs as JSON."""
EVENT: TypeAdapter[EncodedStage | StageFailure | None] = TypeAdapter(EncodedStage | StageFailure | None)
"""Writes and reads an event of a job as JSON: a finished stage, a failure, or `None` at an end without either."""


def worker_settings(jobs_at_once: int, setups: Sequence[WorkerSetup]) -> str:
    """Return the text with which a worker makes its `EpisodeWork`."""
    return f"{jobs_at_once}\n{SETUPS.dump_json(tuple(setups)).decode()}"


class Turns:
    """Lets one of several threads compute at a time."""

    def __init__(self) -> None:
        """Let the first thread begin."""
        self._lock = threading.Lock()

    @contextmanager
    def turn(self) -> Iterator[None]:
        """Wait for a turn, and compute."""
        with self._lock:
            yield

    @contextmanager
    def waiting(self) -> Iterator[None]:
        """Let others compute while the block waits for something."""
        self._lock.release()
        try:
            yield
        finally:
            self._lock.acquire()

    def end(self, timeout_s: float) -> None:
        """Let nobody begin another turn, and give the current one some time to end."""
        self._lock.acquire(timeout=timeout_s)


class WorkerContext:
    """Runs episodes of one run, and keeps simulators and agents' processes, which are slow to start."""

    def __init__(
        self,
        setup: WorkerSetup,
        alive: Callable[[], None],
        waiting: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        """Store the setup; simulators start with the first episodes.

        Args:
            alive: Shows that an episode continues.
            waiting: Lets other episodes compute while the block waits for an agent.
        """
        hosting = setup.hosting
        self.setup = setup
        self.num_users = 0
        """Number of episodes that use it."""
        # An agent in this process has one time limit for a whole stage.
        self._on_round = (lambda: None) if hosting.is_in_process else alive
        # What an agent's own process and its model use is added; other threads are other episodes.
        self._own_cpu_s = time.process_time if hosting.is_in_process else time.thread_time
        self._idle: list[Simulator] = []
        self._busy: list[Simulator] = []
        self._tasks: WeakValueDictionary[str, EpisodeSpec] = WeakValueDictionary()
        self._last_task: EpisodeSpec | None = None
        """The task that was asked for last: the next episode is often another agent's in it."""
        self._processes = None if hosting.is_in_process else AgentProcesses(hosting, setup.processes, waiting)

    def task(self, path: str) -> EpisodeSpec:
        """Return the task in a folder. It is read for each agent in this process alone, which could change arrays."""
        if (found := self._tasks.get(path)) is None:
            found = self.setup.backend.tasks.create(Path(path))
            if not self.setup.hosting.is_in_process:
                self._tasks[path] = self._last_task = found
        return found

    @contextmanager
    def attempt(self, spec: EpisodeSpec, job: EpisodeJob) -> Iterator[Iterator[StageOutcome]]:
        """Run an episode from its beginning, with a fresh agent; if it does not end, its simulator is closed."""
        perception = self.setup.backend.perception.create()
        simulator = self._idle.pop() if self._idle else self.setup.backend.simulator.create()
        self._busy.append(simulator)
        is_whole = False
        try:
            agent = self._agent(job)
            with closing(agent) if isinstance(agent, RemoteAgent) else nullcontext():
                episode = Episode(
                    spec,
                    job.agent,
                    agent,
                    simulator,
                    perception,
                    self.setup.protocol,
                    job.seed,
                    _Heartbeat(self._on_round),
                    perception_seed=job.perception_seed,
                    own_cpu_s=self._own_cpu_s,
                )
                with closing(episode.run()) as outcomes:
                    yield outcomes
                    is_whole = getgeneratorstate(outcomes) == GEN_CLOSED
        finally:
            self._busy.remove(simulator)
            if is_whole:
                self._idle.append(simulator)
            else:
                simulator.close()

    def _agent(self, job: EpisodeJob) -> Agent | HostedAgent:
        """Make a fresh agent."""
        decision, is_baseline = self.setup.backend.decision, job.agent in ORACLE_BASELINE_NAMES
        if self._processes is not None and not is_baseline:
            return RemoteAgent(self._processes, job.agent, decision, job.seed, job.task_id)

        def make() -> Agent:
            return make_agent(job.agent, decision.create(job.seed))

        try:
            if is_baseline or self.setup.hosting.isolation != "debugger":
                return make()
            return LocalAgent(post_mortem()(make)(), post_mortem())
        except (KeyboardInterrupt, EndedError):
            raise
        except BaseException as error:
            return LocalAgent(error)

    def close(self) -> None:
        """Close the simulators and end the agents' processes; safe to call twice."""
        for simulator in (*self._idle, *self._busy):
            simulator.close()
        self._idle.clear()
        if self._processes is not None:
            self._processes.close()


class _Heartbeat(EpisodeObserver):
    """Reports after every round that the episode continues."""

    def __init__(self, on_round: Callable[[], None]) -> None:
        self._on_round = on_round

    def stage_begins(self, stage: int, simulator: Simulator) -> None:
        self._on_round()

    def round_ends(self, record: RoundRecord) -> None:
        self._on_round()


class EpisodeWork:
    """The work of `evonav.parallel.pool`. Cells of a sweep share a worker: each run has a context."""

    def __init__(self, settings: str, alive: Callable[[], None]) -> None:
        self._alive = alive
        jobs_at_once, _, setups = settings.partition("\n")
        self._setups = SETUPS.validate_json(setups)
        self._contexts: dict[int, WorkerContext] = {}
        """Contexts by the number of their runs; the one that was used last comes last."""
        # A single episode runs on the main thread, where a signal may come at any moment: it takes no turns.
        self._turns = Turns() if int(jobs_at_once) > 1 else None

    def __call__(self, text: str) -> Generator[str, None, str]:
        """Run the episode of `EpisodeJob.text`; yield and return events, as `EVENT` writes them.

        After a failure that costs only the attempt, the failure is an event, and the stages from stage 1 on come again.
        """
        run, _, job_text = text.partition("\n")
        with self._used(int(run)) as context:
            job, num_failed = EpisodeJob(**json.loads(job_text)), Counter[int]()
            try:
                task = context.task(job.path)
                spec = replace(task, opaque_id=job.opaque_id)
                is_whole = False
                while not is_whole:
                    is_whole = True
                    with context.attempt(spec, job) as outcomes:
                        for outcome in outcomes:
                            failure = outcome.failure
                            if failure is not None and _num_tried(failure, num_failed) <= context.setup.num_retries:
                                yield _text(failure)
                                is_whole = False
                                break
                            yield _text(_encoded(outcome, spec, sends_floor_plan=job.sends_floor_plans))
            except Exception as error:
                message = f"{type(error).__name__}: {error}"
                return _text(StageFailure(0, ErrorKind.HARNESS, message, error_text.traceback_of(error)))
            return _text(None)

    @contextmanager
    def _used(self, run: int) -> Iterator[WorkerContext]:
        """Take a turn, and keep the context of a run open meanwhile."""
        with nullcontext() if self._turns is None else self._turns.turn():
            context = self._context(run)
            context.num_users += 1
            try:
                yield context
            finally:
                context.num_users -= 1

    def _context(self, run: int) -> WorkerContext:
        found = self._contexts.pop(run, None)
        unused = [key for key, context in self._contexts.items() if context.num_users == 0]
        while found is None and unused and len(self._contexts) >= MAX_CONTEXTS:
            self._contexts.pop(unused.pop(0)).close()
        if found is None:
            waiting = nullcontext if self._turns is None else self._turns.waiting
            found = WorkerContext(self._setups[run], self._alive, waiting)
        self._contexts[run] = found
        return found

    def close(self) -> None:
        """Close all contexts, also those of episodes on threads that have not ended."""
        if self._turns is not None:
            self._turns.end(END_TIMEOUT_S)
        for context in self._contexts.values():
            context.close()
        self._contexts.clear()


def _num_tried(failure: StageFailure, num_failed: Counter[int]) -> float:
    """Count a failure, and return how many there were; infinity for one that a retry cannot avoid."""
    # The limit for failures of the agent's own process is per episode and not per stage: retries take time.
    stage = 0 if failure.kind.is_agents else failure.stage
    num_failed[stage] += 1
    return num_failed[stage] if failure.kind in RETRIED else math.inf


def _text(event: EncodedStage | StageFailure | None) -> str:
    return EVENT.dump_json(event).decode()


def _encoded(outcome: StageOutcome, spec: EpisodeSpec, *, sends_floor_plan: bool) -> EncodedStage:
    return encode_stage(
        outcome.record,
        wall_s=outcome.wall_s,
        cpu_s=outcome.cpu_s,
        costs=outcome.costs,
        traceback=outcome.traceback,
        floor_plan=floor_plan_if_possible(spec, outcome.record.stage) if sends_floor_plan else None,
    )


def floor_plan_if_possible(spec: EpisodeSpec, stage: int) -> FloorPlan | None:
    """Return the floor plan of a stage; `None` for a house of which none can be drawn."""
    try:
        return spec.floor_plan(stage)
    except HouseError:
        return None
