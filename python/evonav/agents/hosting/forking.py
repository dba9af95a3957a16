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
    """Its `agent`, `folder` and `environment`, its import `path`, and whether it `is_sandboxed`."""
    descriptors: Sequence[int]
    """The socket for its state, standard output and error, then those from `SOCKET` on."""


_beside: tuple[int, socket.socket] | None = None
"""Number and connection of the server that is a fork of this process."""


def fork_beside() -> bool:
    """Fork the server from this process, which has no threads yet and has run nobody's code but evonav's.

    Returns:
        True in the server and in its children, at their ends; false in this process, which goes on.
    """
    global _beside
    _import()
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    pid = os.fork()
    if pid == 0:
        os.setsid()
        os.dup2(2, 1)
        control = os.dup2(far.detach(), SOCKET, inheritable=False)
        near.detach()
        os.closerange(control + 1, os.sysconf("SC_OPEN_MAX"))
        main(control)
        return True
    far.close()
    _beside = pid, near
    return False


def take_beside() -> tuple[int, socket.socket] | None:
    """Return number and connection of the server that is a fork of this process, once."""
    global _beside
    found, _beside = _beside, None
    return found


def main(control: int) -> None:
    """Serve the requests of a socket that ends with the evaluator; in a child, be an agent's process."""
    gc.disable()  # imports leave hardly any garbage, and looking for it takes a tenth of their time
    _import()
    gc.freeze()
    _call_oneself(SERVER_NAME)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with socket.socket(fileno=control) as requests:  # a child keeps no trace of it
        child = _serve(requests)
    if child is None:
        return
    _become(child)
    if child.request["is_sandboxed"]:
        from evonav.agents.hosting.sandbox import begin

        begin(SOCKET)
    from evonav.agents.hosting import serving

    serving.main(SOCKET, LIFE, BLOCK)


def _serve(requests: socket.socket) -> Child | None:
    """Fork as requested, until the evaluator ends; return the request in a child, `None` in this process."""
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
                request = json.loads(data)
                _preload(request["agent"])
                pid = os.fork()
                if pid == 0:
                    return Child(request, descriptors)
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


def _import() -> None:
    """Import what all agents' processes need."""
    from evonav.agents.hosting import serving  # noqa: F401
    from evonav.decision import backends  # noqa: F401


def _preload(agent: str) -> None:
    """Import a built-in agent, so that children share its memory."""
    from evonav.agents.registry import BUILT_IN, RULE_MARK, agent_factory

    if (name := agent.partition(RULE_MARK)[0]) in BUILT_IN:
        with suppress(Exception):  # which the child will say
            agent_factory(name)
    gc.freeze()  # a collection would write to all objects, and so copy the memory that is shared


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
    if (random := sys.modules.get("numpy.random")) is not None:
        random.seed()  # or all children would draw the same numbers
