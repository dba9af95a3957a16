"""Run the jobs of a worker: load its work, run its jobs, and send their messages and heartbeats."""

import time
import traceback
from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from dataclasses import dataclass, field

from evonav.component import import_callable
from evonav.parallel import profiling

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


@dataclass(slots=True)
class Heartbeat:
    """A worker's `alive`: sends at most one heartbeat every `HEARTBEAT_S`."""

    send: Callable[[], None]
    last_s: float = field(default_factory=time.monotonic)

    def __call__(self) -> None:
        """Send a heartbeat, if it is time."""
        if time.monotonic() - self.last_s >= HEARTBEAT_S:
            self.last_s = time.monotonic()
            self.send()


def serve(work_name: str, settings: str, jobs: Iterator[str], send: Callable[[str, str], None]) -> None:
    """Be a worker: load the work, run all jobs, and send the messages that `Worker.receive` describes.

    Args:
        work_name: `module:factory`.
        settings: Text with which the factory is called.
        jobs: The texts of the jobs; the next one is taken when the one before has ended.
        send: Sends a message: its kind and its text.
    """
    try:
        work = load_work(work_name, settings, Heartbeat(lambda: send("alive", "")))
    except Exception:
        send("broken", traceback.format_exc())
        return
    try:
        send("ready", "")
        with profiling.sampled("workers"):
            for text in jobs:
                for kind, message in steps(work, text):
                    if kind != "progress":
                        profiling.save()  # after its last job, a worker is ended at once
                    send(kind, message)
    finally:
        try:
            end_work(work)
        except SystemExit:  # the parent's signal came in the middle of it, or before its first line
            end_work(work)
            raise
