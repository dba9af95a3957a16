"""Find the tasks that come with evonav, and recognise them as they were with their former reference images."""

import json
from collections.abc import Mapping
from contextlib import AbstractContextManager
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path

from evonav.tasks.listing import TaskFile
from evonav.tasks.records import sha256_of

FORMER_IMAGES = "former reference images, drawn in the style outlined"
FORMER = f"the bundled tasks with their {FORMER_IMAGES}"


def bundled_tasks() -> AbstractContextManager[Path]:
    """Return a context manager that gives the folder of the bundled tasks."""
    return as_file(files("evonav") / "data" / "tasks")


def is_former(task_id: str, digest: str) -> bool:
    """Return whether a digest is that of a bundled task with its former reference images."""
    return task_id in _former() and _former()[task_id]["sha256"] == digest


def former_digest(task: TaskFile) -> str | None:
    """Return the digest that a bundled task had with its former reference images; `None` for other tasks.

    The present task must be equal to the former one in all but these images and their style.
    """
    former = _former().get(task.task_id)
    if former is None or _without_images(task.path / "task.json") != former["without_images"]:
        return None
    return former["sha256"]


@cache
def _former() -> Mapping[str, Mapping[str, str]]:
    data = (files("evonav") / "data" / "former_tasks.json").read_bytes()
    former: dict[str, dict[str, str]] = json.loads(data)
    return former


def _without_images(path: Path) -> str:
    """Return the digest of a task's header without the style and the checksums of its reference images."""
    header = json.loads(path.read_bytes())
    header["parameters"].pop("reference_style", None)
    header["checksums"] = {name: sha for name, sha in header["checksums"].items() if not name.endswith(".png")}
    return sha256_of(json.dumps(header, sort_keys=True).encode())
