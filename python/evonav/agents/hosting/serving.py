"""Run an agent's process: make agents of one name and answer requests until the evaluator closes the connection.

`evonav.evaluation.hosting.process` starts the process. Requests come from the evaluator, who is trusted, so they are
pickled, with their arrays in shared memory, which an agent may keep and change (`evonav.agents.hosting.shared_slots`).
Answers are JSON. The process gets no path of a task and imports nothing that reads one.
"""

import ctypes
import faulthandler
import os
import signal
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, Literal, TypeAlias

from evonav.agents.agent import Agent
from evonav.agents.explanation import explains, explanation_of
from evonav.agents.hosting import sandbox, wire
from evonav.agents.hosting.error_text import describe, message_of, traceback_of
from evonav.agents.hosting.requests import read_request
from evonav.agents.hosting.shared_slots import SharedSlots
from evonav.agents.registry import agent_factory, new_agent
from evonav.component import import_callable
from evonav.decision.question import Metered
from evonav.errors import DecisionError, InvalidArgumentError
from evonav.parallel import profiling
from evonav.parallel.one_core import OneCore

LENGTH = struct.Struct("<Q")
"""Format of the size of the message that follows."""

_is_serving = False


def refuse_in_agent_process(call: str) -> None:
    """Refuse a call in an agent's process, where it would import the agent's file and so call itself without end.

    Raises:
        InvalidArgumentError: This process is an agent's.
    """
    if _is_serving:
        raise InvalidArgumentError(f'importing it calls `{call}`: put that call under `if __name__ == "__main__":`')


Answering: TypeAlias = Callable[[str, tuple[Any, ...]], dict[str, bytes]]
"""Executes a request, with an operation and its arguments, and returns named parts, each a line of JSON."""


def main(socket_fd: int, life_fd: int, block_fd: int, answering: Answering | None = None) -> None:
    """Serve requests on the inherited descriptors.

    Args:
        socket_fd: Socket that brings requests and takes answers.
        life_fd: Pipe that is closed when the evaluator ends, however it ends.
        block_fd: The shared memory.
        answering: Answers the requests; default: an `AgentServer`.
    """
    global _is_serving
    _is_serving = True
    for descriptor in (socket_fd, life_fd, block_fd):
        os.set_inheritable(descriptor, False)
    sys.argv[1:] = []
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    faulthandler.enable()
    _end_with_parent(life_fd)
    memory = SharedSlots(block_fd)
    os.register_at_fork(before=memory.part)
    connection = socket.socket(fileno=socket_fd)
    requests = open(socket_fd, "rb", closefd=False)  # noqa: SIM115 - closed below
    closed = suppress(BrokenPipeError, ConnectionResetError)
    with connection, requests, closed, profiling.sampled("agents"):
        _serve(requests, connection, memory, answering or AgentServer().answer)


def _end_with_parent(life_fd: int) -> None:
    """Ignore interrupts, and end this process with the evaluator, also in the middle of a request."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":  # works even while an agent holds the interpreter's lock
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(1, signal.SIGKILL)

    def watch() -> None:
        with suppress(OSError):
            os.read(life_fd, 1)
        if os.getpgrp() == os.getpid():  # its children, too
            os.killpg(os.getpid(), signal.SIGKILL)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _serve(requests: BinaryIO, connection: socket.socket, memory: SharedSlots, answering: Answering) -> None:
    pid, one_core = os.getpid(), OneCore()
    while (request := _received(requests)) is not None:
        is_bound = one_core.release()
        number, operation, arguments = read_request(request, memory.arrays)
        parts = answering(operation, arguments)
        del arguments
        if os.getpid() != pid:
            os._exit(1)  # an agent forked and the child returned: only the parent answers
        for stream in (sys.stdout, sys.stderr):
            with suppress(Exception):  # an agent may have closed or replaced it
                stream.flush()
        data = wire.write_answer(number, time.process_time(), memory.free, parts)
        # Before the evaluator has the answer: then it can bind this thread itself.
        one_core.stay() if is_bound else one_core.remember()
        connection.sendall(LENGTH.pack(len(data)) + data)


def _received(requests: BinaryIO) -> bytes | None:
    """Return the next request; `None` at the end of the connection."""
    header = requests.read(LENGTH.size)
    if len(header) < LENGTH.size:
        return None
    (size,) = LENGTH.unpack(header)
    request = requests.read(size)
    return request if len(request) == size else None


class AgentServer:
    """Makes an agent and calls it; the answer to a request is a set of named parts, each a line of JSON."""

    def __init__(self) -> None:
        self._factory: Callable[..., Agent] | None = None
        self._agent: Agent | None = None
        self._explains = False
        self._is_first = True
        self._entries = wire.Entries()
        self._decision: Metered | None = None

    def answer(self, operation: str, arguments: tuple[Any, ...]) -> dict[str, bytes]:
        """Execute a request; the answer to one that raises is a failure."""
        return _parts_or_failure("failure", lambda: getattr(self, f"do_{operation}")(*arguments))

    @property
    def agent(self) -> Agent:
        """The agent that was made."""
        assert self._agent is not None, "`make` comes first"
        return self._agent

    def host(self, agent: Agent) -> dict[str, bytes]:
        """Call this agent from now on, and return its sensors."""
        self._agent, self._explains = agent, explains(agent)
        return self._sensors()

    def do_load(self, name: str, memory_mb: int | None) -> dict[str, bytes]:
        """Import the factory of agents."""
        if memory_mb is not None:
            limit_memory(memory_mb)
        profiling.rename(f"agent {name}")
        self._factory = agent_factory(name)
        return {}

    def do_make(self, decision: str, seed: int, options: Mapping[str, Any]) -> dict[str, bytes]:
        """Make a decision model and a fresh agent with it, in place of earlier ones."""
        assert self._factory is not None, "`load` comes first"
        self._agent = None
        self._decision = Metered(import_callable(decision, "decision model")(seed, **options))
        return self.host(new_agent(self._factory, self._decision))

    def do_begin_task(self, task: Any) -> dict[str, bytes]:  # noqa: ANN401 - `TaskInfo`
        """Begin a task."""
        self.agent.begin_task(task)
        return self._sensors()

    def do_begin_stage(self, goal: Any) -> dict[str, bytes]:  # noqa: ANN401 - `Goal`
        """Begin a stage, and return the agent's object memory at once: it is always asked for then."""
        self._is_first = True
        self.agent.begin_stage(goal)
        return {**self._sensors(), **_parts_or_failure("entries_failure", self.do_entries)}

    def do_act(self, observation: Any, wants_entries: bool) -> dict[str, bytes]:  # noqa: ANN401 - as on the wire
        """Run a decision round, and return the action, the agent's diagnostics, and its object memory if wanted."""
        parts = {"action": wire.write_action(self.agent.act(observation))}
        parts |= _parts_or_failure("diagnostics_failure", self._diagnostics)
        if wants_entries:
            parts |= _parts_or_failure("entries_failure", self.do_entries)
        return parts

    def do_entries(self) -> dict[str, bytes]:
        """Return the object memory, if the agent explains itself."""
        if not self._explains:
            return {}
        return {"entries": self._entries.write(explanation_of(self.agent).entries())}

    def do_costs(self) -> dict[str, bytes]:
        """Return the decision model's costs since it was made, and this process's peak memory."""
        assert self._decision is not None, "`make` comes first"
        costs, peak_mb = self._decision.costs(), peak_memory_mb()
        if peak_mb is not None:
            costs["agent_peak_rss_mb"] = peak_mb
        return {"costs": wire.COSTS.write(costs)}

    def _diagnostics(self) -> dict[str, bytes]:
        if not self._explains:
            return {}
        is_first, self._is_first = self._is_first, False
        return {"diagnostics": wire.DIAGNOSTICS.write(explanation_of(self.agent).diagnostics(is_first=is_first))}

    def _sensors(self) -> dict[str, bytes]:
        return {"sensors": wire.write_sensors(self.agent)}


def _parts_or_failure(failure: str, parts: Callable[[], dict[str, bytes]]) -> dict[str, bytes]:
    """Return the parts that a function returns, or the exception that it raises as a part of the name `failure`."""
    try:
        return parts()
    except DecisionError as error:
        return {failure: _failed("decision", message_of(error), error)}
    except Exception as error:
        return {failure: _failed("agent", describe(error), error)}


def _failed(kind: Literal["agent", "decision"], message: str, error: Exception) -> bytes:
    return wire.FAILURE.write(wire.Failure(kind, message, traceback_of(error)))


def peak_memory_mb(process: int | str = "self") -> float | None:
    """Return the peak of a process's resident memory; `None` where the system does not report it."""
    try:
        status = sandbox.own_status() if process == "self" else Path(f"/proc/{process}/status").read_text()
    except OSError:
        return None
    found = next((line.split()[1] for line in status.splitlines() if line.startswith("VmHWM")), None)
    return None if found is None else int(found) / 1024


def limit_memory(memory_mb: int) -> None:
    """Limit the address space of this process; more raises `MemoryError`."""
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (memory_mb << 20, memory_mb << 20))
