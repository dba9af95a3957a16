"""Sees to it that `evonav-thor` never goes without a word.

AI2-THOR's client takes the end of its pipe for an engine that is slow, and waits for its timeout, 100 s. So the process
that it starts serves nothing: it forks the worker that does, keeps the pipe open, and breaks off the message of a
worker that was killed. Killed itself, it is missed by the worker, which says goodbye.
"""

import os
import select
import signal
from contextlib import suppress

from evonav.thor.transport.fifo import Fifo

_WATCH_MS = 500
# For the worker to finish its action and say goodbye.
_GRACE_MS = 3000


def fork_worker(fifo: Fifo) -> int | None:
    """Forks: returns in both processes, in the supervisor only when the worker has ended.

    A worker that was killed takes the supervisor with it, by the same signal.

    Args:
        fifo: Open, and from now on the worker's.

    Returns:
        Exit status of the worker; None in the worker, which is to serve.
    """
    supervisor_pid = os.getpid()
    # Nothing is ever written here: the end of the worker closes it.
    ended, lifeline = os.pipe()
    worker_pid = os.fork()
    if worker_pid == 0:
        os.close(ended)
        fifo.is_orphan = lambda: os.getppid() != supervisor_pid
        return None
    os.close(lifeline)
    fifo.stop_reading()
    poll = select.poll()
    poll.register(ended)
    try:
        while not poll.poll(_WATCH_MS) and not fifo.is_orphan():
            pass
    finally:
        # Also where a signal ends the supervisor.
        status = _end(worker_pid, poll)
    if status < 0:
        fifo.break_off()
        with suppress(OSError, ValueError):  # SIGKILL has no handler
            signal.signal(-status, signal.SIG_DFL)
        os.kill(supervisor_pid, -status)
    return status


def _end(worker_pid: int, poll: select.poll) -> int:
    """Status of the worker, minus the signal's number if one killed it; asks it to end if it has not."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        if not poll.poll(0):
            os.kill(worker_pid, number)
            poll.poll(_GRACE_MS)
    return os.waitstatus_to_exitcode(os.waitpid(worker_pid, 0)[1])
