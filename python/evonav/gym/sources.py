"""Choose the tasks of episodes: those of a folder, or of houses, for which they are generated when they are chosen."""

import re
from functools import lru_cache
from pathlib import Path

import numpy as np

from evonav.errors import InvalidArgumentError, TaskError
from evonav.generation.dataset import inherited_names
from evonav.generation.pipeline import TaskRejectedError, generate_task
from evonav.gym.spaces import MAX_STAGES
from evonav.house import House
from evonav.house.files import HouseText, HouseTexts
from evonav.tasks.files import load_task
from evonav.tasks.listing import BUNDLED_TASKS, task_roots
from evonav.tasks.manifest import Task
from evonav.tasks.subsets import subset_roots

NUM_DRAWN = 2**31
"""Number of tasks of houses that may be drawn."""
MAX_HOUSES_TRIED = 200
"""Houses in a row without a task after which there is none; of ProcTHOR's houses, one in five has a single room."""
_NUM_CACHED = 64
"""Generated tasks that are kept in memory, about 1 MB each."""


class FolderTasks:
    """The tasks of a folder, each read when it is first chosen."""

    def __init__(self, tasks: Path | str | None = None, *, subset: str | None = None) -> None:
        """List the tasks.

        Args:
            tasks: Folder of tasks as `evonav tasks generate` makes them; by default the bundled ones, which are of the
                test split.
            subset: Named subset of the folder, such as `train-90`; by default all tasks.

        Raises:
            TaskError: The folder has no tasks, or not the subset.
        """
        folder = BUNDLED_TASKS if tasks is None else Path(tasks)
        self.roots = tuple(task_roots(folder) if subset is None else subset_roots(folder, subset))
        self._load = lru_cache(maxsize=256)(lambda root: _checked(load_task(root), str(root)))

    def __len__(self) -> int:
        return len(self.roots)

    def draw(self, random: np.random.Generator) -> int:
        """Draw the number of a task uniformly."""
        return int(random.integers(len(self.roots)))

    def find(self, name: str) -> int:
        """Return the number of the task with an id.

        Raises:
            InvalidArgumentError: The task does not exist.
        """
        for number, root in enumerate(self.roots):
            if root.name == name:
                return number
        raise InvalidArgumentError(f"option `task` is {name!r}: {self.roots[0].parent} holds no such task")

    def task(self, number: int) -> Task:
        """Read a task.

        Raises:
            TaskError: The task is malformed.
        """
        return self._load(self.roots[number])


class HouseTasks:
    """The tasks of houses, each generated when it is chosen.

    A number decides the house and everything that is drawn for its task: of N houses it is that of the number modulo
    N, of endless ones that of the number itself. If a house gives no task, the next one is taken.
    """

    def __init__(self, houses: Path | str) -> None:
        """Open the houses; their text is kept in memory, unless they are endless.

        Raises:
            HouseError: They cannot be read.
            InvalidArgumentError: They are named wrongly.
        """
        texts = HouseTexts(houses)
        self.name = texts.name
        self._endless = texts.endless if texts.is_endless else None
        self._texts: tuple[HouseText, ...] = () if texts.is_endless else tuple(texts)
        self._dataset, self._split = inherited_names(texts)
        self._made = lru_cache(maxsize=_NUM_CACHED)(self._make)

    def draw(self, random: np.random.Generator) -> int:
        """Draw the number of a task uniformly."""
        return int(random.integers(NUM_DRAWN))

    def find(self, name: str) -> int:
        """Return the number of the task of a house, named as `endless:7:3`: one of its possible tasks.

        Raises:
            InvalidArgumentError: The name is none of these houses.
        """
        found = re.fullmatch(rf"{re.escape(self.name)}:([1-9]\d{{0,9}})", name)
        number = int(found[1]) - 1 if found else -1
        if not 0 <= number < (NUM_DRAWN if self._endless else len(self._texts)):
            raise InvalidArgumentError(f"option `task` is {name!r}: expected a house, such as '{self.name}:3'")
        return number

    def task(self, number: int) -> Task:
        """Generate a task.

        Raises:
            HouseError: A house is malformed.
            TaskError: Many houses in a row give no task.
        """
        return self._made(number)

    def _make(self, number: int) -> Task:
        for tried in range(MAX_HOUSES_TRIED):
            name, text = self._house(number + tried)
            try:
                task = generate_task(House(text, name=name), seed=number, dataset=self._dataset, split=self._split)
            except TaskRejectedError as error:
                last = error
                continue
            return _checked(task, name)
        raise TaskError(f"{self.name}: {MAX_HOUSES_TRIED} houses in a row give no task; the last one: {last}")

    def _house(self, number: int) -> HouseText:
        if self._endless is not None:
            return HouseText(*self._endless.house(number + 1))
        return self._texts[number % len(self._texts)]


TaskSource = FolderTasks | HouseTasks
"""Numbered tasks, from which episodes are drawn."""


def task_source(
    tasks: Path | str | None = None, houses: Path | str | None = None, subset: str | None = None
) -> TaskSource:
    """Return the tasks of a folder or of houses.

    Args:
        tasks: Folder of tasks; the bundled ones if neither is given.
        houses: Houses, as `evonav.house.stream_houses` takes them.

    Raises:
        InvalidArgumentError: Both are given, or a subset of houses.
        HouseError: The houses cannot be read.
        TaskError: The folder has no tasks, or not the subset.
    """
    if houses is None:
        return FolderTasks(tasks, subset=subset)
    other = "tasks" if tasks is not None else "subset" if subset is not None else None
    if other is not None:
        raise InvalidArgumentError(f"argument `houses` is {str(houses)!r}: there is no `{other}` beside houses")
    return HouseTasks(houses)


def _checked(task: Task, name: str) -> Task:
    if any(stage.during is not None for stage in task.oracle_stages):
        message = "its house changes during stages (extension `during_stage`), which Gymnasium does not play"
        raise InvalidArgumentError(f"{name}: {message}")
    if task.num_stages > MAX_STAGES:
        raise InvalidArgumentError(f"{name}: has {task.num_stages} stages, expected at most {MAX_STAGES}")
    return task
