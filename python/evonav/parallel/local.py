"""Workers of `evonav.parallel.pool` as processes of this machine."""

import multiprocessing
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from types import ModuleType

from evonav.parallel.pool import Pulse, Worker, WorkerLostError, end_work, load_work, steps

END_TIMEOUT_S = 5.0
"""For a worker to end what it has started, before it is killed."""


class ProcessHost:
    """Processes of this machine."""

    def __init__(self, work: str, settings: str) -> None:
        """Starts nothing yet."""
        self._work, self._settings = work, settings

    def start(self) -> "WorkerProcess":
        """Another process."""
        return WorkerProcess(self._work, self._settings)

    def wait(self, workers: Sequence[Worker], timeout_s: float) -> Sequence[Worker]:
        """Those with something to receive."""
        connections = {worker.connection: worker for worker in workers if isinstance(worker, WorkerProcess)}
        return [connections[ready] for ready in wait(list(connections), timeout_s) if isinstance(ready, Connection)]

    def close(self) -> None:
        """Nothing is left."""


class WorkerProcess:
    """A process that works until its parent hangs up or dies."""

    def __init__(self, work: str, settings: str) -> None:
        """Starts it."""
        context = multiprocessing.get_context("spawn")
        self.connection, far_end = context.Pipe()
        with one_thread_each(), _without_main():
            self._process = context.Process(target=_serve, args=(far_end, work, settings), daemon=True)
            self._process.start()
        far_end.close()

    def send(self, text: str) -> None:
        """Gives it a job."""
        with suppress(BrokenPipeError):
            self.connection.send_bytes(text.encode())

    def receive(self) -> tuple[str, str]:
        """What it says next."""
        try:
            kind, _, text = self.connection.recv_bytes().decode().partition(" ")
        except (EOFError, OSError):
            raise WorkerLostError(f"the worker process died ({cause_of_death(self._process)})") from None
        return kind, text

    def close(self) -> None:
        """Ends it at once."""
        end_process(self._process, self.connection)


def _serve(connection: Connection, name: str, settings: str) -> None:
    """A worker's life: jobs in, what they say out."""
    end_with_parent()

    def say(kind: str, text: str = "") -> None:
        connection.send_bytes(f"{kind} {text}".encode())

    with suppress(EOFError, OSError):  # of the connection: the parent hung up
        try:
            work = load_work(name, settings, Pulse(lambda: say("alive")))
        except Exception:
            say("broken", traceback.format_exc())
            return
        try:
            say("ready")
            while True:
                for kind, text in steps(work, connection.recv_bytes().decode()):
                    say(kind, text)
        finally:
            end_work(work)


@contextmanager
def _without_main() -> Iterator[None]:
    """Hides the script that is running from a child that is started inside.

    It would be run again there, and one without `if __name__ == "__main__"` would begin anew what it is at.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def end_with_parent() -> None:
    """Makes a child leave interrupts to its parent, and end with it by way of every `finally`."""

    def end(number: int, _: object) -> None:
        raise SystemExit(128 + number)

    def watch() -> None:
        parent = multiprocessing.parent_process()
        if parent is not None:
            parent.join()
            os.kill(os.getpid(), signal.SIGTERM)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, end)
    threading.Thread(target=watch, daemon=True).start()


def cause_of_death(process: multiprocessing.process.BaseProcess) -> str:
    """How a process ended that has hung up."""
    process.join(timeout=5.0)
    code = process.exitcode
    return f"killed by signal {-code}" if code is not None and code < 0 else f"exit code {code}"


def end_process(process: multiprocessing.process.BaseProcess, connection: Connection) -> None:
    """Hangs up on a child and ends it; safe to call twice."""
    connection.close()
    if process.is_alive():
        process.terminate()
        process.join(timeout=END_TIMEOUT_S)
        if process.is_alive():
            process.kill()
    process.join(timeout=5.0)


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Gives children that are started inside one thread each: the parallelism is over jobs."""
    names = ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
    added = [name for name in names if name not in os.environ]
    os.environ.update(dict.fromkeys(added, "1"))
    try:
        yield
    finally:
        for name in added:
            del os.environ[name]
