"""Lend the agents' processes of a worker to its episodes, and start them as forks where the system can."""

import sys
import tempfile
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from evonav.evaluation.hosting import fork_server
from evonav.evaluation.hosting.fork_server import ForkServer
from evonav.evaluation.hosting.isolation import NO_SETUP, AgentHosting, ProcessSetup, environment
from evonav.evaluation.hosting.process import AgentProcess
from evonav.parallel.local import one_thread_each, search_path

MAX_PROCESSES = 8
"""Largest number of processes that a worker keeps; the one that was idle for longest is ended."""


class AgentProcesses:
    """The agents' processes of a worker, each lent to one episode at a time. Any number of threads may use it."""

    def __init__(
        self,
        hosting: AgentHosting,
        setup: ProcessSetup = NO_SETUP,
        waiting: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        """Remember the settings; processes start when they are needed.

        Args:
            waiting: Lets other episodes compute while the block waits for a process.
        """
        self.hosting = hosting
        self._setup = setup
        self.waiting = waiting
        self._fork_server = new_fork_server(hosting, setup)
        self._lock = threading.Lock()
        self._idle: list[AgentProcess] = []
        """Those that were used last come last."""
        self._lent: list[AgentProcess] = []

    def lend(self, name: str) -> AgentProcess:
        """Return a process that waits for requests, until `take_back`; start one if none is idle.

        Raises:
            AgentFailedError: The process does not start.
        """
        with self._lock:
            found = next((process for process in reversed(self._idle) if process.name == name), None)
            if found is not None and found.is_usable:
                self._idle.remove(found)
                self._lent.append(found)
                return found
            ended = [process for process in self._idle if not process.is_usable]
            num_over = len(self._idle) + len(self._lent) - len(ended) - MAX_PROCESSES + 1
            usable = [process for process in self._idle if process not in ended]
            ended += usable[: max(0, num_over)]
            self._idle = [process for process in self._idle if process not in ended]
        for process in ended:
            process.close()
        process = AgentProcess(name, self.hosting, self._setup, self._fork_server)
        with self._lock:
            self._lent.append(process)
        return process

    def take_back(self, process: AgentProcess) -> None:
        """Keep a process for another episode, or end it if it cannot be used any more."""
        with self._lock:
            self._lent.remove(process)
            if is_usable := process.is_usable:
                self._idle.append(process)
        if not is_usable:
            process.close(is_at_once=True)

    def close(self) -> None:
        """End all processes; safe to call twice."""
        if self._fork_server is not None and self._lent:  # at once, also those that answer
            self._fork_server.close()
        for process in (*self._idle, *self._lent):
            process.close()
        self._idle.clear()
        if self._fork_server is not None:
            self._fork_server.close()


def new_fork_server(hosting: AgentHosting, setup: ProcessSetup) -> ForkServer | None:
    """Return what forks processes; what they inherit of it holds nothing that an agent in a sandbox must not have."""
    if not fork_server.IS_SUPPORTED:
        return None
    if hosting.isolation != "sandbox":
        return ForkServer(None, sys.path)
    with one_thread_each():
        return ForkServer(environment(Path(setup.scratch or tempfile.gettempdir())), search_path())
