"""List the tasks of a folder by their headers, without reading the rest of their files."""

import json
from dataclasses import dataclass
from pathlib import Path

from evonav.errors import TaskError
from evonav.house.files import BUNDLED
from evonav.tasks.records import sha256_of
from evonav.tasks.subsets import subset_roots

BUNDLED_TASKS = Path(__file__).parents[1] / "data" / "tasks"
"""Folder of the tasks that come with evonav."""


@dataclass(frozen=True, slots=True)
class TaskFile:
    """A task on disk."""

    task_id: str
    path: Path
    """The task's own folder."""
    num_stages: int
    digest: str
    """The SHA-256 of `task.json`, which holds the checksums of all other files."""


def task_folder(name: Path | str | None) -> Path:
    """Return a folder of tasks; the bundled one without a name, and for the word `bundled` if no folder has this name.

    It need not exist.
    """
    folder = Path(name or BUNDLED)
    return BUNDLED_TASKS if str(folder) == BUNDLED and not folder.exists() else folder


def task_files(directory: Path, limit: int | None = None, subset: str | None = None) -> list[TaskFile]:
    """List the tasks of a folder in order of task id; only their headers are read.

    Args:
        limit: Number of tasks to list, from the first; default all.
        subset: List only the tasks of this named subset (`evonav.tasks.subsets`).

    Raises:
        TaskError: The folder holds no task or too few for the subset, or a header is malformed.
    """
    roots = task_roots(directory) if subset is None else subset_roots(directory, subset)
    return [task_file(root) for root in roots[:limit]]


def task_file(root: Path) -> TaskFile:
    """Read the header of the task in a folder.

    Raises:
        TaskError: The header is missing or malformed.
    """
    path = root / "task.json"
    try:
        data = path.read_bytes()
        num_stages = int(json.loads(data)["num_stages"])
    except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise TaskError(f"{path}: no task header ({type(error).__name__}: {error})") from error
    return TaskFile(root.name, root, num_stages, sha256_of(data))


def task_roots(directory: Path) -> list[Path]:
    """List the folders of the tasks in a folder, in order of task id.

    Raises:
        TaskError: The folder holds no task or cannot be read.
    """
    try:
        roots = sorted(path.parent for path in directory.glob("*/task.json"))
    except OSError as error:
        raise TaskError(f"{directory}: cannot be read: {error.strerror or error}") from error
    if not roots:
        raise TaskError(f"{directory}: {_why_no_task(directory)}")
    return roots


def _why_no_task(directory: Path) -> str:
    """Say why a folder holds no task, and what to do."""
    if (directory / "task.json").is_file():
        return f"is a task itself: name the folder that holds it, {directory.parent}"
    if not directory.exists():
        return "holds no task, there is no such folder; `evonav tasks generate` makes one, bundled tasks need none"
    if not directory.is_dir():
        return "holds no task, it is a file: name a folder of tasks"
    return "holds no task (expected */task.json); `evonav tasks generate` makes some"
