"""Run episodes in a worker of `evonav.parallel.pool`: one episode per job, with an event for each stage.

Agents run in processes of their own (`evonav.evaluation.hosting`), unless they are oracle baselines or this is switched
off. A worker that dies or hangs costs its episode, not the run.

A stage that was lost to the machine is retried: its episode runs from the beginning, with a fresh agent and the same
seed. This brings a deterministic agent to the state in which it began the stage, which no snapshot would do for every
agent; for another agent, the newer rollout replaces the older. The worker retries after a lost simulator, a lost agent
process or a failure of the harness; `evonav.evaluation.run.scheduler` retries after a lost worker.
"""

import json
from collections import defaultdict
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from pydantic import TypeAdapter

from evonav.agents.agent import Agent, SensorConfig
from evonav.agents.hosting import error_text
from evonav.errors import HouseError
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.observer import LOSSES
from evonav.evaluation.episode.oracle_baselines import ORACLE_BASELINES
from evonav.evaluation.episode.outcome import StageOutcome
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.hosting.agent import HostedAgent, LocalAgent, RemoteAgent
from evonav.evaluation.hosting.process import AgentHosting, AgentProcesses
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.encoded import EncodedStage, encode_stage
from evonav.evaluation.records.schema import ErrorKind, FloorPlan, RoundRecord, StageFailure
from evonav.evaluation.run.components import Backend, make_agent
from evonav.parallel.local import EndedError
from evonav.sensors.observation import Observation
from evonav.world.simulator import Simulator

WORK = "evonav.evaluation.run.worker:EpisodeWork"
RETRIED = (ErrorKind.HARNESS, ErrorKind.SIMULATOR_LOST, *LOSSES)
"""Failures that a retry may avoid; an exception of an agent or simulator would be the same again."""
MAX_CONTEXTS = 2
"""Largest number of contexts of a worker; the least recently used one is closed."""


@dataclass(frozen=True, slots=True)
class WorkerConfig:
    """The configuration that episodes need beside the task and the agent."""

    backend: Backend
    protocol: ProtocolConfig
    hosting: AgentHosting
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
    shift_m: Sequence[float] | None = None
    """`(x, z)` by which places are shifted for the agent; `None` tells true ones."""
    sends_floor_plans: bool = False
    """Send the floor plans of the task's stages: one episode of a task does, for all agents."""

    def text(self, config_text: str) -> str:
        """Return the text of the job for a worker.

        Args:
            config_text: A `WorkerConfig`, as `CONFIG` writes it.
        """
        return f"{json.dumps(asdict(self))}\n{config_text}"


CONFIG = TypeAdapter(WorkerConfig)
"""Writes and reads the configuration as JSON."""
EVENT: TypeAdapter[EncodedStage | StageFailure | None] = TypeAdapter(EncodedStage | StageFailure | None)
"""Writes and reads an event of a job as JSON: a finished stage, a failure, or `None` at an end without either."""


class WorkerContext:
    """Runs episodes one after another with one simulator and one set of agent processes, which are slow to start."""

    def __init__(self, config: WorkerConfig, alive: Callable[[], None]) -> None:
        """Store the configuration; the simulator starts with the first episode."""
        hosting = config.hosting
        self.config = config
        # An agent in this process has one time limit for a whole stage.
        self._on_round = (lambda: None) if hosting.is_in_process else alive
        self._simulator: Simulator | None = None
        self._processes = None if hosting.is_in_process else AgentProcesses(hosting)

    def attempt(self, spec: EpisodeSpec, job: EpisodeJob) -> Iterator[StageOutcome]:
        """Run an episode from its beginning, with a fresh agent."""
        perception = self.config.backend.perception.create()
        if self._simulator is None:
            self._simulator = self.config.backend.simulator.create()
        return Episode(
            spec,
            job.agent,
            self._agent(job),
            self._simulator,
            perception,
            self.config.protocol,
            job.seed,
            _Heartbeat(self._on_round),
            perception_seed=job.perception_seed,
        ).run()

    def _agent(self, job: EpisodeJob) -> Agent | HostedAgent:
        """Make a fresh agent. Oracle baselines are given oracle data and stay in this process."""
        if self._processes is not None and job.agent not in ORACLE_BASELINES:
            return RemoteAgent(self._processes, job.agent, self.config.backend.decision, job.seed, job.task_id)
        try:
            if self.config.hosting.is_debugged and job.agent not in ORACLE_BASELINES:
                return self._debugged_agent(job)
            return make_agent(job.agent, self.config.backend.decision.create(job.seed))
        except (KeyboardInterrupt, EndedError):
            raise
        except BaseException as error:
            return _FailedAgent(error)

    def _debugged_agent(self, job: EpisodeJob) -> HostedAgent:
        """Make a fresh agent whose exceptions open the debugger."""
        from evonav.evaluation.hosting.debugger import DebuggedAgent, post_mortem

        with post_mortem():
            return DebuggedAgent(make_agent(job.agent, self.config.backend.decision.create(job.seed)))

    def close_simulator(self) -> None:
        """Close the simulator, as after an episode that did not end; the next episode starts another one."""
        if self._simulator is not None:
            self._simulator.close()
        self._simulator = None

    def close(self) -> None:
        """Close the simulator and end the agents' processes; safe to call twice."""
        self.close_simulator()
        if self._processes is not None:
            self._processes.close()


class _FailedAgent(LocalAgent):
    """An agent that could not be made: every stage of it is errored with the same error."""

    def __init__(self, error: BaseException) -> None:
        self._error = error

    @property
    def sensors(self) -> SensorConfig:
        """The first thing that a stage reads of an agent."""
        raise self._error


class _Heartbeat:
    """Reports after every round that the episode continues."""

    def __init__(self, on_round: Callable[[], None]) -> None:
        self._on_round = on_round

    def stage_begins(self, stage: int, simulator: Simulator) -> None:
        self._on_round()

    def round_begins(self, observation: Observation) -> None:
        pass

    def round_ends(self, record: RoundRecord) -> None:
        self._on_round()


class _Retries:
    """Counts the retries that are left to an episode."""

    def __init__(self, num_retries: int) -> None:
        self._num_left: defaultdict[int, int] = defaultdict(lambda: num_retries)

    def take(self, failure: StageFailure) -> bool:
        """Use up a retry after a failure, if it may be retried and one is left."""
        if failure.kind not in RETRIED:
            return False
        # The limit for failures of the agent's own process is per episode and not per stage: retries take time.
        stage = 0 if failure.kind.is_agents else failure.stage
        self._num_left[stage] -= 1
        return self._num_left[stage] >= 0


class EpisodeWork:
    """The work of `evonav.parallel.pool`. Cells of a sweep share a worker: each configuration has a context."""

    def __init__(self, _settings: str, alive: Callable[[], None]) -> None:
        self._alive = alive
        self._contexts: dict[str, WorkerContext] = {}

    def __call__(self, text: str) -> Generator[str, None, str]:
        """Run the episode of `EpisodeJob.text`; yield and return events, as `EVENT` writes them.

        After a failure that costs only the attempt, the failure is an event, and the stages from stage 1 on come again.
        """
        head, _, config_text = text.partition("\n")
        job, context = EpisodeJob(**json.loads(head)), self._context(config_text)
        num_left = _Retries(context.config.num_retries)
        try:
            shift_m = None if job.shift_m is None else (job.shift_m[0], job.shift_m[1])
            task = context.config.backend.tasks.create(Path(job.path))
            spec = replace(task, opaque_id=job.opaque_id, shift_m=shift_m)
            is_whole = False
            while not is_whole:
                is_whole = True
                for outcome in context.attempt(spec, job):
                    if outcome.failure is not None and num_left.take(outcome.failure):
                        yield _text(outcome.failure)
                        is_whole = False
                        context.close_simulator()
                        break
                    yield _text(_encoded(outcome, spec, sends_floor_plan=job.sends_floor_plans))
        except Exception as error:
            context.close_simulator()
            message = f"{type(error).__name__}: {error}"
            return _text(StageFailure(0, ErrorKind.HARNESS, message, error_text.traceback_of(error)))
        return _text(None)

    def _context(self, config_text: str) -> WorkerContext:
        found = self._contexts.pop(config_text, None)
        while found is None and len(self._contexts) >= MAX_CONTEXTS:
            self._contexts.pop(next(iter(self._contexts))).close()
        self._contexts[config_text] = context = found or WorkerContext(CONFIG.validate_json(config_text), self._alive)
        return context

    def close(self) -> None:
        """Close all contexts."""
        for context in self._contexts.values():
            context.close()
        self._contexts.clear()


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
