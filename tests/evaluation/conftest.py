"""For tests of evaluations."""

import pytest
from toy_house import write_tasks

from evonav.tasks.listing import task_files


@pytest.fixture
def tasks(tmp_path):
    """Both toy tasks, in the folder `tasks`."""
    write_tasks(tmp_path / "tasks")
    return task_files(tmp_path / "tasks")
