"""Decide how far an agent's process is shut off, and what one in a sandbox may read."""

import os
import sys
from collections.abc import Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Literal

from evonav.agents.hosting.sandbox import Policy, landlock_abi
from evonav.parallel.local import THREAD_VARIABLES
from evonav.perception.weights import MODELS_VARIABLE

Isolation = Literal["none", "process", "sandbox"]
"""`none`: the evaluator's own process; `process`: one of the agent's own; `sandbox`: that, shut in."""

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
_BUNDLED = ("tasks", "houses.jsonl.gz", "former_tasks.json")
"""Members of evonav's data that tell of bundled tasks."""
_VARIABLES = (
    "CUDA_VISIBLE_DEVICES",
    "LANG",
    "LANGUAGE",
    "LC_ALL",
    "LC_CTYPE",
    "LD_LIBRARY_PATH",
    "PATH",
    "PYTHONHASHSEED",
    "TZ",
    MODELS_VARIABLE,
    *THREAD_VARIABLES,
)
"""Environment variables that a process in a sandbox is given."""


def isolation_facts(isolation: Isolation) -> str:
    """Return how agents are shut off, as a run's header says it."""
    return f"sandbox (Landlock {landlock_abi()}, seccomp)" if isolation == "sandbox" else isolation


def environment(scratch: Path) -> dict[str, str]:
    """Return the environment of a process in a sandbox.

    Args:
        scratch: The one folder in which it may write.
    """
    given = {name: os.environ[name] for name in _VARIABLES if name in os.environ}
    return {**given, "HOME": str(scratch), "TMPDIR": str(scratch), "PYTHONDONTWRITEBYTECODE": "1"}


def with_absolute_file(name: str) -> str:
    """Return an agent's name; the file of `./my_agent.py:MyAgent` becomes absolute."""
    file, colon, kind = name.rpartition(":")
    return f"{Path(file).absolute()}:{kind}" if colon and file.endswith(".py") else name


def search_path() -> list[str]:
    """Return this process's `sys.path` in absolute paths."""
    return [str(Path(entry).absolute()) for entry in sys.path]


def policy_of(name: str, scratch: Path, hidden: Sequence[str], memory_mb: int | None) -> Policy:
    """Return what the process of an agent may do.

    It may read the interpreter, all that can be imported, the folder of the agent's file, and the folder of models
    that the variable `EVONAV_MODELS` names, but nothing that is hidden, wherever that lies.

    Args:
        name: Name of the agent.
        scratch: The folder in which it may write.
        hidden: Files and folders that it must not read: the run's, the tasks'.
        memory_mb: Largest address space; default: the memory of this machine.
    """
    file, _, _ = name.rpartition(":")
    folders = [*_SYSTEM, sys.prefix, sys.base_prefix, sys.exec_prefix, *search_path(), str(files("evonav"))]
    if file.endswith(".py"):
        folders.append(str(Path(file).absolute().parent))
    if models := os.environ.get(MODELS_VARIABLE):
        folders.append(models)
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
