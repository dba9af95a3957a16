"""Where a run's tasks come from: bundled, a folder, or generated from houses."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from importlib.resources import as_file, files
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from evonav.generation.engine import GenerationProgress


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
    subset: str | None = None,
    seed: int = 0,
    allow_unknown_assets: bool = False,
    num_workers: int = 0,
    on_progress: "Callable[[GenerationProgress], None]" = lambda _: None,
) -> list[Path]:
    """Tasks of the first `limit` houses that allow one, or of a named subset of them.

    `evonav.generation.engine.generate_dataset` makes them.

    Returns:
        The folders of the tasks, in the order of the houses.

    Raises:
        HouseError: The houses cannot be read, or a dataset was not fetched.
        StoreError: `out` holds tasks of another source.
        TaskError: No house gives a task; it says why.
    """
    from evonav.generation.engine import Workforce, generate_dataset
    from evonav.generation.worker import GenerationOptions

    dataset, split = inherited_names(houses)
    options = GenerationOptions(seed=seed, dataset=dataset, split=split, allow_unknown_assets=allow_unknown_assets)
    workforce = Workforce(num_workers=num_workers)
    made = generate_dataset(
        houses, out, options=options, limit=limit, subset=subset, workforce=workforce, on_progress=on_progress
    )
    return list(made.roots)


def inherited_names(houses: Path) -> tuple[str, str]:
    """Dataset and split that tasks have from their houses."""
    from evonav.house.files import named_set

    published = named_set(houses)
    return ("evonav", "none") if published is None else ("procthor-10k", published.split)
