"""Agents as the evaluator sees them, in its own process or another; every answer has been checked."""

import sys
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TypeVar

from evonav.agents.agent import Agent, AgentAction, EntryBelief, SensorConfig
from evonav.agents.explanation import RoundDiagnostics
from evonav.agents.hosting import wire
from evonav.agents.hosting.serving import AgentServer
from evonav.component import Component
from evonav.decision.question import DecisionModel
from evonav.errors import InvalidArgumentError
from evonav.evaluation.hosting.model_relay import is_relayed
from evonav.evaluation.hosting.process import AgentFailedError, AgentProcess, failure_of
from evonav.evaluation.hosting.processes import AgentProcesses
from evonav.sensors.observation import Observation
from evonav.tasks.public import Goal, TaskInfo

T = TypeVar("T")
Call = Callable[[], dict[str, bytes]]
"""Returns the parts of an answer."""


class HostedAgent(ABC):
    """An agent whose answers are read from JSON, wherever it runs."""

    cpu_s = 0.0
    """CPU time that processes of its own have used."""
    is_sandboxed = False

    def __init__(self) -> None:
        self._sensors: SensorConfig | None = None
        self._entries = wire.Entries()
        self._num_bytes = 0
        """Size of the stage's diagnostics so far."""
        self._last_parts: dict[str, bytes] = {}
        """Parts of the answer to the last `begin_stage` or `act`."""
        self._pending: Call | None = None
        """Waits for the answer to `act`, between `look` and `act`."""

    @abstractmethod
    def _make(self) -> dict[str, bytes]:
        """Make the agent, and return its sensors."""

    @abstractmethod
    def _send(self, operation: str, *arguments: object) -> Call:
        """Send a request to an `AgentServer`, and return what waits for the parts of its answer."""

    @property
    def sensors(self) -> SensorConfig:
        """The sensors that the agent needs."""
        return self._sensors or self._sense(self._make())

    def begin_task(self, task: TaskInfo) -> None:
        """Start in a new house."""
        self._sense(self._send("begin_task", task)())
        self._last_parts = {}

    def begin_stage(self, goal: Goal) -> None:
        """Start the search for a new goal."""
        self._num_bytes = 0
        self._last_parts = self._send("begin_stage", goal)()
        self._sense(self._last_parts)

    def look(self, observation: Observation, *, wants_entries: bool = False) -> None:
        """Take the observation of a decision round. It may be dropped then: an agent may think for long.

        Args:
            wants_entries: Whether `entries` will be asked right after the round: they come with its answer.
        """
        self._pending = self._send("act", observation, wants_entries)

    def act(self) -> AgentAction:
        """Decide what to do in the round."""
        assert self._pending is not None, "`look` comes first"
        answer, self._pending = self._pending, None
        self._last_parts = answer()
        return wire.read_action(_part(self._last_parts, "action"))

    def diagnostics(self) -> RoundDiagnostics:
        """Return what the agent said of the last round, right after it."""
        text = self._explained("diagnostics")
        if text is None:
            return RoundDiagnostics()
        self._num_bytes += len(text)
        if self._num_bytes > wire.MAX_STAGE_BYTES:
            raise InvalidArgumentError(
                f"diagnostics: {self._num_bytes} bytes of JSON in a stage: must be at most {wire.MAX_STAGE_BYTES}"
            )
        return wire.DIAGNOSTICS.read(text)

    def entries(self) -> Sequence[EntryBelief] | None:
        """Return the object memory; None if the agent does not explain itself."""
        text = self._explained("entries")
        if text is None:
            text = self._send("entries")().get("entries")
        return None if text is None else self._entries.read(text)

    def costs(self) -> Mapping[str, float]:
        """Return what its decision model has cost so far, by field of `StageCosts`; empty where that is not known."""
        return {}

    def _explained(self, name: str) -> bytes | None:
        """Return a part of the last answer, once; the agent may have failed to say it."""
        failure, text = self._last_parts.pop(f"{name}_failure", None), self._last_parts.pop(name, None)
        if failure is not None:
            raise failure_of(failure, is_sandboxed=self.is_sandboxed)
        return text

    def _sense(self, parts: Mapping[str, bytes]) -> SensorConfig:
        self._sensors = wire.SENSORS.read(_part(parts, "sensors"))
        return self._sensors


class LocalAgent(HostedAgent):
    """An agent in the evaluator's own process, whose exceptions are raised as they are."""

    def __init__(self, agent: Agent | BaseException, watch: Callable[[Call], Call] = lambda call: call) -> None:
        """Host an agent.

        Args:
            agent: The agent, or the reason why it could not be made: every stage fails by that.
            watch: Decorates the calls of the agent.
        """
        super().__init__()
        self._server = AgentServer()
        self._agent, self._watch = agent, watch

    def _make(self) -> dict[str, bytes]:
        if isinstance(self._agent, BaseException):
            raise self._agent
        return self._server.host(self._agent)

    def _send(self, operation: str, *arguments: object) -> Call:
        return self._watch(partial(getattr(self._server, f"do_{operation}"), *arguments))


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
        super().__init__()
        self.is_sandboxed = processes.hosting.isolation == "sandbox"
        self._processes = processes
        self._name = name
        self._decision = decision
        self._seed = seed
        self._task_id = task_id
        self._process: AgentProcess | None = None
        self._lost_between: AgentFailedError | None = None
        """The loss of the process after a stage, by which the next one fails."""
        self._label = name

    @property
    def memory_mb(self) -> float | None:
        """Peak resident memory of its process; `None` without one, or if the system does not report it."""
        return None if self._process is None else self._process.memory_mb

    def begin_task(self, task: TaskInfo) -> None:
        """Start in a new house."""
        self._label = f"{self._name} {self._task_id or task.task_id}"
        self._describe(self._label)
        super().begin_task(task)

    def begin_stage(self, goal: Goal) -> None:
        """Start the search for a new goal."""
        self._describe(f"{self._label} stage {goal.stage}")
        super().begin_stage(goal)

    def costs(self) -> Mapping[str, float]:
        """Return what its decision model has cost since it was made; empty if that cannot be read."""
        if self._process is None:
            return {}
        try:
            costs = wire.COSTS.read(_part(self._send("costs")(), "costs"))
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

    def _make(self) -> dict[str, bytes]:
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
        return self._send("make", self._decision.path, self._seed, options)()

    def _describe(self, label: str) -> None:
        if self._process is not None:
            self._process.describe(label)

    def _send(self, operation: str, *arguments: object) -> Call:
        if self._process is None:
            self._sense(self._make())
        self._use(operation, lambda process: process.send(operation, *arguments))
        return lambda: self._use(operation, lambda process: process.answer())

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
            self.cpu_s += process.cpu_s - before_s


def _part(parts: Mapping[str, bytes], name: str) -> bytes:
    if name not in parts:
        raise InvalidArgumentError(f'malformed response: missing "{name}"')
    return parts[name]


# For agents under development


def check_terminal() -> None:
    """Check that a debugger can be used here; `InvalidArgumentError` if input or output is no terminal."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise InvalidArgumentError(
            "--pdb needs a terminal to type in; without one, --fail-fast prints the traceback of the first error"
        )


@contextmanager
def post_mortem() -> Iterator[None]:
    """Open the debugger at the line that raised, then let the exception pass."""
    try:
        yield
    except Exception as error:
        import pdb

        traceback.print_exc()
        print("the agent raised: look around, then leave with `q`", file=sys.stderr)
        pdb.post_mortem(error.__traceback__)
        raise
