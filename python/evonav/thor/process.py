"""Run `evonav-thor`, the process that AI2-THOR's client starts in place of Unity.

AI2-THOR's client takes a closed pipe for a slow engine and waits for its timeout, 100 s. So the process that the client
starts does not serve it. It forks a worker that does, keeps the pipe open, and breaks off the message of a worker that
was killed. If the supervisor itself is killed, the worker notices and ends the session.
"""

import argparse
import json
import logging
import os
import select
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

from evonav.thor.transport.fifo import ClientGone, Fifo, FramingError

if TYPE_CHECKING:
    from evonav.thor.transport.wsgi import Wsgi

_LOG = logging.getLogger("evonav.thor")
_WATCH_MS = 500
# Time for the worker to finish its action and close its pipes.
_GRACE_MS = 3000

_USAGE = """%(prog)s is started by AI2-THOR's client, not by hand:

    from ai2thor.controller import Controller
    import evonav.thor
    controller = Controller(local_executable_path=evonav.thor.executable(), x_display="0", scene=house)
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve one client until it goes.

    Args:
        arguments: Command-line arguments, as `Controller.unity_command` makes them.

    Returns:
        The exit status: 0 when the client has gone, 1 when it could not be served, 2 without a client.
    """
    parent_pid = os.getppid()
    try:
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, _stop)
        return _connect_and_serve(_parser().parse_known_args(arguments)[0], parent_pid)
    except _Stopped as stop:
        _LOG.info("ends: %s", signal.Signals(stop.args[0]).name)
        return 128 + int(stop.args[0])


def _connect_and_serve(options: argparse.Namespace, parent_pid: int) -> int:
    # The client writes this output to ~/.ai2thor/log/unity.log, one file for all its engines.
    logging.basicConfig(
        stream=sys.stderr,
        level=logging.INFO,
        format=f"%(asctime)s evonav-thor[{os.getpid()}] %(levelname)s %(message)s",
    )
    try:
        transport = _transport(lambda: os.getppid() != parent_pid)
    except _NoClientError as error:
        print(f"{_parser().format_usage()}\n{error}", file=sys.stderr)
        return 2
    except (ClientGone, OSError, ValueError) as error:
        _LOG.error("cannot connect: %s", error)
        return 1
    if isinstance(transport, Fifo):
        # Over the other transport, the client notices by itself that the process has ended.
        status = _fork_worker(transport)
        if status is not None:
            return status
    try:
        _LOG.info("serves process %d", parent_pid)
        _serve(transport, options)
    except ClientGone as end:
        _LOG.info("ends: %s", end)
    except FramingError as error:
        _LOG.error("ends: %s", error)
        return 1
    finally:
        transport.close()
    return 0


def _fork_worker(fifo: Fifo) -> int | None:
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


class _NoClientError(Exception):
    """The environment names no client."""


def _transport(is_orphan: Callable[[], bool]) -> "Fifo | Wsgi":
    """Connect as the client's environment demands."""
    variables = {name.removeprefix("AI2THOR_"): value for name, value in os.environ.items()}
    kind = variables.get("SERVER_TYPE")
    try:
        if kind == "WSGI":
            from evonav.thor.transport.wsgi import Wsgi

            return Wsgi(variables["HOST"], int(variables["PORT"]), variables["CLIENT_TOKEN"], is_orphan)
        server_pipe, client_pipe = variables["FIFO_SERVER_PIPE_PATH"], variables["FIFO_CLIENT_PIPE_PATH"]
    except KeyError as error:
        served = f"server type {kind} without AI2THOR_{error.args[0]}" if kind else "no client started this process"
        raise _NoClientError(served) from error
    return Fifo(Path(server_pipe), Path(client_pipe), is_orphan)


def _serve(transport: "Fifo | Wsgi", options: argparse.Namespace) -> None:
    # Imported after the pipes are open: a client whose engine fails before that waits for ever.
    from evonav.thor.engine import Engine
    from evonav.thor.events import Emitter

    engine = Engine(width_px=options.width, height_px=options.height)
    has_camera = not options.nographics and os.environ.get("AI2THOR_SERVER_SIDE_SCREENSHOT") != "False"
    emitter = Emitter(engine, has_camera=has_camera, has_patches=isinstance(transport, Fifo))
    transport.send(emitter.event({"sequenceId": 0}))
    while True:
        message = _decoded(transport.receive())
        engine.execute(message)
        transport.send(emitter.event(message))


def _decoded(body: bytes) -> dict[str, Any]:
    """Return the message; an unreadable one becomes an action without a name, which fails."""
    try:
        message = json.loads(body)
    except (ValueError, RecursionError) as error:
        return {"problem": f"the message is not JSON: {error}"}
    if not isinstance(message, dict):
        return {"problem": f"the message is a JSON {type(message).__name__}, not an object"}
    return message


def _parser() -> argparse.ArgumentParser:
    """Parse Unity's arguments; those without a use here (`-screen-quality`, `-force-device-index`) are ignored."""
    parser = argparse.ArgumentParser("evonav-thor", usage=_USAGE, add_help=False, allow_abbrev=False)
    parser.add_argument("-screen-width", dest="width", type=int, default=300)
    parser.add_argument("-screen-height", dest="height", type=int, default=300)
    parser.add_argument("-nographics", action="store_true")
    return parser


class _Stopped(BaseException):
    """A signal asked the process to end."""


def _stop(number: int, frame: FrameType | None) -> None:
    # A second signal must not interrupt the shutdown. With SIG_IGN, CPython would complain about one already pending.
    for other in (signal.SIGTERM, signal.SIGINT):
        signal.signal(other, lambda *_: None)
    raise _Stopped(number)


if __name__ == "__main__":
    raise SystemExit(main())
