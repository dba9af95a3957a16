"""The houses `evonav-10k:train`, `:val` and `:test`: made from seeds when they are first used, then kept.

They have the sizes of ProcTHOR-10k's splits and the assets of the split of their name. The checksums below are those of
the houses' text, one a line, which does not depend on how a file is packed. Positions are rounded to 0.1 mm and angles
to 0.001 degrees before they are written, so the last bits of a machine's sines and powers do not show. A generator that
makes other houses must get another name; other sizes or shapes of assets make other houses, too.
"""

import gzip
import hashlib
import json
import re
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from evonav.errors import HouseError, InvalidArgumentError
from evonav.house.generated import MakingProgress, make_houses
from evonav.house.procthor10k import Split, cache_folder
from evonav.parallel.folders import writing
from evonav.parallel.worker import Workforce

NAME = "evonav-10k"
_READ_BYTES = 1 << 20


class MadeSplit(NamedTuple):
    """A split: what decides its houses, and their checksum."""

    seed: int
    num_houses: int
    sha256: str
    """Checksum of the text of all houses, one a line."""


SPLITS: Mapping[Split, MadeSplit] = MappingProxyType(
    {
        "train": MadeSplit(10_001, 10_000, "4daef48635bb731ff05b6cf466030bf8e0dc9c75dd73714f93c07bb7cd694f41"),
        "val": MadeSplit(10_002, 1_000, "befe1fd499de7374ceaab61b3ee8666ab58832bbd3725d2ac7d3268bf8bd0d8b"),
        "test": MadeSplit(10_003, 1_000, "260cb3bc0d787786181dd3857648381cf28e73f4d976e4ce83d3619a3984153b"),
    }
)


def named_split(text: str) -> Split:
    """Return the split that `evonav-10k:SPLIT` names.

    Raises:
        InvalidArgumentError: The text names none.
    """
    for split in SPLITS:
        if text == f"{NAME}:{split}":
            return split
    raise InvalidArgumentError(
        f"`{text}`: expected {NAME}:SPLIT or {NAME}:SPLIT:N with SPLIT one of {', '.join(SPLITS)}, and N from 1"
    )


def split_to_make(name: str, cache: Path | None = None) -> Split | None:
    """Return the split that `evonav-10k:SPLIT` or `evonav-10k:SPLIT:N` names, if it was not made yet."""
    found = re.fullmatch(rf"{NAME}:(\w+)(:[1-9]\d*)?", name)
    wanted = (split for split in SPLITS if found and found[1] == split and not split_path(split, cache).exists())
    return next(wanted, None)


def split_path(split: Split, cache: Path | None = None) -> Path:
    """Return where the houses of a split are kept, whether they were made or not."""
    return (cache_folder() if cache is None else cache) / "houses" / NAME / f"{split}.jsonl.gz"


def made_split(
    split: Split,
    *,
    cache: Path | None = None,
    workforce: Workforce | None = None,
    on_progress: Callable[[MakingProgress], None] = lambda _: None,
) -> Path:
    """Return the file of a split, checked; make it if it is not there, and go on if it was interrupted.

    Args:
        cache: Folder of datasets. Default: `EVONAV_CACHE`, else `~/.cache/evonav`.
        workforce: The workers that make houses. Default: this process.
        on_progress: Called at the beginning and after every house that is made.

    Raises:
        HouseError: The file does not hold the houses of its name.
        StoreError: It cannot be written, or another process is making it.
    """
    path, made = split_path(split, cache), SPLITS[split]
    if not path.exists():
        with writing(path.parent):
            if not path.exists():  # another process may have made it meanwhile
                make_houses(
                    path,
                    made.num_houses,
                    seed=made.seed,
                    parameters=json.dumps({"split": split}),
                    workforce=workforce,
                    on_progress=on_progress,
                )
    digest = _sha256_of_text(path)
    if digest != made.sha256:
        raise HouseError(
            f"{path}: its houses have the sha256 {digest}, expected {made.sha256} for {NAME}:{split}. If the file was "
            "changed, remove it, and it is made again. If it was made just now, this machine makes other houses than "
            f"those of the name: please report that. `endless:{made.seed}` makes houses without such a promise."
        )
    return path


def _sha256_of_text(path: Path) -> str:
    """Return the SHA-256 of an unpacked file."""
    digest = hashlib.sha256()
    try:
        with gzip.open(path, "rb") as text:
            while chunk := text.read(_READ_BYTES):
                digest.update(chunk)
    except (OSError, EOFError, zlib.error) as error:
        raise HouseError(f"{path}: cannot be unpacked: {error}. Remove it, and {NAME} is made again.") from error
    return digest.hexdigest()
