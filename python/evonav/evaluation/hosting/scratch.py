"""Make the folder below which agents in sandboxes may write, and delete those that killed runs have left."""

import os
import shutil
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp

from evonav.errors import StoreError
from evonav.parallel.folders import LOCK_NAME, writing

PREFIX = "evonav-agents-"
LEFT_S = 60.0
"""A folder that is younger may be about to be locked."""


@contextmanager
def agents_scratch() -> Iterator[str]:
    """Lend a locked temporary folder, which is deleted at the end; `StoreError` if the file system has no locks."""
    with TemporaryDirectory(prefix=PREFIX, ignore_cleanup_errors=True) as name, writing(Path(name)):
        for folder in Path(name).parent.glob(f"{PREFIX}*"):
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
    return is_own and (folder / LOCK_NAME).exists() and time.time() - status.st_mtime > LEFT_S
