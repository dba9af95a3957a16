"""Who ran a run, when and on what: notes beside its records, no part of what it is."""

import os
import platform
import shlex
import subprocess
import sys
from datetime import datetime, timezone
from functools import cache
from pathlib import Path
from typing import Any

from evonav import __version__
from evonav.evaluation.records.store import RunStore

KEY = "sessions"
MAX_SESSIONS = 50
"""Kept of a run that is resumed again and again: the first one and the latest."""


def note_session(store: RunStore, num_workers: int) -> None:
    """Notes the call that is about to evaluate: its command, machine and versions.

    Args:
        store: Of the run.
        num_workers: Processes that evaluate.
    """
    before = store.meta(KEY) or []
    kept = [*before[:1], *before[1:][-(MAX_SESSIONS - 2) :]]
    store.set_meta(KEY, [*kept, {**session_facts(), "workers": num_workers}])


def session_facts() -> dict[str, Any]:
    """The command of this process, its machine and versions; no user's or machine's name."""
    return {
        "command": _command(),
        "began": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "evonav": __version__,
        "git": _revision(Path(__file__).parent),
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.release()} {platform.machine()}",
        "cpus": os.cpu_count(),
    }


def _command() -> str:
    """As typed, for the command of ours; the script's name for others."""
    name = Path(sys.argv[0]).name if sys.argv else ""
    is_ours = name in ("evonav", "__main__.py")
    return shlex.join(["evonav", *sys.argv[1:]]) if is_ours else ""


@cache
def _revision(directory: Path) -> str:
    """Of the checkout that the package lies in; empty where it is installed, or git is not there."""
    try:
        command = ["git", "-C", str(directory), "describe", "--always", "--dirty", "--abbrev=12"]
        tracked = ["git", "-C", str(directory), "ls-files", "--error-unmatch", "sessions.py"]
        if subprocess.run(tracked, capture_output=True, timeout=5).returncode != 0:  # noqa: S603
            return ""  # some other project's checkout, with this package in an environment inside
        return subprocess.run(command, capture_output=True, text=True, timeout=5).stdout.strip()  # noqa: S603
    except (OSError, subprocess.SubprocessError):
        return ""
