"""Run the jobs of a worker: load its work, run its jobs, and send their messages and heartbeats."""

import gc
import os
import threading
import time
import traceback
from collections.abc import Callable, Generator, Iterator
from contextlib import closing

from evonav.component import import_callable
from evonav.parallel import profiling
from evonav.parallel.worker import Message

Work = Callable[[str], str | Generator[str, None, str]]
"""Turns the text of a job into its answer. It may have a method `close`, which is called when its worker ends."""

HEARTBEAT_S = 5.0
"""Shortest time between two heartbeats of a worker."""


def load_work(work: str, settings: str, alive: Callable[[], None]) -> Work:
    """Import `module:factory` and return the work that it makes."""
    function: Work = import_callable(work)(settings, alive)
    return function


def end_work(work: Work) -> None:
    """Call the work's `close`, if it has one."""
    close = getattr(work, "close", None)
    if close is not None:
        close()


def steps(work: Work, text: str) -> Generator[tuple[str, str]]:
    """Run a job and yield its messages: progress, then its answer or the traceback of its exception."""
    try:
        result = work(text)
        if isinstance(result, str):
            answer = result
        else:
            with closing(result):
                try:
                    while True:
                        yield "progress", next(result)
                except StopIteration as end:
                    answer = end.value
    except Exception:
        yield "error", traceback.format_exc()
    else:
        yield "done", answer


class Heartbeat(threading.local):
    """A worker's `alive`: for the job of each thread, sends at most one heartbeat every `HEARTBEAT_S`."""

    def __init__(self, send: Callable[[Message], None]) -> None:
        self._send = send
        self.key: int | None = None
        """Key of the job that this thread runs."""
        self._last_s = time.monotonic()

    def __call__(self) -> None:
        """Send a heartbeat, if it is time."""
        if self.key is not None and time.monotonic() - self._last_s >= HEARTBEAT_S:
            self._last_s = time.monotonic()
            self._send(Message("alive", self.key))


def serve(
    work_name: str,
    settings: str,
    jobs: Iterator[tuple[int, str]],
    send: Callable[[Message], None],
    *,
    has_threads: bool = False,
) -> None:
    """Be a worker: load the work, run all jobs, and send their messages.

    Args:
        has_threads: Run each job on a thread of its own, as it comes. Otherwise the next one is taken when the one
            before has ended.
    """
    lock = threading.Lock()

    def send_whole(message: Message) -> None:
        with lock:
            send(message)

    alive = Heartbeat(send_whole)
    gc.disable()  # imports leave hardly any garbage, and looking for it takes a tenth of their time
    try:
        work = load_work(work_name, settings, alive)
    except Exception:
        send(Message("broken", text=traceback.format_exc()))
        return
    look_rarely_for_garbage()
    gc.enable()

    def run(key: int, text: str) -> None:
        alive.key = key
        for kind, message in steps(work, text):
            if kind != "progress":
                profiling.save()  # after its last job, a worker is ended at once
            send_whole(Message(kind, key, message))

    try:
        send(Message("ready"))
        with profiling.sampled("workers"):
            for key, text in jobs:
                if has_threads:
                    threading.Thread(target=_run_or_end, args=(run, key, text), daemon=True).start()
                else:
                    run(key, text)
    finally:
        try:
            end_work(work)
        except SystemExit:  # the parent's signal came in the middle of it, or before its first line
            end_work(work)
            raise


def look_rarely_for_garbage() -> None:
    """Look for garbage rarely, and never among what exists: it took a hundredth of the time of episodes."""
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


def _run_or_end(run: Callable[[int, str], None], key: int, text: str) -> None:
    """Run a job on a thread; what ends a process that runs one job at a time ends this one, too."""
    try:
        run(key, text)
    except OSError:  # the parent has closed the connection, and ends this process
        pass
    except SystemExit as error:
        os._exit(error.code if isinstance(error.code, int) else 1)
    except BaseException:
        traceback.print_exc()
        os._exit(1)
