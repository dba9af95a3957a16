"""Agents as the evaluator sees them, in its own process or another; every answer has been checked."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

from evonav.agents.agent import Agent, AgentAction, EntryBelief, SensorConfig
from evonav.agents.explanation import RoundDiagnostics, explains, explanation_of
from evonav.agents.hosting import wire
from evonav.agents.hosting.entries import Entries
from evonav.component import Component
from evonav.decision.question import DecisionModel
from evonav.errors import InvalidArgumentError
from evonav.evaluation.hosting.model_relay import is_relayed
from evonav.evaluation.hosting.process import AgentFailedError, AgentProcess, failure_of
from evonav.evaluation.hosting.processes import AgentProcesses
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal, TaskInfo

T = TypeVar("T")


class HostedAgent(ABC):
    """An agent whose answers were read from JSON, wherever it runs."""

    _num_bytes = 0
    """Size of the stage's diagnostics so far."""

    @property
    @abstractmethod
    def sensors(self) -> SensorConfig:
        """The sensors that the agent needs."""

    @property
    def cpu_s(self) -> float:
        """CPU time that processes of its own have used."""
        return 0.0

    @abstractmethod
    def begin_task(self, task: TaskInfo) -> None:
        """Start in a new house."""

    @abstractmethod
    def begin_stage(self, goal: Goal) -> None:
        """Start the search for a new goal."""

    @abstractmethod
    def look(self, observation: Observation, *, wants_entries: bool = False) -> None:
        """Take the observation of a decision round. It may be dropped then: an agent may think for long.

        Args:
            wants_entries: Whether `entries` will be asked right after the round, and may be answered with it.
        """

    @abstractmethod
    def act(self) -> AgentAction:
        """Decide what to do in the round."""

    @abstractmethod
    def diagnostics(self) -> RoundDiagnostics:
        """Return what the agent said of the last round, right after it."""

    @abstractmethod
    def entries(self) -> Sequence[EntryBelief] | None:
        """Return the object memory; None if the agent does not explain itself."""

    def costs(self) -> Mapping[str, float]:
        """Return what its decision model has cost so far, by field of `StageCosts`; empty where that is not known."""
        return {}

    def _read_diagnostics(self, text: bytes) -> RoundDiagnostics:
        self._num_bytes += len(text)
        if self._num_bytes > wire.MAX_STAGE_BYTES:
            raise InvalidArgumentError(
                f"diagnostics: {self._num_bytes} bytes of JSON in a stage: must be at most {wire.MAX_STAGE_BYTES}"
            )
        return wire.DIAGNOSTICS.read(text)


class LocalAgent(HostedAgent):
    """An agent in the evaluator's own process."""

    def __init__(self, agent: Agent) -> None:
        """Host an agent."""
        self._agent = agent
        self._explains = explains(agent)
        self._is_first = True
        self._entries = Entries()
        self._observations: list[Observation] = []

    @property
    def sensors(self) -> SensorConfig:
        """The sensors that the agent needs."""
        return wire.SENSORS.read(wire.write_sensors(self._agent))

    def begin_task(self, task: TaskInfo) -> None:
        """Start in a new house."""
        self._agent.begin_task(task)

    def begin_stage(self, goal: Goal) -> None:
        """Start the search for a new goal."""
        self._num_bytes, self._is_first = 0, True
        self._agent.begin_stage(goal)

    def look(self, observation: Observation, *, wants_entries: bool = False) -> None:
        """Take the observation of a decision round."""
        self._observations = [observation]

    def act(self) -> AgentAction:
        """Decide what to do in the round."""
        return wire.read_action(wire.write_action(self._agent.act(self._observations.pop())))

    def diagnostics(self) -> RoundDiagnostics:
        """Return what the agent said of the last round, right after it."""
        if not self._explains:
            return RoundDiagnostics()
        is_first, self._is_first = self._is_first, False
        said = explanation_of(self._agent).diagnostics(is_first=is_first)
        return self._read_diagnostics(wire.DIAGNOSTICS.write(said))

    def entries(self) -> Sequence[EntryBelief] | None:
        """Return the object memory; None if the agent does not explain itself."""
        if not self._explains:
            return None
        return self._entries.read(self._entries.write(explanation_of(self._agent).entries()))


class RemoteAgent(HostedAgent):
    """An agent in a process of its own.

    If that process is lost, the next request starts a fresh agent in a fresh process, which knows no task yet.
    """

    def __init__(
        self,
        processes: AgentProcesses,
        name: str,
        decision: Component[DecisionModel],
        seed: int,
        task_id: str | None = None,
    ) -> None:
        """Start nothing yet.

        Args:
            processes: Processes of agents, which lend it one when it is needed, until `close`.
            decision: Decision model, made in the agent's process.
            task_id: Name of the task in the log and in errors; default: the name that the agent is given.
        """
        self._processes = processes
        self._name = name
        self._decision = decision
        self._seed = seed
        self._task_id = task_id
        self._process: AgentProcess | None = None
        self._sensors: SensorConfig | None = None
        self._lost_between: AgentFailedError | None = None
        """The loss of the process after a stage, by which the next one fails."""
        self._entries = Entries()
        self._last_parts: dict[str, bytes] = {}
        """Parts of the answer to the last `begin_stage` or `act`."""
        self._label = name
        self._cpu_s = 0.0

    @property
    def cpu_s(self) -> float:
        """CPU time that its processes have used."""
        return self._cpu_s

    @property
    def memory_mb(self) -> float | None:
        """Peak resident memory of its process; `None` without one, or if the system does not report it."""
        return None if self._process is None else self._process.memory_mb

    @property
    def sensors(self) -> SensorConfig:
        """The sensors that the agent needs."""
        if self._sensors is None:
            self._make()
        assert self._sensors is not None
        return self._sensors

    def begin_task(self, task: TaskInfo) -> None:
        """Start in a new house."""
        self._label = f"{self._name} {self._task_id or task.task_id}"
        self._describe(self._label)
        self._sense(self._ask("begin_task", task))
        self._last_parts = {}

    def begin_stage(self, goal: Goal) -> None:
        """Start the search for a new goal."""
        self._num_bytes = 0
        self._describe(f"{self._label} stage {goal.stage}")
        self._last_parts = self._ask("begin_stage", goal)
        self._sense(self._last_parts)

    def look(self, observation: Observation, *, wants_entries: bool = False) -> None:
        """Take the observation of a decision round; its process has a copy then."""
        self._send("act", observation, wants_entries)

    def act(self) -> AgentAction:
        """Decide what to do in the round."""
        self._last_parts = self._answer("act")
        return wire.read_action(_part(self._last_parts, "action"))

    def diagnostics(self) -> RoundDiagnostics:
        """Return what the agent said of the last round, right after it."""
        if (failure := self._last_parts.get("diagnostics_failure")) is not None:
            raise failure_of(failure)
        text = self._last_parts.get("diagnostics")
        return RoundDiagnostics() if text is None else self._read_diagnostics(text)

    def entries(self) -> Sequence[EntryBelief] | None:
        """Return the object memory; None if the agent does not explain itself."""
        failure, text = (self._last_parts.pop(name, None) for name in ("entries_failure", "entries"))
        if failure is not None:
            raise failure_of(failure, is_sandboxed=self._processes.hosting.isolation == "sandbox")
        if text is None:
            text = self._ask("entries").get("entries")
        return None if text is None else self._entries.read(text)

    def costs(self) -> Mapping[str, float]:
        """Return what its decision model has cost since it was made; empty if that cannot be read."""
        if self._process is None:
            return {}
        try:
            costs = wire.COSTS.read(_part(self._ask("costs"), "costs"))
        except InvalidArgumentError:  # they decide nothing
            return {}
        except AgentFailedError as error:
            if error.kind.loses_memory:
                self._lost_between = error
            return {}
        trusted = {} if self._process.relay is None else self._process.relay.costs()
        return {**{str(name): amount for name, amount in costs.items()}, **trusted}

    def close(self) -> None:
        """Give the process back; safe to call twice."""
        if self._process is not None:
            self._processes.take_back(self._process)
        self._process = self._sensors = None
        self._last_parts = {}

    def _make(self) -> None:
        if self._lost_between is not None:
            error, self._lost_between = self._lost_between, None
            raise error
        with self._processes.waiting():
            self._process = self._processes.lend(self._name)
            self._describe(self._label)
            relay = self._process.relay
            if relay is not None and is_relayed(self._decision):
                options: Mapping[str, object] = relay.use(self._decision)
            else:
                options = self._decision.keywords
        self._sense(self._ask("make", self._decision.path, self._seed, options))

    def _sense(self, parts: Mapping[str, bytes]) -> None:
        self._sensors = wire.SENSORS.read(_part(parts, "sensors"))

    def _describe(self, label: str) -> None:
        if self._process is not None:
            self._process.describe(label)

    def _ask(self, operation: str, *arguments: object) -> dict[str, bytes]:
        self._send(operation, *arguments)
        return self._answer(operation)

    def _send(self, operation: str, *arguments: object) -> None:
        if self._process is None:
            self._make()
        self._use(operation, lambda process: process.send(operation, *arguments))

    def _answer(self, operation: str) -> dict[str, bytes]:
        return self._use(operation, lambda process: process.answer())

    def _use(self, operation: str, call: Callable[[AgentProcess], T]) -> T:
        """Call something of the process while other episodes compute, and add up its CPU time."""
        process = self._process
        assert process is not None
        before_s = process.cpu_s
        try:
            with self._processes.waiting():
                return call(process)
        except AgentFailedError as error:
            if error.kind.loses_memory or operation == "make":
                self.close()
            raise
        finally:
            self._cpu_s += process.cpu_s - before_s


def _part(parts: Mapping[str, bytes], name: str) -> bytes:
    if name not in parts:
        raise InvalidArgumentError(f'malformed response: missing "{name}"')
    return parts[name]
