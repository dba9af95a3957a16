"""Choose the tasks of an environment, and read what it needs of them."""

from functools import lru_cache
from pathlib import Path

import numpy as np

from evonav.errors import InvalidArgumentError
from evonav.gym.spaces import MAX_STAGES
from evonav.tasks.bundled import bundled_tasks
from evonav.tasks.files import load_task
from evonav.tasks.listing import task_roots
from evonav.tasks.manifest import Task
from evonav.tasks.subsets import subset_roots


class TaskSource:
    """The tasks of a folder, each read when it is first chosen."""

    def __init__(self, tasks: Path | str | None = None, *, subset: str | None = None) -> None:
        """List the tasks.

        Args:
            tasks: Folder of tasks as `evonav generate` makes them; by default the bundled ones, which are of the test
                split.
            subset: Named subset of the folder, such as `train-90`; by default all tasks.

        Raises:
            TaskError: The folder has no tasks, or not the subset.
        """
        folder = _bundled() if tasks is None else Path(tasks)
        self.roots = tuple(task_roots(folder) if subset is None else subset_roots(folder, subset))
        self._load = lru_cache(maxsize=256)(_read)

    def __len__(self) -> int:
        return len(self.roots)

    def draw(self, random: np.random.Generator) -> int:
        """Draw the number of a task uniformly."""
        return int(random.integers(len(self.roots)))

    def find(self, task_id: str) -> int:
        """Return the number of a task.

        Raises:
            InvalidArgumentError: The task does not exist.
        """
        for number, root in enumerate(self.roots):
            if root.name == task_id:
                return number
        raise InvalidArgumentError(f"option `task` is {task_id!r}: {self.roots[0].parent} holds no such task")

    def task(self, number: int) -> Task:
        """Read a task.

        Raises:
            TaskError: The task is malformed.
        """
        return self._load(self.roots[number])


def _read(root: Path) -> Task:
    task = load_task(root)
    if task.num_stages > MAX_STAGES:
        raise InvalidArgumentError(f"{root}: has {task.num_stages} stages, expected at most {MAX_STAGES}")
    return task


def _bundled() -> Path:
    with bundled_tasks() as folder:
        return folder
