"""Note the commands, machines and versions that worked on a run, beside its records."""

import os
import platform
import shlex
import subprocess
import sys
from datetime import datetime, timezone
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

from evonav import __version__
from evonav.evaluation.records.store import RunStore

KEY = "sessions"
_ISOLATIONS_KEY = "isolations"
_ADDRESS = "--base-url"
MAX_SESSIONS = 50
"""Largest number of noted sessions: the first one and the latest."""


def note_session(store: RunStore, num_workers: int, isolation: str) -> None:
    """Note the command that is about to evaluate, its machine and versions.

    Args:
        num_workers: Number of processes that evaluate.
        isolation: The isolation of agents, see `isolation_facts`.
    """
    before = store.meta(KEY) or []
    sessions = [*before[:1], *before[1:][-(MAX_SESSIONS - 2) :]]
    kind = isolation.partition(" ")[0]
    store.set_header(
        {
            KEY: [*sessions, {**session_facts(), "workers": num_workers, "isolation": isolation}],
            _ISOLATIONS_KEY: sorted({*isolations_of(store), kind}),
        }
    )


def isolations_of(store: RunStore) -> list[str]:
    """Return every `--isolation` with which agents of a run were evaluated; empty in runs that note none."""
    return store.meta(_ISOLATIONS_KEY) or []


def session_facts() -> dict[str, Any]:
    """Return the command of this process, its machine and versions, without names of users or machines."""
    return {
        "command": typed_command(),
        "began": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "evonav": __version__,
        "git": _revision(Path(__file__).parent),
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.release()} {platform.machine()}",
        "cpus": os.cpu_count(),
    }


def typed_command() -> str:
    """Return the command as typed if it is evonav's, else an empty string.

    Addresses of models' servers, which may hold a password, are `***`.
    """
    name = Path(sys.argv[0]).name if sys.argv else ""
    if name not in ("evonav", "__main__.py"):
        return ""
    arguments = [
        "***" if before == _ADDRESS else f"{_ADDRESS}=***" if word.startswith(f"{_ADDRESS}=") else word
        for before, word in pairwise(sys.argv)
    ]
    return shlex.join(["evonav", *arguments])


@cache
def _revision(directory: Path) -> str:
    """Return the git revision of the package's checkout; empty if it is installed or git is missing."""
    try:
        command = ["git", "-C", str(directory), "describe", "--always", "--dirty", "--abbrev=12"]
        in_git = ["git", "-C", str(directory), "ls-files", "--error-unmatch", Path(__file__).name]
        if subprocess.run(in_git, capture_output=True, timeout=5).returncode != 0:  # noqa: S603
            return ""  # some other project's checkout, with this package in an environment inside
        return subprocess.run(command, capture_output=True, text=True, timeout=5).stdout.strip()  # noqa: S603
    except (OSError, subprocess.SubprocessError):
        return ""
