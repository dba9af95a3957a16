"""Load houses and tasks, and generate tasks: `evonav.load_houses`, `load_tasks`, `generate_tasks`."""

import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, Generic, TypeVar, overload

from evonav._core import House
from evonav.api.progress import progress_bar
from evonav.counted import counted
from evonav.errors import HouseError, InvalidArgumentError, TaskError
from evonav.evaluation.run.run_settings import RunSettings
from evonav.generation.dataset import generate_dataset, inherited_names
from evonav.generation.worker import GenerationOptions
from evonav.house.evonav10k import SPLITS, made_split, split_to_make
from evonav.house.files import BUNDLED, HouseText, HouseTexts
from evonav.parallel.folders import write_atomically
from evonav.parallel.worker import Workforce
from evonav.tasks.files import load_task, write_task
from evonav.tasks.listing import TaskFile, task_file, task_files, task_folder
from evonav.tasks.manifest import Task
from evonav.world.house_options import HouseOptions, StartRule

T = TypeVar("T")
S = TypeVar("S")


class LazyList(Sequence[T], Generic[S, T]):
    """A list whose items are read when they are first used, each once."""

    def __init__(self, sources: Sequence[S], read: Callable[[S], T]) -> None:
        """Remember where the items are."""
        self.sources = tuple(sources)
        self._read = read
        self._items: dict[int, T] = {}

    def __len__(self) -> int:
        """Return the number of items."""
        return len(self.sources)

    @overload
    def __getitem__(self, index: int) -> T: ...

    @overload
    def __getitem__(self, index: slice) -> "LazyList[S, T]": ...

    def __getitem__(self, index: int | slice) -> "T | LazyList[S, T]":
        """Return an item, or a part of the list."""
        if isinstance(index, slice):
            return LazyList(self.sources[index], self._read)
        place = range(len(self.sources))[index]
        if place not in self._items:
            self._items[place] = self._read(self.sources[place])
        return self._items[place]

    def __repr__(self) -> str:
        """Return the first items."""
        shown = ", ".join(repr(item) for item in islice(self, 3))
        more = f", ... {len(self) - 3} more" if len(self) > 3 else ""
        return f"[{shown}{more}]"


TaskList = LazyList[TaskFile, Task]
HouseList = LazyList[HouseText, House]
HouseSource = str | Path | House | Sequence[House]
TaskSource = str | Path | Task | TaskFile | Sequence[Any]


def load_houses(
    source: str | Path | Iterable[str | Path] = BUNDLED,
    limit: int | None = None,
    assets: str | Path | None = None,
    start: StartRule = "file",
) -> HouseList:
    """Return houses as a list, each parsed when it is first used.

    Args:
        source: `"bundled"`, a file of houses (JSON, JSONL, either with `.gz`), a folder of such files, a fetched split
            (`"procthor-10k:val"`), a split that evonav makes when it is first used (`"evonav-10k:test"`), houses from a
            seed (`"endless:7"`), or a list of these.
        limit: Number of houses to take, from the first. Default: all.
        assets: File of sizes for assets that the catalogue lacks (docs/houses.md); they become part of the houses.
        start: `"auto"` gives a house without a start a free place to start from.

    Returns:
        The houses; indexing, slicing and `len` work. A malformed house raises `HouseError` when it is used.

    Raises:
        HouseError: There is no such file, or it cannot be read.

    Examples:
        >>> import evonav
        >>> house = evonav.load_houses("bundled")[0]
        >>> house.name
        'bundled:1'
    """
    sources = [source] if isinstance(source, str | Path) else list(source)
    options = HouseOptions.of(None if assets is None else Path(assets), start)
    opened = [_house_texts(one, options) for one in sources]
    for one in opened:
        one.check_end(limit)
    texts = (text for one in opened for text in one)
    return LazyList(tuple(islice(texts, limit)), lambda text: House(text.text, name=text.name))


def _house_texts(source: str | Path, options: HouseOptions | None = None) -> HouseTexts:
    if (split := split_to_make(str(source))) is not None:
        with progress_bar("houses") as show:
            made_split(split, on_progress=lambda state: show(state.num_houses, SPLITS[split].num_houses))
    try:
        return HouseTexts(source, options)
    except HouseError as error:
        if Path(source).exists() or ":" in str(source):
            raise
        raise HouseError(f"{source}: no such file or folder of houses; `bundled` names those of evonav") from error


def load_tasks(source: str | Path = BUNDLED, limit: int | None = None) -> TaskList:
    """Return tasks as a list, each read and checked when it is first used.

    Args:
        source: `"bundled"`, a folder of tasks, or the folder of one task.
        limit: Number of tasks to take, from the first. Default: all.

    Returns:
        The tasks, in order of their ids; indexing, slicing and `len` work.

    Raises:
        TaskError: The folder holds no task.

    Examples:
        >>> import evonav
        >>> tasks = evonav.load_tasks("bundled")
        >>> tasks[1].public(stage=1).category
        'Vase'
    """
    return LazyList(_files_of(source, limit), lambda file: load_task(file.path))


def generate_tasks(
    houses: HouseSource = BUNDLED,
    out: str | Path | None = None,
    seed: int = 0,
    limit: int | None = None,
    workers: int | None = None,
    allow_unknown_assets: bool = False,
    assets: str | Path | None = None,
    start: StartRule = "file",
) -> TaskList:
    """Generate a task from every house that gives one; call it again with the same `out` to resume.

    Args:
        houses: Houses, a house, or where they are, as for `load_houses`.
        out: Folder for the tasks. Default: a new temporary folder.
        seed: Seed of every random choice.
        limit: Number of tasks, from the first houses that give one. Default: all.
        workers: Number of worker processes; 0 runs in this process. Default: one per core.
        allow_unknown_assets: Give assets that are missing from the catalogue the usual size of their category.
        assets: File of sizes for assets that the catalogue lacks (docs/houses.md); they become part of the tasks.
        start: `"auto"` gives a house without a start a free place to start from.

    Returns:
        The tasks, in the order of their houses.

    Raises:
        HouseError: The houses cannot be read.
        TaskError: No house gives a task; says why.
        StoreError: `out` holds other tasks, or cannot be written.

    Examples:
        >>> import evonav
        >>> tasks = evonav.generate_tasks("bundled", limit=1, workers=0)
        >>> tasks[0].num_stages
        5
    """
    folder = Path(tempfile.mkdtemp(prefix="evonav-")) if out is None else Path(out)
    completion = HouseOptions.of(None if assets is None else Path(assets), start)
    texts = _house_texts(_house_path(houses, folder), completion)
    dataset, split = inherited_names(texts)
    options = GenerationOptions(seed=seed, dataset=dataset, split=split, allow_unknown_assets=allow_unknown_assets)
    with progress_bar("tasks") as show:
        found = generate_dataset(
            texts,
            folder,
            options=options,
            limit=limit,
            workforce=Workforce(RunSettings(workers=workers).num_workers),
            on_progress=lambda state: show(state.share, 1.0, counted(state.num_tasks, "task")),
        )
    return LazyList([task_file(root) for root in found.roots], lambda file: load_task(file.path))


def _house_path(houses: HouseSource, folder: Path) -> str | Path:
    """Return the path of houses; houses in memory are written beside their tasks."""
    if isinstance(houses, str | Path):
        return houses
    listed = [houses] if isinstance(houses, House) else list(houses)
    wrong = next((house for house in listed if not isinstance(house, House)), None)
    if wrong is not None or not listed:
        raise InvalidArgumentError(f"houses = {wrong!r}: expected `bundled`, a path, or a list of `evonav.House`")
    return write_atomically(folder / "houses.jsonl", "".join(f"{house.to_json()}\n" for house in listed))


def task_list(tasks: TaskSource, limit: int | None, out: Path) -> list[TaskFile]:
    """Return the files of tasks; tasks in memory are written to `out`/tasks.

    Raises:
        InvalidArgumentError: An entry is no task, or a task is given twice.
        TaskError: A folder holds no task.
    """
    found = list(islice(_each_file(tasks, limit, out), limit))
    ids = [file.task_id for file in found]
    twice = next((name for i, name in enumerate(ids) if name in ids[:i]), None)
    if twice is not None:
        raise InvalidArgumentError(f"two tasks have the id {twice!r}: evaluate them in runs of their own")
    return found


def _each_file(tasks: Any, limit: int | None, out: Path) -> Iterator[TaskFile]:  # noqa: ANN401 - whatever was given
    if isinstance(tasks, str | Path):
        yield from _files_of(tasks, limit)
    elif isinstance(tasks, TaskFile):
        yield tasks
    elif isinstance(tasks, Task):
        yield task_file(tasks.root or write_task(tasks, out / "tasks"))
    elif isinstance(tasks, LazyList):
        yield from tasks.sources
    elif isinstance(tasks, Iterable):
        for task in tasks:
            yield from _each_file(task, None, out)
    else:
        raise InvalidArgumentError(
            f"tasks = {tasks!r}: expected `bundled`, a folder of tasks, a task, or a list of tasks"
        )


def _files_of(source: str | Path, limit: int | None) -> list[TaskFile]:
    path = task_folder(source)
    if (path / "task.json").is_file():
        return [task_file(path)]
    if not path.exists():
        raise TaskError(f"{path}: no such folder of tasks; `bundled` names those of evonav")
    return task_files(path, limit)
