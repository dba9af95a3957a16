"""Download ProcTHOR-10k (Deitke et al., NeurIPS 2022: 10,000 + 1,000 + 1,000 houses), and find it on this machine.

The houses are files of git-lfs, which GitHub also serves by their addresses, so that neither git nor git-lfs is needed.
A file that `prior`, the package of the dataset's authors, has brought already is taken from its folder.
"""

import gzip
import os
import re
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Literal, NamedTuple

from pydantic import ValidationError

from evonav.downloads import TIMEOUT_S, download
from evonav.errors import HouseError, InvalidArgumentError, StoreError
from evonav.parallel.folders import sha256_of_file, write_atomically
from evonav.records import Record, sentence_of

Split = Literal["train", "val", "test"]

NAME = "procthor-10k"
SPLITS: tuple[Split, ...] = ("train", "val", "test")
SOURCE = "https://github.com/allenai/procthor-10k"
REVISION = "439193522244720b86d8c81cde2e51e3a4d150cf"
"""The commit for AI2-THOR 5.0 and later.

It is the head of `main`. The dataset's `main.py` and its maintainers (issue 10 of its repository) name it.
"""

COMMITS = f"https://api.github.com/repos/allenai/{NAME}/commits"
"""Say which commit a tag or a branch is."""
POINTERS = f"https://raw.githubusercontent.com/allenai/{NAME}"
"""Files as git stores them: of a file of git-lfs, the pointer that states its checksum."""
FILES = f"https://media.githubusercontent.com/media/allenai/{NAME}"
"""Files of git-lfs."""
_POINTER = re.compile(r"version https://git-lfs\.github\.com/spec/\S*\noid sha256:([0-9a-f]{64})\n")

MANIFEST_NAME = "manifest.json"
INSTEAD = (
    "The bundled houses need none of this (leave `--houses` out), and `--houses FILE` takes any ProcTHOR JSON or JSONL."
)


class DatasetError(HouseError):
    """A dataset cannot be fetched or used; the message ends with an alternative."""


class DatasetCorruptError(DatasetError):
    """A file differs from the published one: truncated, changed, or only a git-lfs pointer."""


class SplitFile(Record):
    """A file of houses, one house a line."""

    file: str
    num_houses: int
    sha256: str


class Manifest(Record):
    """The `manifest.json` beside the files: their contents and origin."""

    dataset: str
    source: str
    revision: str
    splits: dict[Split, SplitFile]


_HOUSES: dict[Split, tuple[int, str]] = {
    "train": (10_000, "ee3c4aa14b4d8f0895fecfb5fdaca59395427ca1018b2f9aeeedbc61e5824587"),
    "val": (1_000, "d808540514e26b6726cd2790490e669b572eeb94febb5188a2f403591dd21721"),
    "test": (1_000, "9a9fa6f134e76fe87f3fd92c00883651cf9fadf4e9ad4072d6d73be229f001dc"),
}
PUBLISHED: Mapping[str, Mapping[Split, SplitFile]] = MappingProxyType(
    {
        REVISION: {
            split: SplitFile(file=f"{split}.jsonl.gz", num_houses=num_houses, sha256=sha256)
            for split, (num_houses, sha256) in _HOUSES.items()
        }
    }
)
"""Counts stated by `main.py` and checksums stated by the git-lfs pointers, by revision."""


class HouseSet(NamedTuple):
    """A split of the dataset at a revision, as `procthor-10k:SPLIT[@REVISION]` names it."""

    split: Split
    revision: str


def house_set(text: str | Path) -> HouseSet:
    """Return the split that a `--houses` argument names.

    Raises:
        InvalidArgumentError: The argument names no split of the dataset.
    """
    name, _, rest = str(text).partition(":")
    split, _, revision = rest.partition("@")
    for known in SPLITS:
        if (name, split) == (NAME, known):
            return HouseSet(known, revision or REVISION)
    raise InvalidArgumentError(
        f"`{text}`: expected {NAME}:SPLIT or {NAME}:SPLIT@REVISION with SPLIT one of {', '.join(SPLITS)}"
    )


def cache_folder() -> Path:
    """Return the folder of fetched datasets: `$EVONAV_CACHE`, else `$XDG_CACHE_HOME/evonav`, else `~/.cache/evonav`."""
    if own := os.environ.get("EVONAV_CACHE"):
        return Path(own)
    shared = os.environ.get("XDG_CACHE_HOME", "")
    # The XDG specification demands that relative paths are ignored.
    return (Path(shared) if Path(shared).is_absolute() else Path.home() / ".cache") / "evonav"


def dataset_folder(revision: str = REVISION, cache: Path | None = None) -> Path:
    """Return the folder of a revision's files."""
    return (cache_folder() if cache is None else cache) / "houses" / NAME / revision


def split_path(houses: HouseSet, cache: Path | None = None) -> Path:
    """Return the file of a split, verified.

    Raises:
        DatasetError: The split was not fetched.
        DatasetCorruptError: The file or its manifest has changed.
    """
    folder = dataset_folder(houses.revision, cache)
    manifest = read_manifest(folder)
    if manifest is None or houses.split not in manifest.splits:
        at = "" if houses.revision == REVISION else f" --revision {houses.revision}"
        raise DatasetError(
            f"{NAME}:{houses.split} is not in {folder}. Fetch it: evonav houses fetch {NAME}{at}. {INSTEAD}"
        )
    entry = manifest.splits[houses.split]
    check_file(folder / entry.file, entry)
    return folder / entry.file


def read_manifest(folder: Path) -> Manifest | None:
    """Return the manifest of a folder; `None` if it has none.

    Raises:
        DatasetCorruptError: The manifest cannot be read, or contradicts the published checksums.
    """
    path = folder / MANIFEST_NAME
    try:
        manifest = Manifest.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        return None
    except (OSError, ValidationError) as error:
        problem = sentence_of(error) if isinstance(error, ValidationError) else error
        raise DatasetCorruptError(f"{path}: {problem}. Remove it and fetch again. {INSTEAD}") from error
    for split, entry in manifest.splits.items():
        published = PUBLISHED.get(manifest.revision, {}).get(split, entry)
        if entry != published or manifest.revision != folder.name:
            message = (
                f"{path}: {split}: {entry.sha256} is not the published sha256. Remove it and fetch again. {INSTEAD}"
            )
            raise DatasetCorruptError(message)
    return manifest


def check_file(path: Path, entry: SplitFile) -> None:
    """Compare a file with its checksum.

    Raises:
        DatasetCorruptError: The file differs, or does not exist.
    """
    try:
        digest = sha256_of_file(path)
    except OSError as error:
        raise DatasetCorruptError(
            f"{path}: {error.strerror}. Fetch again: evonav houses fetch {NAME}. {INSTEAD}"
        ) from error
    if digest != entry.sha256:
        message = (
            f"{path}: corrupt or truncated: its sha256 is {digest}, expected {entry.sha256}. "
            f"Fetch again: evonav houses fetch {NAME}. {INSTEAD}"
        )
        raise DatasetCorruptError(message)


def count_houses(path: Path) -> int:
    """Return the number of lines of a packed file, which is unpacked completely.

    Raises:
        DatasetCorruptError: The file is incomplete.
    """
    try:
        with gzip.open(path, "rb") as lines:
            return sum(1 for line in lines if line.strip())
    except (OSError, EOFError, zlib.error) as error:
        raise DatasetCorruptError(f"{path}: cannot be unpacked: {error}. {INSTEAD}") from error


class Fetched(NamedTuple):
    """The files that a call left in the cache."""

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
    """Download splits of ProcTHOR-10k into the cache; files that are there and whole are only verified.

    Args:
        revision: Commit id, tag or branch of the dataset's repository.
        cache: Folder to use instead of `cache_folder()`.
        on_progress: Called with what is being done.

    Raises:
        DatasetError: The message says what is in the way.
    """
    commit = _commit_of(revision)
    folder = dataset_folder(commit, cache)
    there, broken = _whole_files(folder, splits)
    wanted = tuple(split for split in splits if split not in there)
    if broken:
        on_progress(f"{broken}; fetching it again")
    for split in wanted:
        on_progress(f"downloading {split}")
        there[split] = _fetch_split(commit, split, folder)
    manifest = Manifest(dataset=NAME, source=SOURCE, revision=commit, splits=there)
    if wanted:
        with _typed_errors(str(folder / MANIFEST_NAME)):
            write_atomically(folder / MANIFEST_NAME, manifest.model_dump_json(indent=2) + "\n")
    return Fetched(folder, manifest, wanted)


def _whole_files(folder: Path, splits: Sequence[Split]) -> tuple[dict[Split, SplitFile], str]:
    """Return the files of an earlier call that still have their checksums, and what is wrong with the others."""
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
    """Return the commit id of a revision; a full id is returned as it is, without a request."""
    if re.fullmatch(r"[0-9a-f]{40}", revision):
        return revision
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._/-]*", revision):
        raise DatasetError(
            f"`{revision}` is no revision: expected a commit id of 40 digits, a tag or a branch. {INSTEAD}"
        )
    return _text(f"{COMMITS}/{revision}").strip()


def _fetch_split(commit: str, split: Split, folder: Path) -> SplitFile:
    """Bring the file of a split to its place; it is the one that the commit names."""
    path = folder / f"{split}.jsonl.gz"
    published = PUBLISHED.get(commit, {}).get(split)
    sha256 = published.sha256 if published else _stated_checksum(commit, path.name)
    _take_from_prior(commit, path, sha256)
    url = f"{FILES}/{commit}/{path.name}"
    with _typed_errors(url):
        download(url, path, sha256)
    return published or SplitFile(file=path.name, num_houses=count_houses(path), sha256=sha256)


def _stated_checksum(commit: str, name: str) -> str:
    """Return the checksum that the git-lfs pointer in a commit states."""
    url = f"{POINTERS}/{commit}/{name}"
    pointer = _POINTER.match(_text(url))
    if pointer is None:
        raise DatasetCorruptError(f"{url}: no git-lfs pointer, so that the houses cannot be verified. {INSTEAD}")
    return pointer[1]


def _take_from_prior(commit: str, path: Path, sha256: str) -> None:
    """Copy a file from where `prior` stores it, if it is there and whole."""
    stored = Path.home() / ".prior" / "datasets" / "allenai" / NAME / commit / path.name
    if stored.is_file() and sha256_of_file(stored) == sha256:
        with _typed_errors(str(path)):
            write_atomically(path, stored.read_bytes())


def _text(url: str) -> str:
    """Return a short text from GitHub."""
    import requests

    with _typed_errors(url):
        answer = requests.get(url, headers={"Accept": "application/vnd.github.sha"}, timeout=TIMEOUT_S)
        answer.raise_for_status()
        text: str = answer.text
    return text


@contextmanager
def _typed_errors(what: str) -> Iterator[None]:
    """Raise a failure of a download as the dataset error of its cause.

    Args:
        what: Address or path that the failure is about.
    """
    from requests import HTTPError, RequestException

    try:
        yield
    except HTTPError as error:
        raise _refusal(what, error.response.status_code) from error
    except RequestException as error:
        raise DatasetError(f"{what}: the host cannot be reached ({_short(error)}). {INSTEAD}") from error
    except ValueError as error:
        raise DatasetCorruptError(f"{what}: corrupt: {_short(error)}. {INSTEAD}") from error
    except (OSError, StoreError) as error:
        raise DatasetError(f"{what}: {_short(error)}. {INSTEAD}") from error


def _refusal(url: str, status: int) -> DatasetError:
    if status in (403, 429):
        return DatasetError(
            f"{url}: GitHub refuses more requests for now (status {status}: rate limit or git-lfs bandwidth); wait an "
            f"hour. {INSTEAD}"
        )
    if status in (401, 404, 422):
        return DatasetError(
            f"{url}: no such repository, revision or file, or it is private (status {status}). {INSTEAD}"
        )
    return DatasetError(f"{url}: the host failed (status {status}); try again later. {INSTEAD}")


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
