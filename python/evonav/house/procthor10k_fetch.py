"""Download ProcTHOR-10k from the repository it is published in.

The houses are files of git-lfs, which GitHub also serves by their addresses, so that neither git nor git-lfs is needed.
A file that `prior`, the package of the dataset's authors, has brought already is taken from its folder.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from evonav.downloads import TIMEOUT_S, download
from evonav.errors import StoreError
from evonav.house.procthor10k import (
    INSTEAD,
    MANIFEST_NAME,
    NAME,
    PUBLISHED,
    REVISION,
    SOURCE,
    SPLITS,
    DatasetAccessError,
    DatasetCorruptError,
    DatasetError,
    DatasetNetworkError,
    DatasetQuotaError,
    Manifest,
    Split,
    SplitFile,
    check_file,
    count_houses,
    dataset_folder,
    read_manifest,
)
from evonav.parallel.folders import sha256_of_file, write_atomically

COMMITS = f"https://api.github.com/repos/allenai/{NAME}/commits"
"""Say which commit a tag or a branch is."""
POINTERS = f"https://raw.githubusercontent.com/allenai/{NAME}"
"""Files as git stores them: of a file of git-lfs, the pointer that states its checksum."""
FILES = f"https://media.githubusercontent.com/media/allenai/{NAME}"
"""Files of git-lfs."""
_POINTER = re.compile(r"version https://git-lfs\.github\.com/spec/\S*\noid sha256:([0-9a-f]{64})\n")


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
        DatasetError: One of its kinds says what is in the way.
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
        raise DatasetAccessError(
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
        raise DatasetNetworkError(f"{what}: the host cannot be reached ({_short(error)}). {INSTEAD}") from error
    except ValueError as error:
        raise DatasetCorruptError(f"{what}: corrupt: {_short(error)}. {INSTEAD}") from error
    except (OSError, StoreError) as error:
        raise DatasetError(f"{what}: {_short(error)}. {INSTEAD}") from error


def _refusal(url: str, status: int) -> DatasetError:
    if status in (403, 429):
        return DatasetQuotaError(
            f"{url}: GitHub refuses more requests for now (status {status}: rate limit or git-lfs bandwidth); wait an "
            f"hour. {INSTEAD}"
        )
    if status in (401, 404, 422):
        return DatasetAccessError(
            f"{url}: no such repository, revision or file, or it is private (status {status}). {INSTEAD}"
        )
    return DatasetNetworkError(f"{url}: the host failed (status {status}); try again later. {INSTEAD}")


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
