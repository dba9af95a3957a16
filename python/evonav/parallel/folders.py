"""Write folders safely: one writer at a time, one configuration, whole files, checksums."""

import errno
import hashlib
import os
import re
import shutil
import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from evonav.errors import StoreError
from evonav.json_diff import json_differences

try:
    import fcntl
except ImportError:  # Windows has no such lock
    fcntl = None  # type: ignore[assignment]

LOCK_NAME = ".lock"
_MOUNTS = Path("/proc/self/mountinfo")
_ESCAPE = re.compile(r"\\([0-7]{3})")
_NETWORK = frozenset(
    ("nfs", "nfs4", "cifs", "smb3", "smbfs", "9p", "afs", "ceph", "lustre", "glusterfs", "beegfs", "gpfs",
     "fuse.sshfs", "fuse.glusterfs", "fuse.ceph", "fuse.s3fs", "fuse.gcsfuse")
)  # fmt: skip
_UNLOCKED = frozenset(("nolock", "local_lock=all", "local_lock=flock", "nobrl"))
"""Mount options under which another machine does not see a lock."""


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Lock a folder against a second writer; the folder is made if needed, and the lock ends with the process.

    Raises:
        StoreError: Another process is writing there, the folder cannot be made, or its file system has no locks.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / LOCK_NAME).open("a+")
    except OSError as error:
        reason = error.strerror or error
        raise StoreError(f"{folder}: cannot be made or written: {reason}; name another folder") from error
    with file:
        kind, options = _mount_of(folder)
        if kind in _NETWORK and any(option in _UNLOCKED for option in options.split(",")):
            raise StoreError(f"{folder}: a network file system without locks ({kind}); choose a folder of this machine")
        if fcntl is not None:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                file.seek(0)
                who = file.read(100).strip()
                raise StoreError(
                    f"{folder}: another evonav is writing here{f' ({who})' if who else ''}; "
                    "wait for it, stop it, or use another folder"
                ) from error
            except OSError as error:
                raise StoreError(
                    f"{folder}: its file system has no locks ({error.strerror}); choose a folder of this machine"
                ) from error
            with suppress(OSError):  # a full disk: it is for people only
                os.ftruncate(file.fileno(), 0)  # not through a buffer, whose rest would be refused again on closing
                os.write(file.fileno(), f"process {os.getpid()} on {socket.gethostname()}\n".encode())
        yield


def check_same_run(stored: Mapping[str, Any], requested: Mapping[str, Any], folder: Path) -> None:
    """Check that a folder holds a run of the same configuration.

    Raises:
        StoreError: An entry differs; the message names each, nested ones with dots.
    """
    differing = sorted(json_differences(stored, requested), key=lambda one: one.path)
    if differing:
        lines = "; ".join(f"{one.path}: there {one.left!r}, asked {one.right!r}" for one in differing)
        raise StoreError(f"{folder} holds a run of another configuration ({lines}); use another folder")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield the path of a new file beside `path`, which then replaces it: readers see the old or the new one, whole.

    The folder is made if needed. If the block raises an error, `path` stays as it was.

    Raises:
        StoreError: It cannot be written.
    """
    beside = path.with_name(f".{path.stem}.partial{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield beside
        beside.replace(path)
        sync_folder(path.parent)
    except OSError as error:
        raise StoreError(f"{path}: {error}") from error
    finally:
        with suppress(OSError):
            beside.unlink(missing_ok=True)


def write_atomically(path: Path, data: str | bytes) -> Path:
    """Replace a file as a whole: a reader sees the old or the new one, also after a loss of power.

    Returns:
        `path`, whose folder is made if needed.

    Raises:
        StoreError: It cannot be written.
    """
    with replacing(path) as beside, beside.open("wb") as file:
        file.write(data.encode() if isinstance(data, str) else data)
        file.flush()
        os.fsync(file.fileno())
    return path


def sync_folder(folder: Path) -> None:
    """Write a folder's list of files to disk, where the system can do that."""
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # not supported by this file system
            raise
    finally:
        os.close(descriptor)


def put_folder(written: Path, root: Path, *, aside: Path) -> None:
    """Move a folder to its place, and replace a folder of the same name.

    If the process is killed, the old or the new folder is in place, or the old one is whole at `aside`.

    Args:
        aside: A path in the same file system for the old folder meanwhile; what is there is removed.
    """
    if root.exists():
        if aside.exists():
            shutil.rmtree(aside)
        root.rename(aside)
    written.rename(root)
    if aside.exists():
        shutil.rmtree(aside)


def is_on_network(path: Path) -> bool:
    """Return whether a path is on a network file system, as far as the system tells."""
    return _mount_of(path)[0] in _NETWORK


def _mount_of(path: Path) -> tuple[str, str]:
    """Return type and options of the file system that holds a path; empty where the system does not tell."""
    try:
        lines = _MOUNTS.read_text().splitlines()
        path = path.resolve()
    except OSError:
        return "", ""
    best, found = -1, ("", "")
    for line in lines:
        fields, _, rest = line.partition(" - ")
        place = Path(_ESCAPE.sub(lambda code: chr(int(code[1], 8)), fields.split()[4]))
        if (path == place or place in path.parents) and len(place.parts) >= best:  # the last of equal ones hides others
            kind, _, options = rest.split(" ", 2)
            best, found = len(place.parts), (kind, f"{fields.split()[5]},{options}")
    return found


def sha256_of_file(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, hexadecimal."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(1 << 20):
            digest.update(chunk)
    return digest.hexdigest()
