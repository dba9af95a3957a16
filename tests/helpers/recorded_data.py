"""Find the data sets that are not in the repository; docs/data-sets.md lists them and where they come from."""

import os
from pathlib import Path

import pytest

VARIABLE = "EVONAV_DATA"
DATA_SETS = {
    "cs-gavin-procthor10k-train10-frames",
    "kunalmessi10-procthor-100k-eval",
    "michael-quinlan-hallway-houses",
    "molmospaces-resources",
    "piqiuni-molmospaces-procthor10k",
    "procthor-databases",
    "ram81-procthor-100k-history",
    "ram81-procthor-1k",
    "ram81-procthor-one-room",
    "robothor-challenge-val",
    "roseh-procthor-100k-history",
    "zhiyuan-gao-procthor-houses",
}
"""Folders that docs/data-sets.md describes."""
BESIDE_THE_CHECKOUT = Path(__file__).parents[3] / "shared" / "data"


def data_folder() -> Path:
    """Return the folder of data sets: `$EVONAV_DATA`, else the one beside the checkout, which may be missing.

    Raises:
        NotADirectoryError: The variable is set, but not to a folder.
    """
    named = os.environ.get(VARIABLE)
    if named is None:
        return BESIDE_THE_CHECKOUT
    if not Path(named).is_dir():
        raise NotADirectoryError(f"{VARIABLE} is {named!r}, which is not a folder: name the folder of data sets")
    return Path(named)


def data_path(name: str) -> Path:
    """Return the path of a file or folder of the data sets, which may be missing.

    Args:
        name: Relative to the folder of data sets.
    """
    assert Path(name).parts[0] in DATA_SETS, f"{name} is in no data set that docs/data-sets.md describes"
    return data_folder() / name


def why_skipped(*names: str) -> str | None:
    """Return why tests of these data cannot run; `None` if all of them are there."""
    missing = [name for name in names if not data_path(name).exists()]
    if not missing:
        return None
    return f"{', '.join(missing)} not found: set {VARIABLE} to a folder that has it (docs/data-sets.md, Data sets)"


def needs_data(*names: str) -> pytest.MarkDecorator:
    """Return the mark that skips a test where one of these files or folders of the data sets is missing."""
    reason = why_skipped(*names)
    return pytest.mark.skipif(reason is not None, reason=reason or "")
