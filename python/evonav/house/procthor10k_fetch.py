"""Fetches ProcTHOR-10k with `prior`, the package it is published through.

`prior` clones the dataset's repository into `~/.prior/datasets`, has git-lfs bring the files and runs the repository's
`main.py`. It swallows what git says, trusts a clone that was cut short, and asks GitHub's rate-limited API for a commit
whose id it was given. So the clone is made here, under the name where `prior` looks for it, and only when it is whole.
"""

import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from evonav.house.dataset_errors import (
    DatasetAccessError,
    DatasetCorruptError,
    DatasetError,
    DatasetNetworkError,
    DatasetQuotaError,
    DatasetToolError,
)
from evonav.house.procthor10k import (
    INSTEAD,
    MANIFEST_NAME,
    NAME,
    PUBLISHED,
    REVISION,
    SOURCE,
    SPLITS,
    Manifest,
    Split,
    SplitFile,
    check_file,
    count_houses,
    dataset_folder,
    read_manifest,
)

_LFS_MARK = b"version https://git-lfs.github.com/spec/"
_STALLED = ("-c", "http.lowSpeedLimit=1000", "-c", "http.lowSpeedTime=60")
"""A connection that stands still is given up: git alone would wait for ever."""
_POINTERS = ("-c", "filter.lfs.smudge=", "-c", "filter.lfs.process=", "-c", "filter.lfs.required=false")

_CAUSES: tuple[tuple[type[DatasetError], str, str], ...] = (
    (
        DatasetQuotaError,
        r"rate.?limit|error: 429|error: 403|over its data quota|exceeded its LFS budget|Too Many Requests",
        "GitHub refuses more requests for now (rate limit or git-lfs bandwidth); wait an hour",
    ),
    (
        DatasetAccessError,
        r"could not read Username|Authentication failed|Repository not found|error: 40[14]|terminal prompts disabled"
        r"|does not appear to be a git repository|unable to read tree|not a tree|does not exist in",
        "no such repository or revision, or it is private",
    ),
    (
        DatasetNetworkError,
        r"Could ?n[o']t resolve|Failed to connect|Could ?n[o']t connect|Connection (refused|timed out|reset)"
        r"|Network is unreachable|unable to access|dial tcp|Max retries|timed out|too slow|no route to host",
        "the host cannot be reached",
    ),
)
_NO_LFS = "git-lfs is not installed (apt install git-lfs, brew install git-lfs), and `prior` could not bring its own"
_PRIOR = """
import sys
import prior
try:
    prior.load_dataset("procthor-10k", revision=sys.argv[1])
except Exception as error:
    sys.exit(f"prior: {type(error).__name__}: {error}")
"""


class Fetched(NamedTuple):
    """What a call left in the cache."""

    folder: Path
    manifest: Manifest
    new: tuple[Split, ...]
    """Splits that were not there before, or not whole."""


def fetch_procthor10k(
    revision: str = REVISION,
    splits: Sequence[Split] = SPLITS,
    *,
    cache: Path | None = None,
    on_progress: Callable[[str], None] = lambda _: None,
) -> Fetched:
    """Brings splits of ProcTHOR-10k into the cache; what is there and whole is only verified.

    Args:
        revision: Commit id, tag or branch of the dataset's repository.
        splits: Which files to keep (`prior` downloads all three).
        cache: Instead of `cache_folder()`.
        on_progress: Told what is being done.

    Raises:
        DatasetError: One of its kinds says what is in the way.
    """
    commit = _commit_of(revision)
    folder = dataset_folder(commit, cache)
    there, broken = _whole_files(folder, splits)
    wanted = [split for split in splits if split not in there]
    if broken:
        on_progress(f"{broken}; fetching it again")
    if wanted:
        if importlib.util.find_spec("prior") is None:
            message = f"the package `prior` is not installed: pip install 'evonav[thor]'. {INSTEAD}"
            raise DatasetToolError(message)
        clone = _clone(commit, on_progress)
        if not all(_is_whole(clone, commit, split) for split in wanted):
            on_progress("downloading (63 MB)")
            _run_prior(commit, clone)
        for split in wanted:
            on_progress(f"checking {split}")
            there[split] = _copy(clone, commit, split, folder)
        manifest = Manifest(dataset=NAME, source=SOURCE, revision=commit, splits=there)
        _write(folder / MANIFEST_NAME, (manifest.model_dump_json(indent=2) + "\n").encode())
    return Fetched(folder, Manifest(dataset=NAME, source=SOURCE, revision=commit, splits=there), tuple(wanted))


def _whole_files(folder: Path, splits: Sequence[Split]) -> tuple[dict[Split, SplitFile], str]:
    """Files of an earlier call that still have their checksums, and what was wrong with the others."""
    try:
        manifest = read_manifest(folder)
    except DatasetCorruptError as error:
        return {}, str(error)
    there: dict[Split, SplitFile] = {}
    broken = ""
    for split, entry in () if manifest is None else manifest.splits.items():
        try:
            if split in splits:
                check_file(folder / entry.file, entry)
            there[split] = entry
        except DatasetCorruptError as error:
            broken = str(error)
    return there, broken


def _commit_of(revision: str) -> str:
    """The commit id of a revision; a full id is taken as it is, without asking anyone."""
    if re.fullmatch(r"[0-9a-f]{40}", revision):
        return revision
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._/-]*", revision):
        message = f"`{revision}` is no revision: expected a commit id of 40 digits, a tag or a branch. {INSTEAD}"
        raise DatasetAccessError(message)
    names = [f"refs/tags/{revision}^{{}}", f"refs/tags/{revision}", f"refs/heads/{revision}"]
    lines = _git("ls-remote", f"{SOURCE}.git", *names).splitlines()
    commits = {name: commit for commit, _, name in (line.partition("\t") for line in lines)}
    for name in names:
        if name in commits:
            return commits[name]
    message = f"{SOURCE} has no revision `{revision}` (a commit is named by its full id). {INSTEAD}"
    raise DatasetAccessError(message)


def _clone(commit: str, on_progress: Callable[[str], None]) -> Path:
    """The folder where `prior` looks for a commit of the dataset, with a whole clone in it."""
    clone = _prior_folder() / "datasets/allenai" / NAME / commit
    if (clone / "main.py").is_file():
        return clone
    on_progress("cloning")
    try:
        clone.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=clone.parent, prefix=".clone-") as scratch:
            fresh = Path(scratch) / "clone"
            _git("clone", "--quiet", "--no-checkout", f"{SOURCE}.git", str(fresh))
            # The files of git-lfs come when `prior` asks for them, not while git checks out their pointers.
            _git("-C", str(fresh), *_POINTERS, "checkout", "--quiet", "--detach", commit)
            if clone.exists():  # what a `prior` that was cut short has left
                shutil.rmtree(clone)
            fresh.rename(clone)
    except OSError as error:
        message = f"{error.filename or clone}: {error.strerror or error}. {INSTEAD}"
        raise DatasetError(message) from error
    return clone


def _prior_folder() -> Path:
    return Path(os.environ.get("HOME") or Path.home()) / ".prior"


def _run_prior(commit: str, clone: Path) -> None:
    """`prior.load_dataset` in a process of its own: it changes the working directory and holds 1 GB of text."""
    done = subprocess.run(  # noqa: S603
        [sys.executable, "-c", _PRIOR, commit],
        env=_environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        check=False,
    )
    if done.returncode != 0:
        if shutil.which("git-lfs") is None and not (_prior_folder() / "git-lfs-3.2.0/git-lfs").is_file():
            raise DatasetToolError(_told(_NO_LFS, done.stderr))
        failure = _failure(done.stderr)
        if type(failure) is DatasetError:
            for split in SPLITS:
                _refuse_pointer(clone / f"{split}.jsonl.gz")
        raise failure


def _git(*arguments: str) -> str:
    git = shutil.which("git")
    if git is None:
        message = f"the program `git` is not installed. {INSTEAD}"
        raise DatasetToolError(message)
    done = subprocess.run(  # noqa: S603
        [git, *_STALLED, *arguments],
        env=_environment(),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    if done.returncode != 0:
        raise _failure(done.stderr)
    return done.stdout


def _environment() -> dict[str, str]:
    """Messages in English, and no question to the terminal."""
    return {**os.environ, "HOME": str(_prior_folder().parent), "LC_ALL": "C", "GIT_TERMINAL_PROMPT": "0"}


def _failure(said: str) -> DatasetError:
    for kind, pattern, explained in _CAUSES:
        if re.search(pattern, said, re.IGNORECASE):
            return kind(_told(explained, said))
    return DatasetError(_told("it failed", said))


def _told(explained: str, said: str) -> str:
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    telling = [line for line in lines if re.match(r"fatal|error|prior|batch", line, re.IGNORECASE)] or lines
    return f"{NAME} cannot be fetched from {SOURCE}: {explained}. It said: {' / '.join(telling[-2:])}. {INSTEAD}"


def _expected(clone: Path, commit: str, split: Split) -> str | None:
    """The checksum that was published: the git-lfs pointer in the commit; None where the file itself lies in git."""
    if commit in PUBLISHED:
        return PUBLISHED[commit][split].sha256
    blob = _git("-C", str(clone), "cat-file", "blob", f"{commit}:{split}.jsonl.gz")
    found = re.search(r"^oid sha256:([0-9a-f]{64})$", blob[:1024], re.MULTILINE)
    return found[1] if found and blob.encode(errors="replace").startswith(_LFS_MARK) else None


def _is_whole(clone: Path, commit: str, split: Split) -> bool:
    path = clone / f"{split}.jsonl.gz"
    expected = _expected(clone, commit, split)
    try:
        check_file(path, SplitFile(file=path.name, num_houses=0, sha256=expected or ""))
    except DatasetCorruptError:
        return expected is None and path.is_file()
    return True


def _refuse_pointer(path: Path) -> None:
    try:
        with path.open("rb") as file:
            start = file.read(len(_LFS_MARK))
    except OSError as error:
        message = f"{path}: {error.strerror}. Remove {path.parent} and fetch again. {INSTEAD}"
        raise DatasetCorruptError(message) from error
    if start == _LFS_MARK:
        message = (
            f"{path}: holds a git-lfs pointer, not the houses: git-lfs did not bring them. "
            f"Install git-lfs, remove {path.parent} and fetch again. {INSTEAD}"
        )
        raise DatasetCorruptError(message)


def _copy(clone: Path, commit: str, split: Split, folder: Path) -> SplitFile:
    """Copies a file, byte for byte, once it is proved to be the one that the commit names."""
    source = clone / f"{split}.jsonl.gz"
    _refuse_pointer(source)
    data = source.read_bytes()
    sha256 = _expected(clone, commit, split) or hashlib.sha256(data).hexdigest()
    entry = SplitFile(file=source.name, num_houses=0, sha256=sha256)
    check_file(source, entry)
    entry = entry.model_copy(update={"num_houses": count_houses(source)})
    published = PUBLISHED.get(commit, {}).get(split)
    if published is not None and entry != published:
        message = f"{source}: {entry.num_houses} houses, {published.num_houses} were published. {INSTEAD}"
        raise DatasetCorruptError(message)
    _write(folder / entry.file, data)
    return entry


def _write(path: Path, data: bytes) -> None:
    """Whole or not at all, also when cut short."""
    part = path.with_name(f"{path.name}.part-{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(data)
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        message = f"{path}: {error.strerror or error}. {INSTEAD}"
        raise DatasetError(message) from error
