"""Change AI2-THOR's client so that it notices the end of its process at once and leaves nothing behind.

The published client waits for its whole timeout (100 s) at the end of a pipe. It blocks for ever on opening a pipe that
no other process opens. It removes its folder of pipes only when the interpreter ends. This module imports `ai2thor`:
import it only where that package is installed.
"""

import os
import select
import signal
import struct
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

from ai2thor.controller import Controller
from ai2thor.fifo_server import FifoServer

from evonav.world.ai2thor import guard
from evonav.world.ai2thor.guard import ProcessEndedError

_POLL_S = 0.1
"""Time between two checks that the process is alive."""
_EXIT_S = 5.0
"""Time within which a killed process must have ended."""
_PIPE_BYTES = 1 << 20
_F_SETPIPE_SZ = 1031  # linux/fcntl.h


class PromptFifoServer(FifoServer):  # type: ignore[misc]
    """The client's FIFO server; raises `ProcessEndedError` within a tenth of a second after its process ended."""

    server_pipe: Any = None
    client_pipe: Any = None

    def receive(self, timeout: float | None = None) -> Any:  # noqa: ANN401 - the client's event
        """Return the next event.

        Raises:
            ProcessEndedError: The process ended.
            TimeoutError: No event came in time.
        """
        if self.server_pipe is None:
            # Opened in this mode, reading waits for the other side, but opening does not.
            descriptor = os.open(self.server_pipe_path, os.O_RDONLY | os.O_NONBLOCK)
            self.server_pipe = os.fdopen(descriptor, "rb", buffering=0)
            _widen(descriptor)
        try:
            return super().receive(timeout)
        except (ValueError, KeyError, struct.error) as error:  # evonav's engine ends with an empty message
            self._raise_ended(f"broke the protocol: {error}")

    def stop(self) -> None:
        """End the process and remove the pipes; safe to call twice."""
        if self.unity_proc is not None and self.unity_proc.poll() is None:
            with suppress(OSError):
                os.killpg(self.unity_proc.pid, signal.SIGKILL)
        super().stop()
        if self.unity_proc is not None:
            self.unity_proc.wait(timeout=_EXIT_S)
        self.tmp_dir.cleanup()

    def _read_with_timeout(self, server_pipe: Any, message_size: int, timeout: float | None) -> bytes:  # noqa: ANN401
        deadline_s = _deadline_s(timeout)
        message = bytearray()
        descriptor = server_pipe.fileno()
        poll = select.poll()
        poll.register(descriptor, select.POLLIN)
        while len(message) < message_size:
            has_ended = self.unity_proc.poll() is not None  # checked before reading what it wrote last
            if poll.poll(0 if has_ended else _POLL_S * 1e3):
                part = os.read(descriptor, message_size - len(message))
                if not part:
                    self._raise_ended()
                message += part
            elif has_ended:
                self._raise_ended()
            elif time.monotonic() > deadline_s:
                raise TimeoutError(f"no answer for {timeout:g} s")
        return bytes(message)

    def _send_message(self, message_type: Any, body: bytes) -> None:  # noqa: ANN401
        deadline_s = _deadline_s(self.timeout)
        if self.client_pipe is None:
            self.client_pipe = os.fdopen(self._opened_by_both(deadline_s), "wb", buffering=0)
        descriptor = self.client_pipe.fileno()
        rest = memoryview(self._create_header(message_type, body) + body + self.eom_header)
        poll = select.poll()
        poll.register(descriptor, select.POLLOUT)
        while rest:
            if poll.poll(_POLL_S * 1e3):
                try:
                    rest = rest[os.write(descriptor, rest) :]
                except BrokenPipeError:
                    self._raise_ended()
            self._check(deadline_s)

    def _opened_by_both(self, deadline_s: float) -> int:
        """Open the pipe to the process once the process reads from it; return its descriptor."""
        while True:
            try:
                descriptor = os.open(self.client_pipe_path, os.O_WRONLY | os.O_NONBLOCK)
            except OSError:  # ENXIO: no process reads yet
                self._check(deadline_s)
                time.sleep(0.005)
            else:
                _widen(descriptor)
                return descriptor

    def _check(self, deadline_s: float) -> None:
        if self.unity_proc.poll() is not None:
            self._raise_ended()
        if time.monotonic() > deadline_s:
            raise TimeoutError(f"does not read what it is sent, for {self.timeout:g} s")

    def _raise_ended(self, otherwise: str | None = None) -> NoReturn:
        with suppress(subprocess.TimeoutExpired):
            self.unity_proc.wait(timeout=1.0)  # the pipe closes a moment before the process ends
        if self.unity_proc.returncode is None and otherwise is not None:
            raise ProcessEndedError(otherwise)
        raise ProcessEndedError.of(self.unity_proc.returncode)


class GuardedController(Controller):  # type: ignore[misc]
    """The client's controller over `PromptFifoServer`; its process ends with this one.

    If starting raises anything, the process has ended by then.
    """

    def __init__(self, *, log_dir: Path, uses_gpu: bool, **settings: Any) -> None:  # noqa: ANN401
        """Start the process and load the scene.

        Args:
            log_dir: Folder of the process's output, `unity.log`.
            uses_gpu: Whether the process renders on a GPU; otherwise CUDA_VISIBLE_DEVICES is ignored.
            settings: Settings of the client's own.
        """
        self._own_log_dir = str(log_dir)
        self._uses_gpu = uses_gpu
        self.server: PromptFifoServer | None = None
        self._build = None
        try:
            super().__init__(**settings)
        except BaseException:
            self.stop()
            raise

    @property
    def log_dir(self) -> str:
        """Folder of the process's output."""
        return self._own_log_dir

    def start(self, *args: Any, **settings: Any) -> Any:  # noqa: ANN401
        """Start the process and wait for its first event."""
        if self.server is None:  # the client only makes servers of its own classes
            self.server = PromptFifoServer(
                width=self.width,
                height=self.height,
                timeout=self.server_timeout,
                depth_format=self.depth_format,
                add_depth_noise=self.add_depth_noise,
            )
        return super().start(*args, **settings)

    def unity_command(self, width: int, height: int, headless: bool) -> list[str]:
        """Return the command line, which starts `guard`."""
        if not self._uses_gpu:
            self.gpu_device = None
        is_bound = threading.current_thread() is threading.main_thread()  # other threads may end before evonav
        guarded = [sys.executable, "-S", "-E", guard.__file__, str(os.getpid()), "1" if is_bound else "0"]
        return [*guarded, *super().unity_command(width, height, headless)]

    def stop(self) -> None:
        """End the process and remove its pipes; safe to call twice."""
        if self.server is not None:
            self.server.stop()
            self.server.last_event = None
        with suppress(AttributeError):  # a controller that failed before it had a build has nothing to unlock
            super().stop()
        self.last_event = None  # the client's exit hook refers to this object as long as Python runs


def _deadline_s(timeout_s: float | None) -> float:
    return float("inf") if timeout_s is None else time.monotonic() + timeout_s


def _widen(descriptor: int) -> None:
    """Enlarge a pipe to hold a whole answer, which saves turns between the processes."""
    with suppress(OSError, ImportError):
        import fcntl

        fcntl.fcntl(descriptor, _F_SETPIPE_SZ, _PIPE_BYTES)
