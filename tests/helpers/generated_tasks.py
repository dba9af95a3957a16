"""Tasks of many houses at once."""

from collections.abc import Iterable, Iterator

from evonav.generation import TaskRejectedError, generate_task
from evonav.house import House
from evonav.tasks import Task


def generated_tasks(houses: Iterable[House], seed: int) -> Iterator[Task]:
    """Yield the task of each house that gives one."""
    for house in houses:
        try:
            yield generate_task(house, seed=seed)
        except TaskRejectedError:
            continue
