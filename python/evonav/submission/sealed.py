"""Seal tasks for the key of an evaluator, so that nobody else can read them: a hidden test set.

Each task is a zip file in a sealed box of libsodium (X25519, XSalsa20 and Poly1305): anybody can seal for a public key,
and only the private key opens. File names are random; the index tells the numbers of tasks and stages and nothing else.
"""

import io
import json
import os
import secrets
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any

from evonav._core import __version__
from evonav.component import optional_module
from evonav.errors import InvalidArgumentError, StoreError, TaskError
from evonav.parallel.folders import write_atomically
from evonav.tasks.listing import KEY_VARIABLE, SEALED_NAME, UNSEALED_NAME, TaskFile, task_roots
from evonav.tasks.records import sha256_of

SUFFIX = ".sealed"
FORMAT, VERSION = "evonav-sealed-tasks", 1
_KEY_BYTES = 32
_PRIVATE, _PUBLIC = "evonav private key", "evonav public key"
_FIXED_TIME = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True, slots=True)
class SealedSet:
    """The index of a sealed set, which everybody may read."""

    public_key: str
    num_tasks: int
    num_stages: int
    files: dict[str, str]
    """SHA-256 by name of file."""


def new_key(path: Path) -> Path:
    """Make a pair of keys: the private one, which only this user can read, and the public one beside it, `.pub`.

    Returns:
        Path of the public key.

    Raises:
        StoreError: A file is there already, or cannot be written.
    """
    nacl = _nacl()
    public_path = path.with_name(f"{path.name}.pub")
    private = nacl.public.PrivateKey.generate()
    try:
        for place, word, key, mode in (
            (path, _PRIVATE, private, 0o600),
            (public_path, _PUBLIC, private.public_key, 0o644),
        ):
            with os.fdopen(os.open(place, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "w") as file:
                file.write(f"{word} {bytes(key).hex()}\n")
    except OSError as error:
        raise StoreError(f"{error.filename}: cannot be written: {error.strerror or error}") from error
    return public_path


def seal(tasks: Sequence[TaskFile], public_key: Path, out: Path) -> SealedSet:
    """Seal tasks into a new folder.

    Args:
        tasks: Tasks of one folder. With all of them, what else lies there, such as `dataset.json`, is sealed, too.
        public_key: File of `new_key`.
        out: Folder to write, which must be empty or missing.

    Raises:
        InvalidArgumentError: The file is no public key.
        TaskError: A file of a task cannot be read, or the folder of the tasks is sealed itself.
        StoreError: `out` is not empty, or cannot be written.
    """
    nacl = _nacl()
    key = _key(public_key, _PUBLIC)
    if out.exists() and any(out.iterdir()):
        raise StoreError(f"{out}: is not empty")
    box = nacl.public.SealedBox(nacl.public.PublicKey(key))
    root = tasks[0].path.parent
    beside: list[Path] = []
    if len(tasks) == len(task_roots(root)):  # `dataset.json` tells of all tasks
        beside = sorted(path for path in root.iterdir() if path.is_file() and path.name != UNSEALED_NAME)
    parts = [*(sorted(path for path in task.path.rglob("*") if path.is_file()) for task in tasks), beside]
    files = {}
    for part in parts:
        if part:
            data = box.encrypt(_zipped(part, root))
            name = f"{secrets.token_hex(8)}{SUFFIX}"
            write_atomically(out / name, data)
            files[name] = sha256_of(data)
    # By name, which is random: the index does not tell the order of the tasks.
    index = SealedSet(key.hex(), len(tasks), sum(task.num_stages for task in tasks), dict(sorted(files.items())))
    content = {"format": FORMAT, "version": VERSION, "evonav": __version__}
    content |= {name: getattr(index, name) for name in ("public_key", "num_tasks", "num_stages", "files")}
    write_atomically(out / SEALED_NAME, json.dumps(content, indent=2) + "\n")
    return index


def unseal(folder: Path, private_key: Path, out: Path) -> None:
    """Write the tasks of a sealed set to a folder.

    Args:
        folder: A sealed set.
        private_key: File of `new_key`.

    Raises:
        InvalidArgumentError: The file is no private key.
        TaskError: The set is sealed for another key, or a file of it is missing or was changed.
        StoreError: `out` cannot be written.
    """
    nacl = _nacl()
    index = read_index(folder)
    private = nacl.public.PrivateKey(_key(private_key, _PRIVATE))
    if bytes(private.public_key).hex() != index.public_key:
        raise TaskError(f"{folder}: is sealed for another key than {private_key}: {index.public_key[:16]}...")
    box = nacl.public.SealedBox(private)
    # First, so that even a part of a set is known as sealed.
    write_atomically(out / UNSEALED_NAME, json.dumps({"public_key": index.public_key}) + "\n")
    for name, digest in index.files.items():
        path = folder / name
        try:
            data = path.read_bytes()
            if sha256_of(data) != digest:
                raise TaskError(f"{path}: is not the file that was sealed: its checksum differs")
            _unzip(box.decrypt(data), out)
        except OSError as error:
            raise TaskError(f"{path}: cannot be read: {error.strerror or error}") from error
        except (nacl.exceptions.CryptoError, zipfile.BadZipFile) as error:
            raise TaskError(f"{path}: cannot be opened: {error}") from error


@contextmanager
def opened(folder: Path) -> Iterator[Path]:
    """Lend the tasks of a sealed set in a folder that only this user can read, and that is deleted at the end.

    Raises:
        InvalidArgumentError: `EVONAV_TASKS_KEY` does not name a private key.
        TaskError: `unseal` raises it.
    """
    key = os.environ.get(KEY_VARIABLE)
    if not key:
        raise InvalidArgumentError(f"{folder}: the tasks are sealed: set {KEY_VARIABLE} to the file of the private key")
    with TemporaryDirectory(prefix="evonav-unsealed-") as place:
        unseal(folder, Path(key), Path(place))
        yield Path(place)


def read_index(folder: Path) -> SealedSet:
    """Read the index of a sealed set.

    Raises:
        TaskError: It is missing or malformed.
    """
    path = folder / SEALED_NAME
    try:
        content: dict[str, Any] = json.loads(path.read_bytes())
        if content["format"] != FORMAT or content["version"] != VERSION:
            raise TaskError(f"{path}: format {content['format']} {content['version']}: this is {FORMAT} {VERSION}")
        files = {str(name): str(digest) for name, digest in content["files"].items()}
        if any(PurePosixPath(name).name != name or not name.endswith(SUFFIX) for name in files):
            raise TaskError(f"{path}: files: each must be a name that ends in {SUFFIX}")
        return SealedSet(str(content["public_key"]), int(content["num_tasks"]), int(content["num_stages"]), files)
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise TaskError(f"{path}: no index of sealed tasks ({type(error).__name__}: {error})") from error


def _nacl() -> Any:  # noqa: ANN401 - a module
    nacl = optional_module("nacl", "sealed tasks need PyNaCl", "'evonav[seal]'")
    for name in ("public", "exceptions"):
        optional_module(f"nacl.{name}", "sealed tasks need PyNaCl", "'evonav[seal]'")
    return nacl


def _key(path: Path, word: str) -> bytes:
    try:
        kind, _, digits = path.read_text().strip().rpartition(" ")
        key = bytes.fromhex(digits)
    except (OSError, ValueError) as error:
        raise InvalidArgumentError(f"{path}: no {word} ({type(error).__name__})") from error
    if kind != word or len(key) != _KEY_BYTES:
        raise InvalidArgumentError(f"{path}: is {kind or 'not'!r}: expected an {word} of `evonav tasks key`")
    return key


def _zipped(paths: Sequence[Path], root: Path) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in paths:
            try:
                content = path.read_bytes()
            except OSError as error:
                raise TaskError(f"{path}: cannot be read: {error.strerror or error}") from error
            archive.writestr(zipfile.ZipInfo(path.relative_to(root).as_posix(), _FIXED_TIME), content)
    return data.getvalue()


def _unzip(data: bytes, out: Path) -> None:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for member in archive.infolist():
            name = PurePosixPath(member.filename)
            if name.is_absolute() or ".." in name.parts or "\\" in member.filename:
                raise TaskError(f"{member.filename}: leads out of the set")
            write_atomically(out / name, archive.read(member))
