"""What every command that fills a folder does: one writer at a time, one configuration, whole files, checksums."""

import hashlib
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from evonav.errors import StoreError

try:
    import fcntl
except ImportError:  # Windows has no such lock
    fcntl = None  # type: ignore[assignment]

LOCK_NAME = ".lock"


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Keeps a second writer out of a folder, which is made if need be; a writer that died keeps nobody out.

    Raises:
        StoreError: Another process is writing there, or the folder cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / LOCK_NAME).open("w")
    except OSError as error:
        raise StoreError(f"{folder}: {error}") from error
    with file:
        if fcntl is not None:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                raise StoreError(f"{folder}: another evonav is writing here") from error
        yield


def check_same_run(stored: Mapping[str, Any], asked: Mapping[str, Any], folder: Path) -> None:
    """A folder holds one run: the same configuration, or an error that names what differs.

    Raises:
        StoreError: Any entry differs; nested ones are named with dots.
    """
    there, here = _flat(stored), _flat(asked)
    differing = sorted(key for key in there.keys() | here.keys() if there.get(key) != here.get(key))
    if differing:
        lines = "; ".join(f"{key}: there {there.get(key)!r}, asked {here.get(key)!r}" for key in differing)
        raise StoreError(f"{folder} holds a run of another configuration ({lines}); use another folder")


def write_atomically(path: Path, text: str) -> None:
    """Writes beside and renames, so that a reader sees the old file or the new one.

    Raises:
        StoreError: It cannot be written.
    """
    beside = path.with_name(path.name + ".partial")
    try:
        with beside.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
    except OSError as error:
        raise StoreError(f"{path}: {error}") from error


def sha256_of_file(path: Path) -> str:
    """SHA-256 of a file's bytes, hexadecimal, a piece at a time.

    Raises:
        OSError: It cannot be read.
    """
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(1 << 20):
            digest.update(chunk)
    return digest.hexdigest()


def _flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{key}.")
        else:
            flat[prefix + key] = value
    return flat
