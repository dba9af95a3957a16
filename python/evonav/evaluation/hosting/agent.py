"""Agents as the evaluator sees them, in its own process or another; every answer has been checked."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from evonav.agents import wire
from evonav.agents.agent import Agent, AgentAction, EntryBelief, ExplainingAgent, RoundDiagnostics, Sensing
from evonav.sensors.observation import Observation
from evonav.tasks.public import StageInput, TaskInfo


class HostedAgent(ABC):
    """An agent whose answers were read from JSON, wherever it runs."""

    @property
    @abstractmethod
    def sensing(self) -> Sensing:
        """The sensors that the agent needs."""

    @property
    def cpu_s(self) -> float:
        """CPU time that processes of its own have used."""
        return 0.0

    @abstractmethod
    def begin_task(self, task: TaskInfo) -> None:
        """Start in a new house."""

    @abstractmethod
    def begin_stage(self, stage: StageInput) -> None:
        """Start the search for a new goal."""

    @abstractmethod
    def act(self, observation: Observation) -> AgentAction:
        """Decide what to do in one decision round."""

    @abstractmethod
    def diagnostics(self) -> RoundDiagnostics:
        """Return what the agent said of the last round, right after it."""

    @abstractmethod
    def entries(self) -> Sequence[EntryBelief] | None:
        """Return the object memory; None if the agent is no `ExplainingAgent`."""

    def costs(self) -> Mapping[str, float]:
        """Return what its decision model has cost so far, by field of `StageCosts`; empty where that is not known."""
        return {}


class LocalAgent(HostedAgent):
    """An agent in the evaluator's own process."""

    def __init__(self, agent: Agent) -> None:
        """Host an agent."""
        self._agent = agent
        self._explaining = agent if isinstance(agent, ExplainingAgent) else None

    @property
    def sensing(self) -> Sensing:
        """The sensors that the agent needs."""
        return wire.SENSING.read(wire.SENSING.write(self._agent.sensing))

    def begin_task(self, task: TaskInfo) -> None:
        """Start in a new house."""
        self._agent.begin_task(task)

    def begin_stage(self, stage: StageInput) -> None:
        """Start the search for a new goal."""
        self._agent.begin_stage(stage)

    def act(self, observation: Observation) -> AgentAction:
        """Decide what to do in one decision round."""
        return wire.read_action(wire.write_action(self._agent.act(observation)))

    def diagnostics(self) -> RoundDiagnostics:
        """Return what the agent said of the last round, right after it."""
        if self._explaining is None:
            return RoundDiagnostics()
        return wire.DIAGNOSTICS.read(wire.DIAGNOSTICS.write(self._explaining.diagnostics()))

    def entries(self) -> Sequence[EntryBelief] | None:
        """Return the object memory; None if the agent is no `ExplainingAgent`."""
        if self._explaining is None:
            return None
        return wire.ENTRIES.read(wire.ENTRIES.write(list(self._explaining.entries())))
