"""Run workers of `evonav.parallel.pool` as processes of this machine."""

import ctypes
import gc
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from evonav.component import import_callable
from evonav.parallel.worker import Message, Worker, WorkerLostError, serve

END_TIMEOUT_S = 5.0
"""Time that a worker has to end cleanly before it is killed."""
THREAD_VARIABLES = ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Environment variables that limit the threads of a process."""
SPARING = {"MALLOC_ARENA_MAX": "1", "MALLOC_MMAP_THRESHOLD_": "1048576", "MALLOC_TRIM_THRESHOLD_": "2097152"}
"""Environment variables by which glibc keeps little free memory, where many jobs share the machine's.

The arrays of a view are smaller than the first limit: the system takes longer to give pages than to fill them.
"""
MAX_FREE_BYTES, MIN_MAPPED_BYTES = 16 << 20, 4 << 20
"""Free memory that a worker keeps, and size from which it gives back what is freed: it runs many jobs in turn."""
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""Names of these limits for glibc."""
_HARMLESS = ("GLIBC_", "LANG", "LC_", "LD_", "MALLOC_", "NPY_", "OMP_", "OPENBLAS_", "PATH", "PYTHON", "RAYON_", "TZ")
"""Beginnings of the names of variables that tell libraries how to start, and hold no secrets."""
PROCESS_NAME = "evonav-worker"
"""Name of a worker's process in `ps` and `top`, on Linux."""


def search_path() -> list[str]:
    """Return this process's `sys.path` in absolute paths."""
    return [str(Path(entry).absolute()) for entry in sys.path]


def num_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class WorkerProgram(NamedTuple):
    """The code that a worker runs."""

    work: str
    """`module:factory`."""
    prelude: str = ""
    """`module:function` that a process on Linux calls before it imports the work, or nothing.

    The process has no threads yet, and nothing of its parent but `sys.path` and harmless variables of the environment.
    If the function returns true, the process ends: it is a fork that has done its part.
    """


class ProcessHost:
    """Starts processes on this machine."""

    def __init__(self, program: WorkerProgram, settings: str, *, has_threads: bool = False) -> None:
        """Remember the program and its settings; no process is started.

        Args:
            has_threads: Run each job on a thread of its own.
        """
        self._program, self._settings, self._has_threads = program, settings, has_threads

    def start(self) -> "WorkerProcess":
        """Start another process, or take the one that was started early."""
        worker = _taken_early(self._program, self._has_threads) or WorkerProcess(self._program, self._has_threads)
        worker.begin(self._settings, self._has_threads)
        return worker

    def wait(self, workers: Sequence[Worker], timeout_s: float) -> Sequence[Worker]:
        """Wait until a worker has a message, and return all that have one."""
        connections = [worker.connection for worker in workers if isinstance(worker, WorkerProcess)]
        ready = wait(connections, timeout_s)
        return [worker for worker in workers if isinstance(worker, WorkerProcess) and worker.connection in ready]

    def close(self) -> None:
        """Do nothing: all processes have ended."""


_START = "import sys; sys.path[:] = sys.argv[5:]; from evonav.parallel.local import main; main(*sys.argv[1:5])"


class WorkerProcess:
    """A process that runs jobs until its parent closes the connection or dies."""

    def __init__(self, program: WorkerProgram, has_threads: bool = False) -> None:
        """Start the process, which imports its work and waits for `begin`.

        Args:
            program: The code that it runs.
            has_threads: It will run many jobs at once, and must spare memory.
        """
        self.connection, far_end = multiprocessing.Pipe()
        self._life: int | None = None
        self._process: subprocess.Popen[bytes] | multiprocessing.process.BaseProcess
        with one_thread_each(), _variables(SPARING if has_threads else {}), far_end:
            if sys.platform == "linux":
                self._process = self._started(program, far_end.fileno())
            else:
                with _without_main():
                    context = multiprocessing.get_context("spawn")
                    self._process = context.Process(target=_serve, args=(far_end, program.work), daemon=True)
                    self._process.start()

    def _started(self, program: WorkerProgram, connection: int) -> "subprocess.Popen[bytes]":
        life, self._life = os.pipe()
        try:
            return subprocess.Popen(  # noqa: S603 - ourselves
                [sys.executable, "-c", _START, str(connection), str(life), *program, *search_path()],
                pass_fds=(connection, life),
                env={name: value for name, value in os.environ.items() if name.startswith(_HARMLESS)},
                stdin=subprocess.DEVNULL,
            )
        finally:
            os.close(life)
            self._tell(dict(os.environ))

    def begin(self, settings: str, has_threads: bool) -> None:
        """Let it make its work; then it is ready for jobs."""
        self._tell([settings, has_threads])

    def _tell(self, content: object) -> None:
        with suppress(ConnectionError):  # `receive` will raise
            self.connection.send_bytes(json.dumps(content).encode())

    def send(self, key: int, text: str) -> None:
        """Send a job."""
        with suppress(ConnectionError):
            self.connection.send_bytes(f"{key} {text}".encode())

    def receive(self) -> Message:
        """Return the next message."""
        try:
            kind, key, text = self.connection.recv_bytes().decode().split(" ", 2)
        except (EOFError, OSError):
            code = _exit_code(self._process, END_TIMEOUT_S)
            how = f"killed by signal {-code}" if code is not None and code < 0 else f"exit code {code}"
            raise WorkerLostError(f"the worker process died ({how})") from None
        return Message(kind, int(key), text)

    def close(self) -> None:
        """End the process at once; safe to call twice."""
        self.connection.close()
        if _exit_code(self._process, 0.0) is None:
            self._process.terminate()
            if _exit_code(self._process, END_TIMEOUT_S) is None:
                self._process.kill()
        _exit_code(self._process, END_TIMEOUT_S)
        if self._life is not None:
            os.close(self._life)
            self._life = None


def _exit_code(
    process: "subprocess.Popen[bytes] | multiprocessing.process.BaseProcess", timeout_s: float
) -> int | None:
    """Return the exit code of a process, negative for a signal; `None` if it has not ended in time."""
    if isinstance(process, subprocess.Popen):
        with suppress(subprocess.TimeoutExpired):
            process.wait(timeout_s)
        return process.returncode
    process.join(timeout_s)
    return process.exitcode


class _Early(NamedTuple):
    worker: WorkerProcess
    program: WorkerProgram
    surroundings: tuple[Mapping[str, str], Sequence[str]]


_early: _Early | None = None


@contextmanager
def started_early(program: WorkerProgram) -> Iterator[None]:
    """Start a process now, for the first `ProcessHost` that needs one while the block runs.

    The process imports its work while this one still imports what decides the settings.
    """
    global _early
    if sys.platform == "linux" and _early is None:
        _early = _Early(WorkerProcess(program), program, _surroundings())
    try:
        yield
    finally:
        if _early is not None:
            _early.worker.close()
        _early = None


def _taken_early(program: WorkerProgram, has_threads: bool) -> WorkerProcess | None:
    """Return the process that was started early, unless a process that starts now would be another one."""
    global _early
    if _early is None or has_threads or (_early.program, _early.surroundings) != (program, _surroundings()):
        return None
    worker, _early = _early.worker, None
    return worker


def _surroundings() -> tuple[Mapping[str, str], Sequence[str]]:
    return dict(os.environ), list(sys.path)


def main(connection: str, life: str, work: str, prelude: str) -> None:
    """Be a worker.

    Args:
        connection: Descriptor of the connection to the parent.
        life: Descriptor of a pipe that is closed when the parent ends, however it ends.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.disable()  # imports leave hardly any garbage, and looking for it takes a tenth of their time
    if prelude and import_callable(prelude)():
        return
    for descriptor in (connection, life):
        os.set_inheritable(int(descriptor), False)
    with suppress(OSError):
        Path("/proc/self/comm").write_text(PROCESS_NAME)
    parent = Connection(int(connection))
    with suppress(EOFError, OSError):  # the parent has ended
        environment = json.loads(parent.recv_bytes())
        os.environ.clear()
        os.environ.update(environment)
        _serve(parent, work, int(life))


def _serve(connection: Connection, work: str, life: int | None = None) -> None:
    """Run the jobs that arrive, until the parent closes the connection."""

    def job() -> tuple[int, str]:
        key, _, text = connection.recv_bytes().decode().partition(" ")
        return int(key), text

    def send(message: Message) -> None:
        connection.send_bytes(f"{message.kind} {message.key} {message.text}".encode())

    end_with_parent(life)
    with suppress(Exception):  # which making the work will raise again
        import_callable(work)
    with suppress(EOFError, OSError):  # the parent has closed the connection
        settings, has_threads = json.loads(connection.recv_bytes())
        if has_threads:
            _raise_open_files()
            _keep_free_memory()
        serve(work, settings, iter(job, None), send, has_threads=has_threads)
    # The process ends now; an exception in what it still does would be printed and nothing else.
    signal.signal(signal.SIGTERM, signal.SIG_IGN)


def _keep_free_memory() -> None:
    """Keep more free memory than the processes that this one starts, unless the user has set how much."""
    if all(os.environ.get(name) == value for name, value in SPARING.items()):
        with suppress(OSError, AttributeError):  # another system, or library
            library = ctypes.CDLL(None)
            library.mallopt(_TRIM_THRESHOLD, MAX_FREE_BYTES)
            library.mallopt(_MMAP_THRESHOLD, MIN_MAPPED_BYTES)


def _raise_open_files() -> None:
    """Allow as many open files as the system does: each job has its own."""
    import resource

    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


@contextmanager
def _without_main() -> Iterator[None]:
    """Hide the running script from a child that is started inside.

    The child would run it again, and a script without `if __name__ == "__main__"` would start its own work again.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


class EndedError(SystemExit):
    """The end of this process, which was asked for by its parent: nothing may take it for an error of an agent."""


def end_with_parent(life: int | None) -> None:
    """Make a child ignore interrupts and end with its parent, running every `finally`.

    Args:
        life: A pipe that is closed when the parent ends; default: the parent is that of `multiprocessing`.
    """

    def end(number: int, _: object) -> None:
        raise EndedError(128 + number)

    def watch() -> None:
        if life is not None:
            os.read(life, 1)
        elif (parent := multiprocessing.parent_process()) is not None:
            parent.join()
        os.kill(os.getpid(), signal.SIGTERM)

    def ended_in_callback(found: "sys.UnraisableHookArgs") -> None:
        if not isinstance(found.exc_value, EndedError):
            sys.__unraisablehook__(found)
            return
        # Python drops what a callback of its collector raises: ask again when that is over.
        again = threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGTERM))
        again.daemon = True
        again.start()

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, end)
    sys.unraisablehook = ended_in_callback
    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Give children that are started inside one thread each: the parallelism is over jobs."""
    with _variables(dict.fromkeys(THREAD_VARIABLES, "1")):
        yield


@contextmanager
def _variables(values: Mapping[str, str]) -> Iterator[None]:
    """Give children that are started inside environment variables, unless the user has set them."""
    added = [name for name in values if name not in os.environ]
    os.environ.update({name: values[name] for name in added})
    try:
        yield
    finally:
        for name in added:
            del os.environ[name]
