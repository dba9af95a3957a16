"""Find the tasks that come with evonav."""

from contextlib import AbstractContextManager
from importlib.resources import as_file, files
from pathlib import Path


def bundled_tasks() -> AbstractContextManager[Path]:
    """Return a context manager that gives the folder of the bundled tasks."""
    return as_file(files("evonav") / "data" / "tasks")
