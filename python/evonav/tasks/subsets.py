"""Named subsets, the same for everyone: `test-90` is ninety tasks of the test split.

A subset `SPLIT-N` takes the houses of a split that give a task in the order of
`sha256("evonav-subset-1:" + sha256 of the house)`, each once, and of these the first N. So it depends on what is in the
houses, and on nothing else: not on file names, on the order of houses or on how many processes made the tasks; and
`test-90` begins as `test-10` does. The paper's "10% subset" of its test split is 90 of 776 tasks, 11.6%
(docs/parity.md).
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
    """A subset that is not one, or that a set of tasks does not hold."""


class Subset(NamedTuple):
    """What a subset's name says."""

    split: str
    num_tasks: int

    def __str__(self) -> str:
        return f"{self.split}-{self.num_tasks}"


def parse_subset(name: str) -> Subset:
    """Takes a name such as `test-90` apart.

    Raises:
        SubsetError: It is no such name.
    """
    match = re.fullmatch(r"(.+)-([1-9][0-9]{0,8})", name)
    if match is None:
        raise SubsetError(f"subset {name!r}: expected SPLIT-N, such as test-90")
    return Subset(match[1], int(match[2]))


def subset_key(house_sha256: str) -> str:
    """What houses are ordered by: of a house's `sha256` as task headers hold it."""
    return sha256_of((_SALT + house_sha256).encode())


def subset_of(dataset: DatasetRecord, name: str) -> tuple[TaskEntry, ...]:
    """The tasks of a named subset, in order of task id.

    Raises:
        SubsetError: The name is none, the set is of another split, or it holds too few tasks.
    """
    subset = parse_subset(name)
    if subset.split != dataset.split:
        raise SubsetError(f"subset {name!r}: the tasks are of split {dataset.split!r}, not of {subset.split!r}")
    if dataset.limit is not None and dataset.num_tasks >= dataset.limit:
        raise SubsetError(f"subset {name!r}: the tasks are the first {dataset.limit} of their split, not all")
    return tuple(sorted(choose(dataset.tasks, subset), key=lambda entry: entry.task_id))


def subset_roots(folder: Path | str, name: str) -> list[Path]:
    """Folders of a named subset's tasks, in order of task id.

    Args:
        folder: Holds the tasks and their `dataset.json`.
        name: Such as `test-90`.

    Raises:
        SubsetError: As for `subset_of`, or a task of the subset is not there.
        TaskError: There is no `dataset.json`, or it is malformed.
    """
    parse_subset(name)
    if not (Path(folder) / DATASET_NAME).is_file():
        raise SubsetError(
            f"subset {name!r}: {folder} has no {DATASET_NAME}, which `evonav generate` writes and named subsets need; "
            "a limit takes the first N of any folder"
        )
    roots = [Path(folder) / entry.task_id for entry in subset_of(read_dataset(folder), name)]
    for root in roots:
        if not (root / "task.json").is_file():
            raise SubsetError(f"subset {name!r}: {root} is not there")
    return roots


def choose(entries: Iterable[TaskEntry], subset: Subset) -> list[TaskEntry]:
    """The first tasks in the order of subsets.

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
