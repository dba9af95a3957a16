"""Run workers of `evonav.parallel.pool` as processes of this machine."""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from pathlib import Path
from types import ModuleType

from evonav.parallel.work import serve
from evonav.parallel.worker import Message, Worker, WorkerLostError

END_TIMEOUT_S = 5.0
"""Time that a worker has to end cleanly before it is killed."""
THREAD_VARIABLES = ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Environment variables that limit the threads of a process."""
SPARING = {"MALLOC_ARENA_MAX": "1", "MALLOC_MMAP_THRESHOLD_": "262144", "MALLOC_TRIM_THRESHOLD_": "1048576"}
"""Environment variables by which glibc gives memory back at once, where many jobs share the machine's memory."""
PROCESS_NAME = "evonav-worker"
"""Name of a worker's process in `ps` and `top`, on Linux."""


def num_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class ProcessHost:
    """Starts processes on this machine."""

    def __init__(self, work: str, settings: str, *, has_threads: bool = False) -> None:
        """Remember the work and its settings; no process is started.

        Args:
            work: `module:factory`.
            settings: Text with which the factory is called.
            has_threads: Run each job on a thread of its own.
        """
        self._arguments = (work, settings, has_threads)

    def start(self) -> "WorkerProcess":
        """Start another process."""
        return WorkerProcess(*self._arguments)

    def wait(self, workers: Sequence[Worker], timeout_s: float) -> Sequence[Worker]:
        """Wait until a worker has a message, and return all that have one."""
        connections = [worker.connection for worker in workers if isinstance(worker, WorkerProcess)]
        ready = wait(connections, timeout_s)
        return [worker for worker in workers if isinstance(worker, WorkerProcess) and worker.connection in ready]

    def close(self) -> None:
        """Do nothing: all processes have ended."""


class WorkerProcess:
    """A process that runs jobs until its parent closes the connection or dies."""

    def __init__(self, work: str, settings: str, has_threads: bool) -> None:
        """Start the process with the arguments of `ProcessHost`."""
        context = multiprocessing.get_context("spawn")
        self.connection, far_end = context.Pipe()
        with one_thread_each(), _variables(SPARING if has_threads else {}), _without_main():
            self._process = context.Process(target=_serve, args=(far_end, work, settings, has_threads), daemon=True)
            self._process.start()
        far_end.close()

    def send(self, key: int, text: str) -> None:
        """Send a job."""
        with suppress(BrokenPipeError):
            self.connection.send_bytes(f"{key} {text}".encode())

    def receive(self) -> Message:
        """Return the next message."""
        try:
            kind, key, text = self.connection.recv_bytes().decode().split(" ", 2)
        except (EOFError, OSError):
            raise WorkerLostError(f"the worker process died ({cause_of_death(self._process)})") from None
        return Message(kind, int(key), text)

    def close(self) -> None:
        """End the process at once."""
        end_process(self._process, self.connection)


def _serve(connection: Connection, name: str, settings: str, has_threads: bool) -> None:
    """Run the jobs that arrive, until the parent closes the connection."""

    def job() -> tuple[int, str]:
        key, _, text = connection.recv_bytes().decode().partition(" ")
        return int(key), text

    def send(message: Message) -> None:
        connection.send_bytes(f"{message.kind} {message.key} {message.text}".encode())

    with suppress(OSError):
        Path("/proc/self/comm").write_text(PROCESS_NAME)
    end_with_parent()
    if has_threads:
        _raise_open_files()
    with suppress(EOFError, OSError):  # the parent closed the connection
        serve(name, settings, iter(job, None), send, has_threads=has_threads)


def _raise_open_files() -> None:
    """Allow as many open files as the system does: each job has its own."""
    import resource

    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


@contextmanager
def _without_main() -> Iterator[None]:
    """Hide the running script from a child that is started inside.

    The child would run it again, and a script without `if __name__ == "__main__"` would start its own work anew.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


class EndedError(SystemExit):
    """The end of this process, which was asked for by its parent: nothing may take it for an error of an agent."""


def end_with_parent() -> None:
    """Make a child ignore interrupts and end with its parent, running every `finally`."""

    def end(number: int, _: object) -> None:
        raise EndedError(128 + number)

    def watch() -> None:
        parent = multiprocessing.parent_process()
        if parent is not None:
            parent.join()
            os.kill(os.getpid(), signal.SIGTERM)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, end)
    threading.Thread(target=watch, daemon=True).start()


def cause_of_death(process: multiprocessing.process.BaseProcess) -> str:
    """Return how a process ended: its signal or its exit code."""
    process.join(timeout=5.0)
    code = process.exitcode
    return f"killed by signal {-code}" if code is not None and code < 0 else f"exit code {code}"


def end_process(process: multiprocessing.process.BaseProcess, connection: Connection) -> None:
    """Close the connection to a child and end it; safe to call twice."""
    connection.close()
    if process.is_alive():
        process.terminate()
        process.join(timeout=END_TIMEOUT_S)
        if process.is_alive():
            process.kill()
    process.join(timeout=5.0)


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
