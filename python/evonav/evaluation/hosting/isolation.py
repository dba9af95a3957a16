"""Decide how far an agent's process is shut off, and what one in a sandbox may read and write."""

import os
import shutil
import stat
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from typing import Literal

from evonav.agents.hosting.sandbox import Policy, landlock_abi, sandbox_problem
from evonav.errors import StoreError
from evonav.parallel.folders import LOCK_NAME, writing
from evonav.parallel.local import SPARING, THREAD_VARIABLES, search_path
from evonav.perception.weights import MODELS_VARIABLE

Isolation = Literal["none", "process", "sandbox"]
"""`none`: the evaluator's own process; `process`: one of the agent's own; `sandbox`: that, shut in."""
IS_SUPPORTED = os.name == "posix"
"""True where agents can have processes of their own; elsewhere they run in the evaluator's."""

SCRATCH_PREFIX = "evonav-agents-"
_LEFT_S = 60.0
"""A folder that is younger may be about to be locked."""
_GPU_DEVICES = ("/dev/nvidiactl", "/dev/kfd")
_SYSTEM = (
    "/bin",
    "/etc/ld.so.cache",
    "/etc/localtime",
    "/etc/ssl",
    "/lib",
    "/lib64",
    "/proc/cpuinfo",
    "/proc/meminfo",
    "/sys/devices/system/cpu",
    "/usr/bin",
    "/usr/lib",
    "/usr/lib64",
    "/usr/local/lib",
    "/usr/share/zoneinfo",
)
_BUNDLED = ("tasks", "houses.jsonl.gz")
"""Members of evonav's data that tell of bundled tasks."""
_VARIABLES = (
    "CUDA_VISIBLE_DEVICES",
    "HF_HUB_CACHE",
    "LANG",
    "LANGUAGE",
    "LC_ALL",
    "LC_CTYPE",
    "LD_LIBRARY_PATH",
    "PATH",
    "PYTHONHASHSEED",
    "TZ",
    MODELS_VARIABLE,
    *SPARING,
    *THREAD_VARIABLES,
)
"""Environment variables that a process in a sandbox is given."""
_CACHES = {"HF_HOME": "~/.cache/huggingface", "TORCH_HOME": "~/.cache/torch"}
"""Variables that name the folders of downloaded models, and their defaults."""
_TOKENS = ("token", "stored_tokens")
"""Files with keys in `HF_HOME`."""


@dataclass(frozen=True, slots=True)
class AgentHosting:
    """Options of agents' processes that a user sets. They are not part of a run's identity."""

    isolation: Isolation | Literal["debugger"] = "process"
    """`none` and `debugger` contain only exceptions; `debugger` also opens Python's where one is raised (a terminal).

    `sandbox`: the process reads no file of a run or a task, and reaches no network (Linux).
    """
    timeout_s: float = 600.0
    """Time limit of an answer, after which the process is ended."""
    memory_mb: int | None = None
    """Largest address space of an agent's process; default: no limit."""

    @property
    def is_in_process(self) -> bool:
        """True if agents run in the evaluator's own process."""
        return self.isolation in ("none", "debugger")


@dataclass(frozen=True, slots=True)
class ProcessSetup:
    """Options of agents' processes that only a run sets."""

    log: str | None = None
    """File to which the output of agents is appended; default: the evaluator's standard error."""
    hidden: tuple[str, ...] = ()
    """Files and folders that a sandbox hides, even in folders that can be read otherwise."""
    scratch: str | None = None
    """Folder for the folders in which processes in a sandbox may write; default: the system's for temporary files."""
    relays_model: bool = False
    """Ask the decision model for agents' processes: those in a sandbox have no network."""
    is_one_of_many: bool = False
    """A worker has many episodes at once: unused shared memory is given back, and an agent may wake on any core."""


NO_SETUP = ProcessSetup()
"""Setup of a process that no run starts."""


def usual_isolation() -> Isolation:
    """Return how agents are shut off if nobody says it: in a sandbox if this machine has one, else in a process.

    On a machine with a GPU for computing they are not in a sandbox: drivers read files of their own and reserve more
    address space than there is memory, and a library that cannot find its GPU may go on without it, unnoticed.
    """
    has_gpu = any(Path(device).exists() for device in _GPU_DEVICES)
    return "process" if sandbox_problem() or has_gpu else "sandbox"


def isolation_facts(hosting: AgentHosting) -> str:
    """Return how agents are shut off, as a run's header says it."""
    if hosting.isolation == "sandbox":
        return f"sandbox (Landlock {landlock_abi()}, seccomp)"
    return "none" if hosting.is_in_process else hosting.isolation


def environment(scratch: Path) -> dict[str, str]:
    """Return the environment of a process in a sandbox, which may write in the folder `scratch` only."""
    given = {name: os.environ[name] for name in _VARIABLES if name in os.environ}
    own = {"HOME": str(scratch), "TMPDIR": str(scratch), "PYTHONDONTWRITEBYTECODE": "1", "HF_HUB_OFFLINE": "1"}
    return {**given, **{name: str(folder) for name, folder in _caches().items()}, **own}


def _caches() -> dict[str, Path]:
    """Return the folders of downloaded models that are there, by the variable that names them."""
    folders = {name: Path(os.environ.get(name) or default).expanduser() for name, default in _CACHES.items()}
    return {name: folder.absolute() for name, folder in folders.items() if folder.is_dir()}


def with_absolute_file(name: str) -> str:
    """Return an agent's name; the file of `./my_agent.py:MyAgent` becomes absolute."""
    file, colon, kind = name.rpartition(":")
    return f"{Path(file).absolute()}:{kind}" if colon and file.endswith(".py") else name


def policy_of(name: str, scratch: Path, hidden: Sequence[str], memory_mb: int | None) -> Policy:
    """Return what the process of an agent may do.

    It may read the interpreter, all that can be imported, the folder of the agent's file, and the folders of models
    that the variables `EVONAV_MODELS`, `HF_HOME`, `HF_HUB_CACHE` and `TORCH_HOME` name, but nothing that is hidden,
    wherever that lies.

    Args:
        scratch: The folder in which it may write.
        hidden: Files and folders that it must not read: the run's, the tasks'.
        memory_mb: Largest address space; default: the memory of this machine.
    """
    file, _, _ = name.rpartition(":")
    folders = [*_SYSTEM, sys.prefix, sys.base_prefix, sys.exec_prefix, *search_path(), str(files("evonav"))]
    if file.endswith(".py"):
        folders.append(str(Path(file).absolute().parent))
    folders += [os.environ[name] for name in (MODELS_VARIABLE, "HF_HUB_CACHE") if os.environ.get(name)]
    caches = _caches()
    folders += map(str, caches.values())
    if "HF_HOME" in caches:
        hidden = (*hidden, *(str(caches["HF_HOME"] / token) for token in _TOKENS))
    data = files("evonav") / "data"
    unseen = [Path(place).resolve() for place in (*hidden, *(str(data / member) for member in _BUNDLED))]
    found = [_shown(Path(folder).resolve(), unseen) for folder in dict.fromkeys(folders)]
    shown = [pair for pairs in found for pair in pairs]
    return Policy(
        read=tuple(dict.fromkeys(str(place) for place, is_whole in shown if is_whole)),
        names=tuple(dict.fromkeys(str(place) for place, is_whole in shown if not is_whole)),
        write=(str(scratch),),
        memory_mb=memory_mb or (os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") >> 20),
    )


def _shown(place: Path, hidden: Sequence[Path]) -> Iterator[tuple[Path, bool]]:
    """Yield what of a place may be read: parts without anything hidden, and (`False`) the folders that hold the rest.

    Links are left out where something is hidden, as they may lead there or far beyond.
    """
    if any(place == one or one in place.parents for one in hidden):
        return
    if not any(place in one.parents for one in hidden):
        yield place, True
        return
    yield place, False
    for inner in sorted(place.iterdir()):
        if not inner.is_symlink():
            yield from _shown(inner, hidden)


# Where it may write


@contextmanager
def agents_scratch() -> Iterator[str]:
    """Lend a locked temporary folder, which is deleted at the end; `StoreError` if the file system has no locks."""
    with TemporaryDirectory(prefix=SCRATCH_PREFIX, ignore_cleanup_errors=True) as name, writing(Path(name)):
        for folder in Path(name).parent.glob(f"{SCRATCH_PREFIX}*"):
            with suppress(OSError, StoreError):  # locked, or deleted by another run
                if _may_be_left(folder):
                    with writing(folder):
                        shutil.rmtree(folder)
        yield name


def new_scratch(folder: str | None) -> Path:
    """Return a new folder for one process.

    Args:
        folder: The lent folder; default, and where it is not there, as on other machines of a cluster: the system's.
    """
    parent = folder if folder is not None and Path(folder).is_dir() else None
    return Path(mkdtemp(prefix="evonav-agent-", dir=parent))


def _may_be_left(folder: Path) -> bool:
    """Return whether a folder is our user's and was locked a while ago."""
    status = folder.lstat()
    is_own = stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid()
    return is_own and (folder / LOCK_NAME).exists() and time.time() - status.st_mtime > _LEFT_S
