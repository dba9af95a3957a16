"""Run agents in processes of their own, where they cannot reach oracle data or harm the evaluator.

A process runs agents of one name, with a new object for each episode (`evonav.agents.hosting.serving` is its side). It
receives pickled observations, with their arrays in one block of shared memory, and answers in JSON
(`evonav.agents.hosting.wire`). Nothing that an agent sends is unpickled, and every answer is checked. The process
inherits only three descriptors and its output, receives no path but those of its decision model's files, and leads a
process group, so that processes that an agent has started end with it.

Unless it is in a sandbox (`evonav.agents.hosting.sandbox`), an agent can read every file that this user can read.
"""

import json
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict
from pathlib import Path

from evonav.agents.hosting import forking, wire
from evonav.agents.hosting.error_text import clean
from evonav.agents.hosting.requests import write_request
from evonav.agents.hosting.serving import LENGTH, peak_memory_mb
from evonav.errors import EvonavError, InvalidArgumentError
from evonav.evaluation.hosting.channel import OutputLog, SharedBlock
from evonav.evaluation.hosting.fork_server import ForkedProcess, ForkServer
from evonav.evaluation.hosting.isolation import (
    NO_SETUP,
    AgentHosting,
    ProcessSetup,
    environment,
    new_scratch,
    policy_of,
    with_absolute_file,
)
from evonav.evaluation.hosting.model_relay import ModelRelay
from evonav.evaluation.records.schema import ErrorKind
from evonav.parallel.local import one_thread_each, search_path
from evonav.parallel.one_core import OneCore

LOG_NAME = "agents.log"
"""File in a run's folder with all output of agents."""
LOAD_TIMEOUT_S = 300.0
"""Shortest limit for importing an agent's module."""
MAX_ANSWER_BYTES = 2 * wire.MAX_ENTRIES_BYTES
_STDERR = 2
_PART_BYTES = 1 << 18
_LONGEST_WAIT_S = 3600.0
_POLL_S = 0.05
"""Time between two checks that a process lives, on systems that cannot notify."""
_START = "import sys; sys.path[:] = sys.argv[4:]; {}from {} import main; main(*map(int, sys.argv[1:4]))"
_SANDBOX_ADVICE = (
    "; an agent in a sandbox reads what can be imported, its own folder and folders of models (EVONAV_MODELS), and "
    "has no network: `--isolation process` runs it without a sandbox"
)
_SHUT_IN = "from evonav.agents.hosting.sandbox import begin; begin(int(sys.argv[1])); "


class AgentFailedError(EvonavError):
    """An agent in its own process has failed: it raised an exception, died, or did not answer in time."""

    def __init__(self, kind: ErrorKind, message: str, traceback: str = "") -> None:
        """Create an error of one of the agent's own kinds (`ErrorKind.is_agents`)."""
        super().__init__(message)
        self.kind = kind
        self.traceback = traceback


class AgentProcess:
    """A process with an agent in it."""

    noun = "agent"
    """Word for its content in messages."""
    serving = "evonav.agents.hosting.serving"
    """The module whose `main` is its side."""
    max_answer_bytes = MAX_ANSWER_BYTES
    """Largest answer."""

    def __init__(
        self,
        name: str,
        hosting: AgentHosting,
        setup: ProcessSetup = NO_SETUP,
        fork_server: ForkServer | None = None,
    ) -> None:
        """Start the process and import the agent's module in it.

        Args:
            fork_server: Server that forks the process; default: a fresh one is started.

        Raises:
            AgentFailedError: The module cannot be imported in time, or the process died.
        """
        self.name = name
        self._own_cpu_s = 0.0
        self._hosting = hosting
        self._setup = setup
        self._closing = threading.RLock()
        self._ends = ExitStack()
        self._block = SharedBlock(saves_memory=setup.is_one_of_many)
        self._ends.callback(self._block.close)
        self._scratch = new_scratch(setup.scratch) if hosting.isolation == "sandbox" else None
        if self._scratch is not None:
            self._ends.callback(shutil.rmtree, self._scratch, ignore_errors=True)
        self.relay = ModelRelay() if setup.relays_model else None
        """Asks the decision model for the process."""
        if self.relay is not None:
            self._ends.callback(self.relay.close)
        self._connection, far_end = socket.socketpair()
        life, own_end = os.pipe()
        output = None if setup.log is None else OutputLog(Path(setup.log), name)
        self._log = output
        if output is not None:
            self._ends.callback(output.end)
        self._ends.callback(os.close, own_end)
        try:
            arguments = (far_end.fileno(), life, self._block.descriptor)
            inherited = arguments if self.relay is None else (*arguments, self.relay.far_descriptor)
            stderr = _STDERR if output is None else output.descriptor
            path = sys.path if self._scratch is None else search_path()
            with one_thread_each():
                self._process = self._started(fork_server, inherited, stderr, path)
        except OSError as error:
            self._connection.close()
            self._ends.close()
            raise AgentFailedError(ErrorKind.CRASH, f"the {self.noun}'s process does not start: {error}") from None
        finally:
            far_end.close()
            os.close(life)
            if self.relay is not None:
                self.relay.close_far_end()
            if output is not None:
                output.begin()
        if isinstance(self._process, ForkedProcess):
            self._ends.callback(self._process.close)
        self._watch = os.pidfd_open(self._process.pid) if hasattr(os, "pidfd_open") else None
        if self._watch is not None:
            self._ends.callback(os.close, self._watch)
        self._is_group_ended = False
        self._poll = select.poll()
        for descriptor in (self._connection.fileno(), self._watch):
            if descriptor is not None:
                self._poll.register(descriptor, select.POLLIN)
        self._one_core = OneCore()
        self._num_asked = 0
        self._request = ("", 0.0, 0.0)
        """The request that was sent last: its operation, its time limit, and when that has passed."""
        self._is_waiting = False
        try:
            if self._scratch is not None:
                name = with_absolute_file(name)
                policy = policy_of(name, self._scratch, setup.hidden, hosting.memory_mb)
                with suppress(OSError):  # a process that has ended already: the next request says so
                    self._write(json.dumps(asdict(policy)).encode())
            self.ask("load", name, hosting.memory_mb, timeout_s=max(hosting.timeout_s, LOAD_TIMEOUT_S))
        except BaseException:
            self.close(is_at_once=True)
            raise

    def _started(
        self, fork_server: ForkServer | None, inherited: Sequence[int], stderr: int, path: Sequence[str]
    ) -> "subprocess.Popen[bytes] | ForkedProcess":
        """Start the process.

        Args:
            inherited: Its descriptors: of requests, life, memory, and of the model if it has one.
        """
        own_environment = None if self._scratch is None else environment(self._scratch)
        if fork_server is not None:
            if self.relay is not None:
                self.relay.agents_descriptor = forking.RELAY
            return fork_server.fork(
                (stderr, stderr, *inherited),
                agent=self.name,
                folder=self._scratch,
                environment=dict(os.environ) if own_environment is None else own_environment,
                path=path,
                is_sandboxed=self._scratch is not None,
            )
        start = _START.format("" if self._scratch is None else _SHUT_IN, self.serving)
        return subprocess.Popen(  # noqa: S603 - ourselves
            [sys.executable, "-c", start, *map(str, inherited[:3]), *path],
            pass_fds=inherited,
            cwd=self._scratch,
            env=own_environment,
            stdin=subprocess.DEVNULL,
            stdout=stderr,
            stderr=stderr,
            start_new_session=True,
        )

    @property
    def is_usable(self) -> bool:
        """True if the process is alive and waits for a request."""
        is_relaying = self.relay is None or self.relay.is_open
        return is_relaying and not self._is_waiting and self._process.poll() is None

    @property
    def cpu_s(self) -> float:
        """CPU time that the process reports, and that of asking the model for it."""
        return self._own_cpu_s + (0.0 if self.relay is None else self.relay.cpu_s)

    @property
    def memory_mb(self) -> float | None:
        """Peak resident memory; `None` if the process has ended or the system does not report it."""
        return peak_memory_mb(self._process.pid)

    def describe(self, label: str) -> None:
        """Set the label of the agent's output in the log."""
        if self._log is not None:
            self._log.begin_part(label)

    def ask(self, operation: str, *arguments: object, timeout_s: float | None = None) -> dict[str, bytes]:
        """Send a request, and return the parts of its answer, each as JSON.

        Raises:
            AgentFailedError: The agent raised (`agent`, `decision`), or it died or hung (`crash`, `timeout`) and its
                process was ended.
        """
        self.send(operation, *arguments, timeout_s=timeout_s)
        return self.answer()

    def send(self, operation: str, *arguments: object, timeout_s: float | None = None) -> None:
        """Send a request; `answer` waits for its answer.

        Raises:
            AgentFailedError: The agent died or hung (`crash`, `timeout`), and its process was ended.
        """
        timeout_s = timeout_s or self._hosting.timeout_s
        self._request = (operation, timeout_s, time.monotonic() + timeout_s)
        self._is_waiting = True
        self._num_asked += 1
        try:
            request = write_request(self._num_asked, operation, arguments, self._block.write)
            self._connection.settimeout(max(1e-3, self._request[2] - time.monotonic()))
            if self._num_asked > 1 and not self._setup.is_one_of_many:  # it waits, it does not start
                self._one_core.stay(self._process.pid)
            self._write(request)
        except OSError as error:
            raise self._lost(error) from None

    def answer(self) -> dict[str, bytes]:
        """Return the parts of the answer to the request that was sent; see `ask`."""
        try:
            head, parts = wire.read_answer(self._message(self._request[2]), self._num_asked)
        except (OSError, InvalidArgumentError) as error:
            raise self._lost(error) from None
        finally:
            self._one_core.release()
        self._is_waiting = False
        self._own_cpu_s, self._block.free = head.cpu_s, head.free_slot
        if (failure := parts.get("failure")) is not None:
            raise failure_of(failure, is_sandboxed=self._scratch is not None)
        return parts

    def _lost(self, error: OSError | InvalidArgumentError) -> AgentFailedError:
        """End the process, which did not answer in time or as it should, and return what happened."""
        operation, timeout_s, _ = self._request
        if isinstance(error, TimeoutError):
            self.close(is_at_once=True)
            return AgentFailedError(ErrorKind.TIMEOUT, f"no answer to `{operation}` within {timeout_s:g} s")
        died = self._cause_of_death() if isinstance(error, OSError) else None
        self.close(is_at_once=True)
        return AgentFailedError(ErrorKind.CRASH, died or f"malformed response: {clean(str(error))}")

    def _write(self, message: bytes) -> None:
        self._connection.sendall(LENGTH.pack(len(message)) + message)

    def _message(self, deadline_s: float) -> bytes:
        """Read one message, with nothing after it."""
        data, size = bytearray(), LENGTH.size
        while len(data) < size:
            self._wait(deadline_s)
            part = self._connection.recv(_PART_BYTES)
            if not part:
                raise ConnectionResetError("closed")
            data += part
            if size == LENGTH.size <= len(data):
                size += LENGTH.unpack_from(data)[0]
                if size > self.max_answer_bytes:
                    raise InvalidArgumentError(f"{size} bytes: must be at most {self.max_answer_bytes}")
        if len(data) > size:
            raise InvalidArgumentError("more than one answer")
        return bytes(data[LENGTH.size :])

    def _wait(self, deadline_s: float) -> None:
        """Wait for something to read, but not for output of a dead agent's children."""
        while True:
            left_s = deadline_s - time.monotonic()
            if left_s <= 0.0:
                raise TimeoutError
            limit_s = left_s if self._watch is not None else min(left_s, _POLL_S)
            ready = {descriptor for descriptor, _ in self._poll.poll(1000.0 * min(limit_s, _LONGEST_WAIT_S))}
            if self._connection.fileno() in ready:
                return
            if ready or (self._watch is None and self._process.poll() is not None):
                raise ConnectionResetError("died")

    def _cause_of_death(self) -> str:
        try:
            code = self._process.wait(timeout=2.0)
        except subprocess.TimeoutExpired:
            return f"the {self.noun}'s process hung up"
        how = f"killed by signal {-code}" if code < 0 else f"exit code {code}"
        return f"the {self.noun}'s process died ({how})"

    def close(self, *, is_at_once: bool = False) -> None:
        """End the process and all that it has started; safe to call twice, and after a call that was cut short.

        Args:
            is_at_once: Do not wait for the process to end by itself.
        """
        self._one_core.release()
        with self._closing:  # a worker that ends closes what an episode on a thread may be closing
            self._connection.close()
            try:
                if not is_at_once and not self._is_waiting:
                    with suppress(subprocess.TimeoutExpired):
                        self._process.wait(timeout=2.0)
            finally:  # also in a worker that is asked to end meanwhile
                self._end_group()
                self._ends.close()

    def _end_group(self) -> None:
        """End the processes that it started, too; a signal may cut this short, and then it is called again."""
        if self._is_group_ended:
            return
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._is_group_ended = True


def check_importable(
    name: str,
    hosting: AgentHosting,
    setup: ProcessSetup = NO_SETUP,
    fork_server: ForkServer | None = None,
) -> None:
    """Check that an agent can be imported, in a process of its own, which then ends.

    Args:
        fork_server: See `AgentProcess`.

    Raises:
        InvalidArgumentError: The agent cannot be imported.
    """
    try:
        AgentProcess(name, hosting, setup, fork_server).close()
    except AgentFailedError as error:
        text, advice, _ = str(error).partition(_SANDBOX_ADVICE)
        message = text.removeprefix("InvalidArgumentError: ").partition(" [")[0] + advice
        raise InvalidArgumentError(message) from None


def failure_of(text: bytes, *, is_sandboxed: bool = False) -> AgentFailedError:
    """Return the failure that an agent's process reports as a `wire.FAILURE`."""
    failure = wire.FAILURE.read(text)
    was_refused = is_sandboxed and "PermissionError" in f"{failure.message}{failure.traceback}"
    advice = _SANDBOX_ADVICE if was_refused else ""
    return AgentFailedError(ErrorKind(failure.kind), failure.message + advice, failure.traceback)
