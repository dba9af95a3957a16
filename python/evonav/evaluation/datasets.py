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


def make_tasks(
    houses: Path,
    out: Path,
    *,
    limit: int | None = None,
    seed: int = 0,
    allow_unknown_assets: bool = False,
    on_task: Callable[[str], None] = lambda _: None,
) -> list[Path]:
    """Tasks of the first `limit` houses that allow one; a finished earlier call is not done again.

    Returns:
        The folders of the tasks, in the order of the houses.

    Raises:
        HouseError: A house is malformed, or a dataset was not fetched.
        StoreError: `out` holds tasks of another source.
        TaskError: No house gives a task; it says why.
    """
    from evonav.generation import Rejections, generate_tasks
    from evonav.house import house_file, load_houses, named_set
    from evonav.tasks import write_task

    source = {
        "houses_sha256": _digest(house_file(houses)),
        "seed": seed,
        "limit": limit,
        "allow_unknown_assets": allow_unknown_assets,
    }
    done = _done(out, source)
    if done is not None:
        return done
    rejections = Rejections()
    published = named_set(houses)
    tasks = generate_tasks(
        load_houses(houses),
        seed=seed,
        rejections=rejections,
        dataset="evonav" if published is None else "procthor-10k",
        split="none" if published is None else published.split,
        allow_unknown_assets=allow_unknown_assets,
    )
    roots: list[Path] = []
    for task in islice(tasks, limit):
        on_task(task.task_id)
        roots.append(write_task(task, out))
    if not roots:
        reasons = ", ".join(f"{count} {reason}" for reason, count in rejections.reasons.most_common())
        raise TaskError(f"{houses}: no house gives a task ({reasons or 'no house'})")
    source["tasks"] = [root.name for root in roots]
    source["rejected"] = dict(sorted(rejections.reasons.items()))
    path = out / SOURCE_NAME
    try:
        path.write_text(json.dumps(source, indent=2, sort_keys=True) + "\n", encoding="utf-8")
    except OSError as error:
        raise StoreError(f"{path}: {error}") from error
    return roots


def _done(out: Path, source: dict[str, object]) -> list[Path] | None:
    """The tasks of an earlier call, if it came to its end."""
    path = out / SOURCE_NAME
    if not path.is_file():
        return None
    try:
        there = json.loads(path.read_text(encoding="utf-8"))
        names = [str(name) for name in there.pop("tasks")]
        there.pop("rejected", None)
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
