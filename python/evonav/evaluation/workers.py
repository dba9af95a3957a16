"""Worker processes: an episode each, contained. A worker that dies or hangs costs its episode, not the run.

Agents run in processes of their own (`agent_process.py`), unless they are yardsticks or it is switched off.

Parent and workers exchange JSON only: nothing a worker sends is unpickled.

A simulator's process that is lost costs less than that: the episode runs again from its beginning, with a fresh agent
and the same seed, in another process of the simulator. That brings a deterministic agent to the state in which it began
the stage, which no snapshot would do for every agent; of another kind of agent, the newer rollout replaces the older.
"""

import json
import multiprocessing
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from multiprocessing.connection import Connection, wait
from pathlib import Path

from evonav.agents.agent import Agent, AgentAction, Sensing
from evonav.evaluation.agent_process import AgentHosting, AgentProcesses, RemoteAgent
from evonav.evaluation.backend import Backend, make_agent
from evonav.evaluation.privileged import YARDSTICKS
from evonav.evaluation.protocol import EpisodeCase, ProtocolConfig, StageOutcome
from evonav.evaluation.records import EndState, ErrorKind, RoundRecord, StageMap, StageRecord
from evonav.evaluation.rollout import Episode
from evonav.parallel import cause_of_death, end_process, end_with_parent, one_thread_each
from evonav.sensors.observation import Observation
from evonav.tasks.public import StageInput, TaskInfo
from evonav.world.simulator import Simulator

MAX_SIMULATOR_RESTARTS = 2
"""A stage."""
SIGN_OF_LIFE_S = 5.0
"""Between two that a worker gives, at least."""


@dataclass(frozen=True, slots=True)
class EpisodeJob:
    """One agent, one task."""

    agent: str
    task_id: str
    path: str
    """Of the task."""
    seed: int
    """The agent's."""


@dataclass(frozen=True, slots=True)
class JobEvent:
    """News of a job: a finished stage, or its end."""

    job: EpisodeJob
    outcome: StageOutcome | None = None
    is_end: bool = False
    failure: tuple[ErrorKind, str] | None = None
    """Why the job ended before its last stage."""


class Workplace:
    """Where episodes run one after another, with one simulator for all: one with a process takes long to start.

    So it is with the processes of agents.
    """

    def __init__(
        self,
        backend: Backend,
        protocol: ProtocolConfig,
        hosting: AgentHosting,
        on_round: Callable[[], None] = lambda: None,
    ) -> None:
        """Makes nothing yet."""
        self.backend = backend
        self.protocol = protocol
        self.on_round = on_round
        self._simulator: Simulator | None = None
        self._processes = None if hosting.is_in_process else AgentProcesses(hosting)

    def agent(self, job: EpisodeJob) -> Agent:
        """A fresh agent. Yardsticks are told oracle data: they stay here."""
        if self._processes is not None and job.agent not in YARDSTICKS:
            return RemoteAgent(self._processes, job.agent, self.backend.decision_spec(), job.seed)
        try:
            return make_agent(job.agent, self.backend.make_decision(job.seed))
        except Exception as error:
            return _Unmade(error)

    @contextmanager
    def simulator(self) -> Iterator[Simulator]:
        """The simulator; it is not used again after an episode that did not end by itself."""
        simulator, self._simulator = self._simulator or self.backend.make_simulator(), None
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


def run_job(job: EpisodeJob, workplace: Workplace) -> Generator[StageOutcome]:
    """Runs an episode in this process.

    Yields:
        Outcomes of the stages. After the loss of a simulator's process, those from stage 1 on again.
    """
    case = workplace.backend.load_case(Path(job.path))
    num_restarts: Counter[int] = Counter()
    is_whole = False
    while not is_whole:
        is_whole = True
        with closing(_attempt(case, job, workplace)) as outcomes:
            for outcome in outcomes:
                record, stage = outcome.record, outcome.record.stage
                kind = None if record.error is None or record.state is EndState.NOT_RUN else record.error.kind
                if kind is ErrorKind.SIMULATOR_LOST and num_restarts[stage] < MAX_SIMULATOR_RESTARTS:
                    num_restarts[stage] += 1
                    is_whole = False
                    break
                yield replace(outcome, num_simulator_restarts=num_restarts[stage])


def _attempt(case: EpisodeCase, job: EpisodeJob, workplace: Workplace) -> Generator[StageOutcome]:
    perception = workplace.backend.make_perception()
    with workplace.simulator() as simulator:
        agent = workplace.agent(job)
        observer = _Heartbeat(workplace.on_round)
        yield from Episode(case, job.agent, agent, simulator, perception, workplace.protocol, job.seed, observer).run()


def run_here(jobs: Sequence[EpisodeJob], backend: Backend, protocol: ProtocolConfig) -> Iterator[JobEvent]:
    """Runs jobs one after another in this process, agents included: for debuggers. Only exceptions are contained."""
    with closing(Workplace(backend, protocol, AgentHosting(is_in_process=True))) as workplace:
        for job in jobs:
            try:
                with closing(run_job(job, workplace)) as outcomes:
                    for outcome in outcomes:
                        yield JobEvent(job, outcome)
            except Exception as error:
                yield JobEvent(job, is_end=True, failure=(ErrorKind.HARNESS, f"{type(error).__name__}: {error}"))
            else:
                yield JobEvent(job, is_end=True)


def run_in_workers(
    jobs: Sequence[EpisodeJob],
    backend: Backend,
    protocol: ProtocolConfig,
    hosting: AgentHosting,
    *,
    num_workers: int,
    stage_timeout_s: float,
) -> Iterator[JobEvent]:
    """Runs jobs in processes, in any order; events of one job come in order.

    Closing the iterator ends the workers at once.
    """
    pending = list(reversed(jobs))
    num_workers = min(num_workers, len(jobs))
    # An agent in a process of its own has a limit of its own, for every answer; what is left is for all the rest.
    limit_s = stage_timeout_s if hosting.is_in_process else stage_timeout_s + hosting.timeout_s
    workers = [_Worker(backend, protocol, hosting) for _ in range(num_workers)]
    try:
        while True:
            for index, worker in enumerate(workers):
                if worker.job is None and pending:
                    if not worker.is_alive:
                        worker = workers[index] = _Worker(backend, protocol, hosting)
                    worker.start(pending.pop())
            busy = [worker for worker in workers if worker.job is not None]
            if not busy:
                return
            timeout_s = max(0.0, min(worker.last_news_s for worker in busy) + limit_s - time.monotonic())
            ready = wait([worker.connection for worker in busy], timeout_s)
            now_s = time.monotonic()
            for worker in busy:
                if worker.connection in ready:
                    event = worker.receive()
                    if event is not None:
                        yield event
                elif now_s - worker.last_news_s >= limit_s:
                    what = "stage" if hosting.is_in_process else "round"
                    yield worker.give_up(ErrorKind.TIMEOUT, f"no {what} ended within {limit_s:g} s")
    finally:
        for worker in workers:
            worker.close()


class _Worker:
    """The parent's side of a worker process."""

    def __init__(self, backend: Backend, protocol: ProtocolConfig, hosting: AgentHosting) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, far_end = context.Pipe()
        with one_thread_each():
            settings = [json.dumps(asdict(part)) for part in (backend, protocol, hosting)]
            self._process = context.Process(target=_serve, args=(far_end, *settings), daemon=True)
            self._process.start()
        far_end.close()
        self.job: EpisodeJob | None = None
        self.last_news_s = 0.0

    @property
    def is_alive(self) -> bool:
        return self._process.is_alive() and not self.connection.closed

    def start(self, job: EpisodeJob) -> None:
        self.job = job
        self.last_news_s = time.monotonic()
        # A worker that died meanwhile is found out by the read that follows.
        with suppress(BrokenPipeError):
            self.connection.send_bytes(json.dumps(asdict(job)).encode())

    def receive(self) -> JobEvent | None:
        """The next event, or a sign of life; a closed connection means that the process died."""
        assert self.job is not None
        try:
            message = json.loads(self.connection.recv_bytes())
        except (EOFError, OSError):
            return self.give_up(ErrorKind.CRASH, f"the worker process died ({cause_of_death(self._process)})")
        self.last_news_s = time.monotonic()
        job = self.job
        if message["kind"] == "alive":
            return None
        if message["kind"] == "stage":
            plan = message["map"]
            outcome = StageOutcome(
                StageRecord.model_validate_json(message["record"]),
                None if plan is None else StageMap.model_validate_json(plan),
                message["wall_s"],
                message["cpu_s"],
                message["num_simulator_restarts"],
            )
            return JobEvent(job, outcome)
        self.job = None
        failure = message["failure"]
        return JobEvent(job, is_end=True, failure=failure and (ErrorKind(failure[0]), failure[1]))

    def give_up(self, kind: ErrorKind, message: str) -> JobEvent:
        """Ends the process and its job."""
        assert self.job is not None
        event = JobEvent(self.job, is_end=True, failure=(kind, message))
        self.job = None
        self.close()
        return event

    def close(self) -> None:
        end_process(self._process, self.connection)


def _serve(connection: Connection, backend_json: str, protocol_json: str, hosting_json: str) -> None:
    """A worker's life: jobs in, stages out, until the parent hangs up."""
    end_with_parent()
    hosting = AgentHosting(**json.loads(hosting_json))
    workplace = Workplace(
        Backend(**json.loads(backend_json)),
        ProtocolConfig(**json.loads(protocol_json)),
        hosting,
        on_round=(lambda: None) if hosting.is_in_process else _signs_of_life(connection),
    )
    with closing(workplace), suppress(EOFError, OSError):  # of the connection: the parent hung up
        while True:
            _serve_job(connection, EpisodeJob(**json.loads(connection.recv_bytes())), workplace)


def _signs_of_life(connection: Connection) -> Callable[[], None]:
    """Tells the parent now and then that an episode goes on."""
    told_s = time.monotonic()

    def tell() -> None:
        nonlocal told_s
        if time.monotonic() - told_s >= SIGN_OF_LIFE_S:
            told_s = time.monotonic()
            _send(connection, {"kind": "alive"})

    return tell


def _serve_job(connection: Connection, job: EpisodeJob, workplace: Workplace) -> None:
    failure: tuple[str, str] | None = None
    try:
        with closing(run_job(job, workplace)) as outcomes:
            for outcome in outcomes:
                _send_stage(connection, outcome)
    except BrokenPipeError:
        raise
    except Exception as error:
        failure = (ErrorKind.HARNESS.value, f"{type(error).__name__}: {error}")
    _send(connection, {"kind": "end", "failure": failure})


def _send_stage(connection: Connection, outcome: StageOutcome) -> None:
    plan = outcome.stage_map
    _send(
        connection,
        {
            "kind": "stage",
            "record": outcome.record.model_dump_json(),
            "map": None if plan is None else plan.model_dump_json(),
            "wall_s": outcome.wall_s,
            "cpu_s": outcome.cpu_s,
            "num_simulator_restarts": outcome.num_simulator_restarts,
        },
    )


def _send(connection: Connection, message: dict[str, object]) -> None:
    connection.send_bytes(json.dumps(message).encode())
