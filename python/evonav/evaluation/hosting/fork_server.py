"""Start agents' processes as forks of one that has imported everything (`evonav.agents.hosting.forking`)."""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

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
            if not _is_ready(self._state, timeout):
                raise subprocess.TimeoutExpired("agent", timeout or 0.0)
            try:
                _, self._code = self._next_state()
            except OSError:  # the server was killed, and its forks with it
                self._code = -9
        return self._code

    def close(self) -> None:
        """Let its parent reap it, and end what is left of its group; then its number may become another process's."""
        self._state.close()


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
        self._control: socket.socket | None = None
        """Connection to the server; `None` while there is none, and then the fields below have no meaning."""
        self._pid = 0
        self._watch = -1
        """Descriptor by which its end can be waited for."""
        self._reap: Callable[[], object] = lambda: None

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
            if self._control is not None and _is_ready(self._watch, 0.0):
                self._end()
            if self._control is None:
                self._start()
            assert self._control is not None
            socket.send_fds(self._control, [request], descriptors)

    def _start(self) -> None:
        if (beside := forking.take_beside()) is not None:
            self._pid, self._control = beside
            self._reap = partial(os.waitpid, self._pid, 0)
        else:
            process, self._control = self._started()
            self._pid, self._reap = process.pid, process.wait
        self._watch = os.pidfd_open(self._pid)

    def _started(self) -> tuple["subprocess.Popen[bytes]", socket.socket]:
        near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with far, one_thread_each():
            process = subprocess.Popen(  # noqa: S603 - ourselves
                [sys.executable, "-c", _START, str(far.fileno()), *self._path],
                pass_fds=[far.fileno()],
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=sys.__stderr__,
                start_new_session=True,
            )
        return process, near

    def close(self) -> None:
        """End the server and all forks; safe to call twice."""
        with self._lock:
            self._end()

    def _end(self) -> None:
        if self._control is None:
            return
        self._control.close()
        if not _is_ready(self._watch, 2.0):
            os.kill(self._pid, signal.SIGKILL)
        os.close(self._watch)
        self._reap()
        self._control = None


def _is_ready(descriptor: int | socket.socket, timeout_s: float | None) -> bool:
    """Wait until a descriptor can be read; return false if it cannot after some time, or never without a limit."""
    poll = select.poll()
    poll.register(descriptor, select.POLLIN)
    return bool(poll.poll(None if timeout_s is None else 1000.0 * timeout_s))
