"""Start agents' processes as forks of one that has imported everything (`evonav.agents.hosting.forking`)."""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from evonav.agents.hosting import forking
from evonav.agents.hosting.forking import STATE
from evonav.parallel.local import one_thread_each

IS_SUPPORTED = sys.platform == "linux" and hasattr(os, "pidfd_open")
"""True where a process without threads can be forked safely, and its end be waited for."""
START_TIMEOUT_S = 300.0
"""Longest time until a fork is there; the first one waits for the imports."""
_START = (
    "import sys; sys.path[:] = sys.argv[2:]; from evonav.agents.hosting.forking import main; main(int(sys.argv[1]))"
)


class AgentsOwn(Protocol):
    """A process as `AgentProcess` holds it: a child of this one, or a fork of the server."""

    pid: int

    def poll(self) -> int | None:
        """Return the exit code, negative for a signal; `None` while the process runs."""

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the exit code."""


class ForkedProcess:
    """A fork of the server, which has the methods of `subprocess.Popen` that are needed."""

    def __init__(self, state: socket.socket) -> None:
        """Wait until it is there.

        Args:
            state: The socket on which it, and then its parent, say its state.

        Raises:
            ConnectionError: The server has ended.
            TimeoutError: It took too long.
        """
        self._state = state
        self._code: int | None = None
        state.settimeout(START_TIMEOUT_S)
        has_ended, self.pid = self._next_state()
        if has_ended:
            raise ConnectionResetError(f"exit code {self.pid}")

    def _next_state(self) -> tuple[bool, int]:
        data = self._state.recv(STATE.size)
        if not data:
            raise ConnectionResetError("closed")
        has_ended, value = STATE.unpack(data)
        return bool(has_ended), int(value)

    def poll(self) -> int | None:
        """Return the exit code, negative for a signal; `None` while the process runs."""
        with suppress(subprocess.TimeoutExpired):
            self.wait(0.0)
        return self._code

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the exit code; `subprocess.TimeoutExpired` if the process still runs."""
        if self._code is None:
            if not select.select([self._state], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired("agent", timeout or 0.0)
            try:
                _, self._code = self._next_state()
            except OSError:  # the server was killed, and its forks with it
                self._code = -9
        return self._code

    def close(self) -> None:
        """Let its parent reap it, and end what is left of its group; then its number may become another process's."""
        self._state.close()


class _OwnFork:
    """A fork of this process, which has the methods of `subprocess.Popen` that are needed."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self._code: int | None = None

    def poll(self) -> int | None:
        if self._code is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self._code = os.waitstatus_to_exitcode(status) if pid else None
        return self._code

    def wait(self, timeout: float | None = None) -> int:
        if self._code is None:
            end = os.pidfd_open(self.pid)
            try:
                has_ended = select.select([end], [], [], timeout)[0]
            finally:
                os.close(end)
            if not has_ended:
                raise subprocess.TimeoutExpired("fork server", timeout or 0.0)
        code = self.poll()
        assert code is not None  # it has ended
        return code

    def kill(self) -> None:
        if self.poll() is None:
            os.kill(self.pid, signal.SIGKILL)


class ForkServer:
    """Forks processes for the agents of a worker. Any number of threads may use it."""

    def __init__(self, environment: Mapping[str, str] | None, path: Sequence[str]) -> None:
        """Start nothing yet.

        Args:
            environment: Environment of the server; default: this process's. Forks can find it in their memory.
        """
        self._environment = environment
        self._path = path
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | _OwnFork | None = None
        self._control: socket.socket | None = None

    def fork(
        self,
        descriptors: Sequence[int],
        *,
        agent: str,
        folder: Path | None,
        environment: Mapping[str, str],
        path: Sequence[str],
        is_sandboxed: bool,
    ) -> ForkedProcess:
        """Start a process.

        Args:
            descriptors: Its standard output and error, then those that `forking` numbers.
            agent: Name of its agent: the server imports built-in ones.
            folder: Its working folder; default: this process's.
            is_sandboxed: True if it shuts itself in before it does anything else.

        Raises:
            OSError: It does not start.
        """
        request = {
            "agent": agent,
            "folder": None if folder is None else str(folder),
            "environment": dict(environment),
            "path": list(path),
            "is_sandboxed": is_sandboxed,
        }
        near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            with far:
                self._send(json.dumps(request).encode(), (far.fileno(), *descriptors))
            return ForkedProcess(near)
        except BaseException:
            near.close()
            raise

    def _send(self, request: bytes, descriptors: Sequence[int]) -> None:
        with self._lock:
            if self._process is not None and self._process.poll() is not None:
                self._end()
            if self._control is None:
                self._start()
            assert self._control is not None
            socket.send_fds(self._control, [request], descriptors)

    def _start(self) -> None:
        if (beside := forking.take_beside()) is not None:
            self._process, self._control = _OwnFork(beside.pid), beside.control
            return
        near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with far, one_thread_each():
            self._process = subprocess.Popen(  # noqa: S603 - ourselves
                [sys.executable, "-c", _START, str(far.fileno()), *self._path],
                pass_fds=[far.fileno()],
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=sys.__stderr__,
                start_new_session=True,
            )
        self._control = near

    def close(self) -> None:
        """End the server and all forks; safe to call twice."""
        with self._lock:
            self._end()

    def _end(self) -> None:
        if self._control is not None:
            self._control.close()
        if self._process is not None:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(timeout=2.0)
            self._process.kill()
            self._process.wait()
        self._control = self._process = None
