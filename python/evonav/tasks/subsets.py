"""Choose named subsets that are the same for everyone: `test-90` is ninety tasks of the test split.

A subset `SPLIT-N` orders the houses of a split that give a task by `sha256("evonav-subset-1:" + sha256 of the house)`,
each house once, and takes the first N. So it depends on the content of the houses alone, not on file names, the order
of houses or the number of processes; and `test-90` begins with `test-10`. The paper's "10% subset" of its test split is
90 of 776 tasks, 11.6% (docs/parity.md).
"""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from evonav.errors import TaskError
from evonav.tasks.dataset import DATASET_NAME, DatasetRecord, TaskEntry, read_dataset
from evonav.tasks.records import sha256_of

_SALT = "evonav-subset-1:"


class SubsetError(TaskError):
    """A subset's name is malformed, or a set of tasks does not contain the subset."""


class Subset(NamedTuple):
    """The parts of a subset's name."""

    split: str
    num_tasks: int

    def __str__(self) -> str:
        return f"{self.split}-{self.num_tasks}"


def parse_subset(name: str) -> Subset:
    """Parse a subset's name such as `test-90`.

    Raises:
        SubsetError: The name is malformed.
    """
    match = re.fullmatch(r"(.+)-([1-9][0-9]{0,8})", name)
    if match is None:
        raise SubsetError(f"subset {name!r}: expected SPLIT-N, such as test-90")
    return Subset(match[1], int(match[2]))


def subset_key(house_sha256: str) -> str:
    """Return the key that orders houses, made of a house's `sha256` in task headers."""
    return sha256_of((_SALT + house_sha256).encode())


def subset_of(dataset: DatasetRecord, name: str) -> tuple[TaskEntry, ...]:
    """Return the tasks of a named subset, in order of task id.

    Raises:
        SubsetError: The name is malformed, the data set is of another split, or it has too few tasks.
    """
    subset = parse_subset(name)
    if subset.split != dataset.split:
        raise SubsetError(f"subset {name!r}: the tasks are of split {dataset.split!r}, not of {subset.split!r}")
    if dataset.limit is not None and dataset.num_tasks >= dataset.limit:
        raise SubsetError(f"subset {name!r}: the tasks are the first {dataset.limit} of their split, not all")
    return tuple(sorted(choose(dataset.tasks, subset), key=lambda entry: entry.task_id))


def subset_roots(folder: Path | str, name: str) -> list[Path]:
    """Return the folders of a named subset's tasks, in order of task id.

    Args:
        folder: Folder of the tasks and their `dataset.json`.
        name: Name of the subset, such as `test-90`.

    Raises:
        SubsetError: The name is malformed, the data set has too few tasks, or a task of the subset does not exist.
        TaskError: `dataset.json` is missing or malformed.
    """
    parse_subset(name)
    if not (Path(folder) / DATASET_NAME).is_file():
        raise SubsetError(
            f"subset {name!r}: {folder} has no {DATASET_NAME}, which `evonav tasks generate` writes and named subsets "
            "need; a limit takes the first N of any folder"
        )
    roots = [Path(folder) / entry.task_id for entry in subset_of(read_dataset(folder), name)]
    for root in roots:
        if not (root / "task.json").is_file():
            raise SubsetError(f"subset {name!r}: {root} is not there")
    return roots


def choose(entries: Iterable[TaskEntry], subset: Subset) -> list[TaskEntry]:
    """Return the first tasks in the order of subsets.

    Raises:
        SubsetError: There are too few houses.
    """
    by_house: dict[str, TaskEntry] = {}
    for entry in sorted(entries, key=lambda entry: entry.task_id):
        by_house.setdefault(entry.house_sha256, entry)
    ordered = sorted(by_house.values(), key=lambda entry: subset_key(entry.house_sha256))
    if len(ordered) < subset.num_tasks:
        raise SubsetError(f"subset '{subset}': only {len(ordered)} houses give a task")
    return ordered[: subset.num_tasks]
