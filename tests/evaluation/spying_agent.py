"""An agent that tries to leave its sandbox, and says what it reached. Its file lies beside the run and the tasks."""

import ctypes
import mmap
import os
import resource
import signal
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

from evonav.agents.agent import Move, SensorConfig, Stop
from evonav.agents.explanation import Explanation
from evonav.world.simulator import Action

PROJECT = Path(__file__).parent
LIBC = ctypes.CDLL(None, use_errno=True)
CANARY = "canary-of-the-evaluator"
THE_USERS_HOME = "filled in by the test, as HOME is another folder in a sandbox"


def readable(root):
    """Return the files below a folder that can be read, by name."""
    found = []
    for folder, _, names in os.walk(root):
        for name in names:
            try:
                Path(folder, name).read_bytes()
                found.append(name)
            except OSError:
                continue
    return sorted(found)


def call(*arguments):
    """Return the error of a system call; 0 without one."""
    return ctypes.get_errno() if LIBC.syscall(*arguments) < 0 else 0


def open_by_child():
    code = f"import pathlib; print(len(pathlib.Path({str(PROJECT / 'notes.txt')!r}).read_bytes()))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    return done.stdout.strip()


def others_processes():
    """Return what `/proc` tells of the parent process."""
    return Path(f"/proc/{os.getppid()}/cmdline").read_text()


def child_that_stays():
    child = os.fork()
    if child == 0:
        signal.pause()
    return child


def own_session():
    child = os.fork()
    if child == 0:
        try:
            os.setsid()
        except OSError:
            os._exit(7)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def link_out():
    """Read the run through a link in the folder that can be written."""
    link = Path(tempfile.gettempdir()) / "link"
    link.symlink_to(PROJECT / "run")
    found = readable(f"{link}/")
    link.unlink()
    return found


def large_file():
    with Path(tempfile.gettempdir(), "large").open("wb") as file:
        file.truncate(2 << 30)
    Path(tempfile.gettempdir(), "large").unlink()


def all_memory():
    return len(mmap.mmap(-1, 1 << 46))


def package_data():
    import evonav

    data = Path(evonav.__file__).parent / "data"
    return [name for name in readable(data) if name.endswith((".json", ".gz"))]


ATTEMPTS = {
    "files beside": lambda: readable(PROJECT),
    "package": package_data,
    "home": lambda: [*readable(Path(THE_USERS_HOME) / ".ssh"), os.environ["HOME"]],
    "passwords": lambda: Path("/etc/passwd").read_text(),
    "parent": others_processes,
    "own environment": lambda: Path("/proc/self/environ").read_text(),
    "canary": lambda: [value for value in os.environ.values() if CANARY in value],
    "folder": lambda: os.listdir(),  # noqa: PTH208
    "descriptors": lambda: [n for n in range(3, 50) if not _is_closed(n)],
    "write beside": lambda: (PROJECT / "written").write_text("x"),
    "write scratch": lambda: Path(tempfile.gettempdir(), "mine").write_text("x"),
    "network": lambda: socket.socket().close(),
    "unix socket": lambda: socket.socket(socket.AF_UNIX).close(),
    "pair": lambda: [one.close() for one in socket.socketpair()],
    "signal": lambda: os.kill(os.getppid(), 0),
    "child": open_by_child,
    "link": link_out,
    "session": own_session,
    "large file": large_file,
    "memory": all_memory,
    "trace": lambda: LIBC.ptrace(0x4206, os.getppid(), 0, 0) and ctypes.get_errno(),  # without stopping it
    "namespace": lambda: call(272, 0x10000000),
    "ring": lambda: call(425, 1, 0),
    "open files": lambda: resource.getrlimit(resource.RLIMIT_NOFILE)[1],
    "left child": child_that_stays,
}


def _is_closed(descriptor):
    try:
        os.fstat(descriptor)
    except OSError:
        return True
    return False


def attempt(action):
    try:
        return action()
    except (OSError, MemoryError, KeyError) as error:
        return f"{type(error).__name__}"


class Spy:
    """Tries everything once, in its first round."""

    sensors = SensorConfig()
    found = None

    def begin_task(self, task):
        pass

    def begin_stage(self, goal):
        self.stage = goal.stage

    def act(self, observation):
        if self.found is None:
            self.found = {name: attempt(action) for name, action in ATTEMPTS.items()}
            return Move(Action.TURN_LEFT)
        return Stop()

    def explain(self):
        return Explanation(details=self.found)
