"""Where a run's tasks come from: bundled, a folder, or generated from houses."""

import hashlib
import json
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from importlib.resources import as_file, files
from itertools import islice
from pathlib import Path

from evonav.errors import StoreError, TaskError
from evonav.evaluation.store import check_same_run

SOURCE_NAME = "source.json"
"""Beside generated tasks: what they were generated from."""


def bundled_tasks() -> AbstractContextManager[Path]:
    """The folder of the tasks that come with evonav."""
    return as_file(files("evonav") / "data" / "tasks")


def house_facts(path: Path | None, limit: int | None) -> Iterator[tuple[str, int, int]]:
    """Name, rooms and objects of houses.

    Raises:
        HouseError: A house is malformed.
    """
    from evonav.house import bundled_houses, load_houses

    for house in islice(bundled_houses() if path is None else load_houses(path), limit):
        yield house.name, len(house.rooms), len(house.objects)


def generate_tasks(
    houses: Path,
    out: Path,
    *,
    limit: int | None = None,
    seed: int = 0,
    on_task: Callable[[str], None] = lambda _: None,
) -> list[Path]:
    """Tasks of the first `limit` multi-room houses, one each; those already there are kept.

    Returns:
        The folders of the tasks, in the order of the houses.

    Raises:
        HouseError: A house is malformed.
        StoreError: `out` holds tasks of another source.
        TaskError: No house gives a task.
    """
    from evonav.generation import generate_task
    from evonav.house import load_houses
    from evonav.tasks import write_task

    source = {"houses_sha256": _digest(houses), "seed": seed, "limit": limit}
    done = _done(out, source)
    if done is not None:
        return done
    roots: list[Path] = []
    for house in load_houses(houses):
        if limit is not None and len(roots) >= limit:
            break
        if len(house.rooms) < 2:
            continue
        on_task(house.name)
        roots.append(write_task(generate_task(house, seed=seed), out))
    if not roots:
        raise TaskError(f"{houses}: no house with two or more rooms")
    source["tasks"] = [root.name for root in roots]
    (out / SOURCE_NAME).write_text(json.dumps(source, indent=2, sort_keys=True) + "\n", encoding="utf-8")
    return roots


def _done(out: Path, source: dict[str, object]) -> list[Path] | None:
    """The tasks of an earlier call, if it came to its end."""
    path = out / SOURCE_NAME
    if not path.is_file():
        return None
    try:
        there = json.loads(path.read_text(encoding="utf-8"))
        names = [str(name) for name in there.pop("tasks")]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise StoreError(f"{path}: {error!r}") from error
    check_same_run(there, source, out)
    return [out / name for name in names]


def _digest(path: Path) -> str:
    try:
        with path.open("rb") as file:
            digest = hashlib.sha256()
            while chunk := file.read(1 << 20):
                digest.update(chunk)
    except OSError as error:
        raise StoreError(f"{path}: {error}") from error
    return digest.hexdigest()
