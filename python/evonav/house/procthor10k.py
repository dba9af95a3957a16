"""Find ProcTHOR-10k on this machine (Deitke et al., NeurIPS 2022): 10,000 + 1,000 + 1,000 houses.

`evonav.house.procthor10k_fetch` downloads the houses; this module finds their files and verifies them.
"""

import gzip
import os
import zlib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Literal, NamedTuple

from pydantic import ValidationError

from evonav.errors import HouseError, InvalidArgumentError
from evonav.parallel.folders import sha256_of_file
from evonav.records import Record, sentence_of

Split = Literal["train", "val", "test"]

NAME = "procthor-10k"
SPLITS: tuple[Split, ...] = ("train", "val", "test")
SOURCE = "https://github.com/allenai/procthor-10k"
REVISION = "439193522244720b86d8c81cde2e51e3a4d150cf"
"""The commit for AI2-THOR 5.0 and later.

It is the head of `main`. The dataset's `main.py` and its maintainers (issue 10 of its repository) name it.
"""

MANIFEST_NAME = "manifest.json"
INSTEAD = (
    "The bundled houses need none of this (leave `--houses` out), and `--houses FILE` takes any ProcTHOR JSON or JSONL."
)


class DatasetError(HouseError):
    """A dataset cannot be fetched or used; the message ends with an alternative."""


class DatasetMissingError(DatasetError):
    """The dataset was never fetched."""


class DatasetNetworkError(DatasetError):
    """The dataset's host cannot be reached."""


class DatasetQuotaError(DatasetError):
    """The host refuses too many requests: a rate limit, or the bandwidth of git-lfs."""


class DatasetAccessError(DatasetError):
    """The host does not have this repository or revision, or it is private."""


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
        DatasetMissingError: The split was not fetched.
        DatasetCorruptError: The file or its manifest has changed.
    """
    folder = dataset_folder(houses.revision, cache)
    manifest = read_manifest(folder)
    if manifest is None or houses.split not in manifest.splits:
        at = "" if houses.revision == REVISION else f" --revision {houses.revision}"
        raise DatasetMissingError(
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
