"""Find the tasks that come with evonav, and recognise them as they were with their former reference images."""

import json
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import TypedDict

from evonav.tasks.listing import TaskFile
from evonav.tasks.records import sha256_of

FORMER_IMAGES = "former reference images, drawn in the style outlined"
FORMER_DEFAULT_IMAGES = "former reference images, drawn in the style default before its objects changed"
_IMAGES = (FORMER_IMAGES, FORMER_DEFAULT_IMAGES)
"""The images of each of the digests in `former_tasks.json`, the oldest first."""


def bundled_tasks() -> AbstractContextManager[Path]:
    """Return a context manager that gives the folder of the bundled tasks."""
    return as_file(files("evonav") / "data" / "tasks")


def former_images(task_id: str, digest: str) -> str:
    """Return which former reference images a bundled task with a digest has, in words; empty if it is no such task."""
    digests = _former().get(task_id, {}).get("sha256", [])
    return _IMAGES[digests.index(digest)] if digest in digests else ""


def former_digests(task: TaskFile) -> Sequence[str]:
    """Return the digests that a bundled task had with its former reference images, the oldest first; none for others.

    The present task must be equal to the former ones in all but these images and their style.
    """
    former = _former().get(task.task_id)
    if former is None or _without_images(task.path / "task.json") != former["without_images"]:
        return ()
    return former["sha256"]


class _Former(TypedDict, total=False):
    sha256: list[str]
    without_images: str


@cache
def _former() -> Mapping[str, _Former]:
    data = (files("evonav") / "data" / "former_tasks.json").read_bytes()
    former: dict[str, _Former] = json.loads(data)
    return former


def _without_images(path: Path) -> str:
    """Return the digest of a task's header without the style and the checksums of its reference images."""
    header = json.loads(path.read_bytes())
    header["parameters"].pop("reference_style", None)
    header["checksums"] = {name: sha for name, sha in header["checksums"].items() if not name.endswith(".png")}
    return sha256_of(json.dumps(header, sort_keys=True).encode())
