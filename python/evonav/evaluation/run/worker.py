"""What a worker of `evonav.parallel.pool` does in an evaluation: an episode a job, told stage by stage.

Agents run in processes of their own (`agent_process.py`), unless they are oracle baselines or it is switched off. A
worker that dies or hangs costs its episode, not the run.

What is lost to the machine is tried again: the episode runs from its beginning, with a fresh agent and the same seed.
That brings a deterministic agent to the state in which it began the stage, which no snapshot would do for every agent;
of another kind of agent, the newer rollout replaces the older. Here it is done for a lost simulator, a lost process of
an agent and a failure of the harness; for a lost worker, by those who run the pool (`engine.py`).
"""

import json
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from evonav.agents import error_text
from evonav.agents.agent import Agent, AgentAction, Sensing
from evonav.errors import HouseError
from evonav.evaluation.episode.episode import Episode
from evonav.evaluation.episode.observer import LOSSES
from evonav.evaluation.episode.oracle_baselines import ORACLE_BASELINES
from evonav.evaluation.episode.outcome import StageOutcome
from evonav.evaluation.episode.spec import EpisodeSpec
from evonav.evaluation.hosting.agent import HostedAgent
from evonav.evaluation.hosting.process import AgentHosting, AgentProcesses, RemoteAgent
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.records.encoded import EncodedStage, encode_stage
from evonav.evaluation.records.schema import ErrorKind, FloorPlan, RoundRecord, StageFailure
from evonav.evaluation.run.components import Backend, make_agent
from evonav.sensors.observation import Observation
from evonav.tasks.public import StageInput, TaskInfo
from evonav.world.simulator import Simulator

WORK = "evonav.evaluation.run.worker:EpisodeWork"
RETRIED = (ErrorKind.HARNESS, ErrorKind.SIMULATOR_LOST, *LOSSES)
"""Failures that another attempt may not have; an exception of an agent's or of a simulator's is the same again."""
MAX_CONTEXTS = 2
"""Kept by a worker; the one that was used longest ago makes room."""


@dataclass(frozen=True, slots=True)
class Setup:
    """What episodes need beside the task and the agent."""

    backend: Backend
    protocol: ProtocolConfig
    hosting: AgentHosting
    num_retries: int = 0
    """Of a stage."""

    @property
    def text(self) -> str:
        """As JSON, to be read by `from_values`."""
        return json.dumps(asdict(self), sort_keys=True)

    @classmethod
    def from_values(cls, values: dict[str, Any]) -> "Setup":
        """What `text` tells."""
        return cls(
            Backend.from_json(values["backend"]),
            ProtocolConfig(**values["protocol"]),
            AgentHosting(**values["hosting"]),
            values["num_retries"],
        )


@dataclass(frozen=True, slots=True)
class EpisodeJob:
    """One agent, one task."""

    agent: str
    task_id: str
    path: str
    """Of the task."""
    seed: int
    """The agent's."""
    perception_seed: int
    """The perception's."""
    sends_floor_plans: bool = False
    """Send the floor plans of the task's stages: one episode of a task does, for all agents."""

    def text(self, setup_text: str) -> str:
        """As a worker takes it."""
        return f"{json.dumps(asdict(self))}\n{setup_text}"


class WorkerContext:
    """Where episodes run one after another, with one simulator for all: one with a process takes long to start.

    So it is with the processes of agents.
    """

    def __init__(self, setup: Setup, alive: Callable[[], None]) -> None:
        """Makes nothing yet."""
        hosting = setup.hosting
        self.setup = setup
        # An agent in this process has one limit of time for a whole stage.
        self.on_round = (lambda: None) if hosting.is_in_process else alive
        self._simulator: Simulator | None = None
        self._processes = None if hosting.is_in_process else AgentProcesses(hosting)

    def agent(self, job: EpisodeJob) -> Agent | HostedAgent:
        """A fresh agent. Oracle baselines are given oracle data: they stay here."""
        if self._processes is not None and job.agent not in ORACLE_BASELINES:
            return RemoteAgent(self._processes, job.agent, self.setup.backend.decision, job.seed)
        try:
            return make_agent(job.agent, self.setup.backend.decision.create(job.seed))
        except Exception as error:
            return _Unmade(error)

    @contextmanager
    def simulator(self) -> Iterator[Simulator]:
        """The simulator; it is not used again after an episode that did not end by itself."""
        simulator, self._simulator = self._simulator or self.setup.backend.simulator.create(), None
        try:
            yield simulator
        except BaseException:
            simulator.close()
            raise
        self._simulator = simulator

    def close(self) -> None:
        """Closes the simulator and ends the agents' processes; safe to call twice."""
        if self._simulator is not None:
            self._simulator.close()
        self._simulator = None
        if self._processes is not None:
            self._processes.close()


class _Unmade:
    """Stands for an agent whose making has failed: its stages are errored with that, each."""

    def __init__(self, error: Exception) -> None:
        self._error = error

    @property
    def sensing(self) -> Sensing:
        raise self._error

    @sensing.setter
    def sensing(self, _: Sensing) -> None:
        raise self._error

    def begin_task(self, task: TaskInfo) -> None:
        raise self._error

    def begin_stage(self, stage: StageInput) -> None:
        raise self._error

    def act(self, observation: Observation) -> AgentAction:
        raise self._error


class _Heartbeat:
    """Says of every round that the episode goes on."""

    def __init__(self, on_round: Callable[[], None]) -> None:
        self._on_round = on_round

    def stage_begins(self, stage: int, simulator: Simulator) -> None:
        self._on_round()

    def round_begins(self, observation: Observation) -> None:
        pass

    def round_ends(self, record: RoundRecord) -> None:
        self._on_round()


def run_job(job: EpisodeJob, context: WorkerContext) -> Generator[EncodedStage | StageFailure]:
    """Runs an episode in this process.

    Yields:
        Finished stages. After a failure that costs only the attempt: the failure, and then the stages from stage 1 on
        again.
    """
    case = context.setup.backend.tasks.create(Path(job.path))
    num_tried: Counter[int] = Counter()
    is_whole = False
    while not is_whole:
        is_whole = True
        with closing(_attempt(case, job, context)) as outcomes:
            for outcome in outcomes:
                failure = outcome.failure
                if failure is not None and failure.kind in RETRIED:
                    # What an agent does to itself is tried again so often an episode, not a stage: it costs time.
                    stage = 0 if failure.kind.is_agents else failure.stage
                    if num_tried[stage] < context.setup.num_retries:
                        num_tried[stage] += 1
                        is_whole = False
                        yield failure
                        break
                yield _encoded(outcome, case, sends_floor_plan=job.sends_floor_plans)


def _attempt(case: EpisodeSpec, job: EpisodeJob, context: WorkerContext) -> Generator[StageOutcome]:
    setup = context.setup
    perception = setup.backend.perception.create()
    with context.simulator() as simulator:
        agent = context.agent(job)
        observer = _Heartbeat(context.on_round)
        yield from Episode(
            case,
            job.agent,
            agent,
            simulator,
            perception,
            setup.protocol,
            job.seed,
            observer,
            perception_seed=job.perception_seed,
        ).run()


class EpisodeWork:
    """A worker's, as `evonav.parallel.pool` calls it. Cells of a sweep share it: each setup has a context."""

    def __init__(self, _settings: str, alive: Callable[[], None]) -> None:
        self._alive = alive
        self._contexts: dict[str, WorkerContext] = {}

    def __call__(self, text: str) -> Generator[str, None, str]:
        """Runs the episode of `EpisodeJob.text`; what it yields and returns is for `decode_event`."""
        head, _, setup_text = text.partition("\n")
        try:
            context = self._context(setup_text)
            with closing(run_job(EpisodeJob(**json.loads(head)), context)) as said:
                for news in said:
                    yield news.to_text() if isinstance(news, EncodedStage) else _failure_text(news)
        except Exception as error:
            message = f"{type(error).__name__}: {error}"
            return _failure_text(StageFailure(0, ErrorKind.HARNESS, message, error_text.traceback_of(error)))
        return "{}"

    def _context(self, setup_text: str) -> WorkerContext:
        found = self._contexts.pop(setup_text, None)
        while found is None and len(self._contexts) >= MAX_CONTEXTS:
            self._contexts.pop(next(iter(self._contexts))).close()
        self._contexts[setup_text] = place = found or WorkerContext(
            Setup.from_values(json.loads(setup_text)), self._alive
        )
        return place

    def close(self) -> None:
        """Closes all workplaces."""
        while self._contexts:
            self._contexts.popitem()[1].close()


def decode_event(text: str) -> EncodedStage | StageFailure | None:
    """Read an event of a job: a finished stage, a failure, or `None` for a job that ended without one."""
    if "\n" in text:
        return EncodedStage.from_text(text)
    values = json.loads(text)
    return StageFailure.from_values(values) if values else None


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


def _failure_text(failure: StageFailure) -> str:
    return json.dumps(asdict(failure))
