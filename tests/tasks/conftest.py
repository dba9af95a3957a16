from pathlib import Path

import pytest

from evonav.generation import generate_task
from evonav.house import bundled_houses
from evonav.tasks import Task, write_task
from evonav.tasks.parameters import GenerationParameters


@pytest.fixture(scope="session")
def task() -> Task:
    """Three stages in a small house, changed before each."""
    house = next(bundled_houses(2).__iter__())
    config = GenerationParameters(num_stages=(3,), evolve_probability=1.0)
    return generate_task(house, seed=4, config=config)


@pytest.fixture
def root(task: Task, tmp_path: Path) -> Path:
    return write_task(task, tmp_path)
