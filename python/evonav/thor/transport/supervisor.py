"""Make sure that the client notices the end of `evonav-thor`.

AI2-THOR's client takes a closed pipe for a slow engine and waits for its timeout, 100 s. So the process that the client
starts does not serve it. It forks a worker that does, keeps the pipe open, and breaks off the message of a worker that
was killed. If the supervisor itself is killed, the worker notices and ends the session.
"""

import os
import select
import signal
from contextlib import suppress

from evonav.thor.transport.fifo import Fifo

_WATCH_MS = 500
# Time for the worker to finish its action and close its pipes.
_GRACE_MS = 3000


def fork_worker(fifo: Fifo) -> int | None:
    """Fork a worker; return in both processes, in the supervisor only when the worker has ended.

    If the worker was killed, the supervisor ends by the same signal.

    Args:
        fifo: The open transport; from now on the worker's.

    Returns:
        The worker's exit status; `None` in the worker, which must serve the client.
    """
    supervisor_pid = os.getpid()
    # Nothing is ever written to this pipe: the end of the worker closes it.
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
        # A signal that ends the supervisor comes here too.
        status = _end(worker_pid, poll)
    if status < 0:
        fifo.break_off()
        with suppress(OSError, ValueError):  # SIGKILL has no handler
            signal.signal(-status, signal.SIG_DFL)
        os.kill(supervisor_pid, -status)
    return status


def _end(worker_pid: int, poll: select.poll) -> int:
    """Return the worker's status, minus the signal's number if one killed it; first end a worker that still runs."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        if not poll.poll(0):
            os.kill(worker_pid, number)
            poll.poll(_GRACE_MS)
    return os.waitstatus_to_exitcode(os.waitpid(worker_pid, 0)[1])
