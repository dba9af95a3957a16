"""Tasks from a file of houses into a folder: parallel, resumable, the same bytes for any number of workers.

This process reads the houses as text, one at a time, and keeps the journal; workers do all else (`generation.worker`).
A task's folder is there wholly or not at all, and the journal names it after it is there: killed at any moment, the
same command goes on. `limit` takes the first houses that give a task: no house is begun that could be beyond them, so
that how fast the workers are changes nothing.
"""

import json
import shutil
import time
from collections import Counter
from collections.abc import Callable, Set
from dataclasses import dataclass
from pathlib import Path

from evonav._core import __version__
from evonav.errors import HouseError, InvalidArgumentError, TaskError
from evonav.generation.house_order import house_order, wanted_of
from evonav.generation.journal import Journal, Outcome
from evonav.generation.worker import PARTIAL_NAME, WORK, GenerationOptions, is_whole, outcome_of
from evonav.house.files import HouseTexts
from evonav.parallel.folders import sha256_of_file, writing
from evonav.parallel.pool import Answer, EngineName, Job, Pool, open_pool
from evonav.tasks.dataset import (
    DATASET_NAME,
    DatasetRecord,
    HouseRejection,
    SourceFile,
    TaskEntry,
    read_dataset,
    write_dataset,
)
from evonav.tasks.subsets import Subset, SubsetError


@dataclass(frozen=True, slots=True)
class Workforce:
    """Who does the work: changes how long it takes, nothing else."""

    num_workers: int = 0
    """0: this process, where a house that hangs is not noticed."""
    engine: EngineName = "local"
    ray_address: str | None = None
    house_timeout_s: float = 120.0


@dataclass(frozen=True, slots=True)
class GenerationProgress:
    """How far a run is."""

    num_houses: int
    """Done, earlier calls included."""
    num_tasks: int
    num_rejected: int
    num_failed: int
    share: float
    """Of the whole, 0 to 1: of the tasks asked for, or of the source's bytes."""
    num_new: int
    """Tasks of this call."""
    seconds: float
    """Since this call began."""

    @property
    def tasks_per_s(self) -> float:
        """Of this call."""
        return self.num_new / max(1e-9, self.seconds)


@dataclass(frozen=True, slots=True)
class GenerationSummary:
    """What a run made."""

    roots: tuple[Path, ...]
    """Folders of the tasks, in the order of their houses."""
    num_houses: int
    reasons: Counter[str]
    """Houses without a task."""
    num_new: int
    """Tasks made by this call."""
    seconds: float
    """That this call took."""


def generate_dataset(
    houses: Path | str | HouseTexts,
    out: Path,
    *,
    options: GenerationOptions | None = None,
    limit: int | None = None,
    subset: str | None = None,
    workforce: Workforce | None = None,
    retry_failed: bool = False,
    on_progress: Callable[[GenerationProgress], None] = lambda _: None,
) -> GenerationSummary:
    """Makes a task of every house that allows one; called again on the same folder, does what is left.

    Args:
        houses: A path as for `evonav.house.load_houses`, or the opened houses.
        out: Gets a folder a task, `journal.jsonl` and, when all is done, `dataset.json`.
        options: Must be the folder's own when it already holds tasks. Default: the paper's parameters, and the dataset
            and split of the houses.
        limit: The first houses that give so many tasks; must be the folder's own too.
        subset: Only the tasks of a named subset of the split (`evonav.tasks.subsets`); must be the folder's own too.
        workforce: Default: this process.
        retry_failed: Do houses again at which the generator failed.
        on_progress: Called when it begins and after every house.

    Raises:
        HouseError: The houses cannot be read, or the dataset was not fetched.
        InvalidArgumentError: Of the arguments.
        StoreError: `out` holds another run, is being written to, or cannot be written.
        TaskError: No house gives a task, or too few for the subset; it says why.
        EngineError: Workers cannot be had.
    """
    if limit is not None and limit < 1:
        raise InvalidArgumentError(f"argument `limit` is {limit}, expected None or at least 1")
    texts = houses if isinstance(houses, HouseTexts) else HouseTexts(houses)
    dataset, split = inherited_names(texts)
    options, workforce = options or GenerationOptions(dataset=dataset, split=split), workforce or Workforce()
    wanted_tasks = None if subset is None else wanted_of(subset, options.split, limit)
    sources = _sources(texts)
    run = {
        "evonav": __version__,
        "houses": {source.name: source.sha256 for source in sources},
        "limit": limit,
        "subset": subset,
        "options": options.as_json(),
    }
    out = out.resolve()  # workers of a cluster have other working directories
    with writing(out), Journal(out, run) as journal:
        again = [i for i, done in journal.outcomes.items() if not _is_kept(done, out, retry_failed)]
        journal.drop(again)
        state = _Run(journal, texts, limit, on_progress)
        state.tell()
        if not _is_done(out, journal):
            (out / DATASET_NAME).unlink(missing_ok=True)
            shutil.rmtree(out / PARTIAL_NAME, ignore_errors=True)
            with open_pool(
                WORK,
                json.dumps({"out": str(out), "options": options.as_json()}),
                engine=workforce.engine,
                num_workers=workforce.num_workers,
                timeout_s=workforce.house_timeout_s,
                ray_address=workforce.ray_address,
            ) as pool:
                if wanted_tasks is None:
                    state.do_all(pool)
                else:
                    state.do_subset(pool, wanted_tasks)
            shutil.rmtree(out / PARTIAL_NAME, ignore_errors=True)
            journal.rewrite()
            _write_dataset(out, sources, options, limit, subset, in_order(journal))
        return state.summary(out)


class _Run:
    """The bookkeeping of one call."""

    def __init__(
        self,
        journal: Journal,
        texts: HouseTexts,
        limit: int | None,
        on_progress: Callable[[GenerationProgress], None],
    ) -> None:
        self._journal = journal
        self._texts = texts
        self._limit = limit
        self._on_progress = on_progress
        done = journal.outcomes.values()
        self._num_tasks = sum(outcome.reason is None for outcome in done)
        self._num_failed = sum(outcome.is_failure for outcome in done)
        self._num_before = self._num_tasks
        self._names: dict[int, str] = {}
        """Of houses that are being done."""
        self._began_s = time.monotonic()

    def do_subset(self, pool: Pool, subset: Subset) -> None:
        """Does the houses of a subset: the first ones in its order, and on while they give too few tasks.

        Raises:
            StoreError: A task or the journal cannot be written.
            SubsetError: All houses give too few.
        """
        order = house_order(self._texts)
        num_begun = 0
        while self._num_tasks_of(order[:num_begun]) < subset.num_tasks:
            if num_begun == len(order):
                raise SubsetError(f"subset '{subset}': only {self._num_tasks} houses give a task")
            num_begun += subset.num_tasks - self._num_tasks_of(order[:num_begun])
            num_begun = min(num_begun, len(order))
            self.do_all(pool, set(order[:num_begun]))

    def _num_tasks_of(self, houses: list[int]) -> int:
        outcomes = self._journal.outcomes
        return sum(index in outcomes and outcomes[index].reason is None for index in houses)

    def do_all(self, pool: Pool, wanted: Set[int] | None = None) -> None:
        """Does every house that is left.

        Args:
            pool: Who does it.
            wanted: Only these.

        Raises:
            InvalidArgumentError: An option is outside its domain.
            StoreError: A task or the journal cannot be written.
        """
        done = self._journal.outcomes
        left = (
            (index, house)
            for index, house in enumerate(self._texts)
            if index not in done and (wanted is None or index in wanted)
        )
        is_more = True
        while is_more or self._names:
            while is_more and len(self._names) < pool.capacity and self._is_wanted():
                index, house = next(left, (0, None))
                is_more = house is not None
                if house is not None:
                    self._names[index] = house.name
                    pool.submit(Job(index, f"{json.dumps([index, house.name])}\n{house.text}"))
            if not self._names:
                return
            self._record(pool.next_answer())
            self.tell()

    def _is_wanted(self) -> bool:
        """Whether the next house could be one of the first that give as many tasks as are asked for."""
        return self._limit is None or self._num_tasks + len(self._names) < self._limit

    def _record(self, answer: Answer) -> None:
        outcome = outcome_of(answer, self._names.pop(answer.key))
        self._journal.add(outcome)
        self._num_tasks += outcome.reason is None
        self._num_failed += outcome.is_failure

    def tell(self) -> None:
        """Says how far it is."""
        share = self._texts.share_read if self._limit is None else self._num_tasks / self._limit
        num_houses = len(self._journal.outcomes)
        self._on_progress(
            GenerationProgress(
                num_houses=num_houses,
                num_tasks=self._num_tasks,
                num_rejected=num_houses - self._num_tasks - self._num_failed,
                num_failed=self._num_failed,
                share=share,
                num_new=self._num_tasks - self._num_before,
                seconds=time.monotonic() - self._began_s,
            )
        )

    def summary(self, out: Path) -> GenerationSummary:
        """What came of it."""
        outcomes = in_order(self._journal)
        without = [outcome for outcome in outcomes if outcome.reason is not None]
        return GenerationSummary(
            roots=tuple(out / outcome.task_id for outcome in outcomes if outcome.task_id is not None),
            num_houses=len(outcomes),
            reasons=Counter(str(outcome.reason) for outcome in without),
            num_new=self._num_tasks - self._num_before,
            seconds=time.monotonic() - self._began_s,
        )


def in_order(journal: Journal) -> list[Outcome]:
    """Outcomes in the order of the houses."""
    return [journal.outcomes[index] for index in sorted(journal.outcomes)]


def _is_done(out: Path, journal: Journal) -> bool:
    """Whether `dataset.json` tells of all that the journal does: it is written last."""
    try:
        record = read_dataset(out)
    except TaskError:
        return False
    tasks = {outcome.task_id for outcome in journal.outcomes.values() if outcome.task_id is not None}
    return record.num_houses == len(journal.outcomes) and {entry.task_id for entry in record.tasks} == tasks


def _is_kept(outcome: Outcome, out: Path, retry_failed: bool) -> bool:
    """Whether what the journal says still holds, and is not to be done again."""
    if outcome.task_id is None:
        return not (retry_failed and outcome.is_failure)
    return is_whole(outcome, out)


def _write_dataset(
    out: Path,
    sources: tuple[SourceFile, ...],
    options: GenerationOptions,
    limit: int | None,
    subset: str | None,
    outcomes: list[Outcome],
) -> None:
    """Writes what the folder holds.

    Raises:
        TaskError: There is no task, two have the same id, or it cannot be written.
    """
    entries: dict[str, TaskEntry] = {}
    rejections: list[HouseRejection] = []
    for done in outcomes:
        if done.reason is not None:
            rejections.append(
                HouseRejection(house=done.house, reason=done.reason, stage=done.stage, detail=done.detail)
            )
        elif done.task_id in entries:
            raise TaskError(f"two houses give a task named {done.task_id}; the second is {done.house}")
        else:
            values = {"task_id": done.task_id, "sha256": done.task_sha256, "house_sha256": done.house_sha256}
            entry = TaskEntry.model_validate(values)
            entries[entry.task_id] = entry
    record = DatasetRecord(
        name=options.dataset,
        split=options.split,
        generator=f"evonav {__version__}",
        sources=sources,
        seed=options.seed,
        limit=limit,
        subset=subset,
        allow_unknown_assets=options.allow_unknown_assets,
        parameters=options.parameters,
        num_houses=len(outcomes),
        num_tasks=len(entries),
        tasks=tuple(entries[task_id] for task_id in sorted(entries)),
        rejections=tuple(rejections),
    )
    if not entries:
        counts = ", ".join(f"{count} {reason}" for reason, count in record.num_rejected.most_common())
        first = f"; the first: {rejections[0].detail}" if rejections else ""
        raise TaskError(f"{sources[0].name}: no house gives a task ({counts or 'no house'}){first}")
    write_dataset(record, out)


def inherited_names(houses: HouseTexts) -> tuple[str, str]:
    """Return the dataset and split that tasks inherit from their houses."""
    return ("evonav", "none") if houses.published is None else ("procthor-10k", houses.published.split)


def _sources(houses: HouseTexts) -> tuple[SourceFile, ...]:
    """Names and checksums of the files of houses.

    Raises:
        HouseError: A file cannot be read.
    """
    try:
        return tuple(
            SourceFile(name=houses.name if houses.published else file.name, sha256=sha256_of_file(file))
            for file in houses.files
        )
    except OSError as error:
        raise HouseError(f"{houses.name}: cannot be read: {error}") from error
