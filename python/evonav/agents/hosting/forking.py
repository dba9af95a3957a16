"""Fork agents' processes from one that has imported everything: they share its memory, and start at once (Linux).

`evonav.evaluation.hosting.fork_server` is the evaluator's side. This process runs nobody's code but evonav's, has no
threads and holds no secret that an agent in a sandbox must not have. Each request brings the descriptors of a child and
a socket for its state: the child says its number there once it leads its own process group, this process says how it
ended. A child stays unreaped, and its number its own, until the evaluator closes that socket; whatever is left of its
group ends then. All children end with this process, and this process ends with the evaluator.
"""

import fcntl
import gc
import json
import os
import select
import signal
import socket
import struct
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

STATE = struct.Struct("<?q")
"""Format of a child's state: false and its number, then true and its exit code, negative for a signal."""
MAX_REQUEST_BYTES = 1 << 17
SOCKET, LIFE, BLOCK, RELAY = 3, 4, 5, 6
"""Descriptors of a child, after its output; the last one is there only if a model is asked for it."""
PROCESS_NAME, SERVER_NAME = "evonav-agent", "evonav-forks"
"""Names of a child and of this process in `ps` and `top`."""


class Child(NamedTuple):
    """A child that is to be started."""

    request: Mapping[str, Any]
    """`folder` and `environment` in which it runs, its import `path`, and whether it `is_sandboxed`."""
    descriptors: Sequence[int]
    """The socket for its state, standard output and error, then those from `SOCKET` on."""


def main(control: int) -> None:
    """Serve requests; in a child, be an agent's process.

    Args:
        control: Socket that brings requests and ends with the evaluator.
    """
    from evonav.agents.hosting import serving

    _call_oneself(SERVER_NAME)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    serving.preload()
    gc.collect()
    gc.freeze()  # a collection would write to all objects, and so copy the memory that is shared
    child = _requested(control)
    if child is None:
        return
    _become(child)
    if child.request["is_sandboxed"]:
        from evonav.agents.hosting.sandbox import begin

        begin(SOCKET)
    serving.main(SOCKET, LIFE, BLOCK)


def _requested(control: int) -> Child | None:
    """Fork as requested, until the evaluator ends; return the request in a child, `None` in this process."""
    with socket.socket(fileno=control) as requests:  # a child keeps no trace of it
        return _serve(requests)


def _serve(requests: socket.socket) -> Child | None:
    poll = select.poll()
    poll.register(requests, select.POLLIN)
    pids: dict[int, int] = {}
    """Number of a child by the descriptor of its state, and by that of its end."""
    while True:
        for descriptor, _ in poll.poll():
            if descriptor == requests.fileno():
                data, descriptors, _, _ = socket.recv_fds(requests, MAX_REQUEST_BYTES, RELAY + 1)
                if not data:
                    for pid in set(pids.values()):
                        _end(pid)
                    return None
                pid = os.fork()
                if pid == 0:
                    return Child(json.loads(data), descriptors)
                for inherited in descriptors[1:]:
                    os.close(inherited)
                for watched in (descriptors[0], os.pidfd_open(pid)):
                    pids[watched] = pid
                    poll.register(watched, select.POLLIN)
                continue
            pid = pids[descriptor]
            state, end = (one for one, owner in pids.items() if owner == pid)
            if descriptor == end:
                poll.unregister(end)
                with suppress(OSError):  # the evaluator does not wait for it
                    os.write(state, STATE.pack(True, _exit_code(pid)))
            else:  # the evaluator sends nothing, it has closed its side
                with suppress(KeyError):
                    poll.unregister(end)
                poll.unregister(state)
                _end(pid)
                for watched in (state, end):
                    os.close(watched)
                    del pids[watched]


def _call_oneself(name: str) -> None:
    with suppress(OSError):
        Path("/proc/self/comm").write_text(name)


def _exit_code(pid: int) -> int:
    """Return how a child has ended, without reaping it."""
    found = os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
    if found is None:
        return 1
    return found.si_status if found.si_code == os.CLD_EXITED else -found.si_status


def _end(pid: int) -> None:
    """End a child's group, and reap it."""
    with suppress(ProcessLookupError, PermissionError):
        os.kill(pid, signal.SIGKILL)  # it may not have its group yet
        os.killpg(pid, signal.SIGKILL)
    os.waitpid(pid, 0)


def _become(child: Child) -> None:
    """Make this fork what a fresh process would be."""
    os.setsid()
    nothing = os.open(os.devnull, os.O_RDONLY)
    state, *others = child.descriptors
    low = max(RELAY, nothing, *child.descriptors) + 1
    # First out of the way: a descriptor may have the number that another one is to have.
    copies = [fcntl.fcntl(one, fcntl.F_DUPFD_CLOEXEC, low) for one in (nothing, *others)]
    os.write(state, STATE.pack(False, os.getpid()))
    for number, copy in enumerate(copies):
        os.dup2(copy, number, inheritable=number < SOCKET)
    os.closerange(len(copies), os.sysconf("SC_OPEN_MAX"))
    gc.enable()
    _call_oneself(PROCESS_NAME)
    os.environ.clear()
    os.environ.update(child.request["environment"])
    if child.request["folder"] is not None:
        os.chdir(child.request["folder"])
    sys.path[:] = child.request["path"]
    if (numpy := sys.modules.get("numpy")) is not None:
        numpy.random.seed()  # or all children would draw the same numbers
