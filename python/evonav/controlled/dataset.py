"""Generate controlled analyses into a folder: in parallel, resumable, the same bytes for any number of workers."""

import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from itertools import islice, pairwise
from pathlib import Path

from evonav._core import __version__
from evonav.controlled.generate import generate_arms
from evonav.controlled.layout import ControlledOptions, ControlledRecord, tasks_of, write_controlled
from evonav.errors import InvalidArgumentError, TaskError
from evonav.generation.journal import Journal, Outcome
from evonav.generation.worker import HOUSE_TIMEOUT_S, PARTIAL_NAME, is_complete, outcome_of, worker_of
from evonav.house import House
from evonav.house.files import HouseCompletion, HouseText, HouseTexts
from evonav.parallel.folders import sha256_of_file, writing
from evonav.parallel.pool import Job, answers, open_pool
from evonav.parallel.worker import Workforce
from evonav.tasks.dataset import DatasetRecord, SourceFile, TaskEntry, write_dataset
from evonav.tasks.files import read_house
from evonav.tasks.listing import task_roots
from evonav.tasks.manifest import Task, TaskHeader
from evonav.tasks.records import parse_record, read_file

WORK = "evonav.controlled.dataset:make_worker"


def generate_controlled(
    source: Path | str,
    out: Path,
    *,
    options: ControlledOptions | None = None,
    limit: int | None = None,
    completion: HouseCompletion | None = None,
    workforce: Workforce | None = None,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[ControlledRecord, int]:
    """Make the arms of a controlled analysis; called again on the same folder, make what is missing.

    Args:
        source: Houses as for `evonav.house.stream_houses`, or a folder of tasks, whose first houses are taken.
        out: Gets `tasks/<arm>`, `journal.jsonl` and, when all is done, `controlled.json`.
        options: Must be the folder's own when it already holds tasks.
        limit: Only the first houses; must be the folder's own, too.
        completion: Completes each house as it is read; must be the folder's own, too.
        workforce: Default: this process.
        on_progress: Called with tasks done and all tasks, when it begins and after every one.

    Returns:
        What was written, and the number of tasks made by this call, one counted for all arms.

    Raises:
        HouseError: The houses cannot be read.
        InvalidArgumentError: An argument is invalid.
        StoreError: `out` holds something else, is being written to, or cannot be written.
        TaskError: No house allows it; the message says why.
        EngineError: Workers cannot be had.
    """
    options, workforce = options or ControlledOptions(), workforce or Workforce()
    if limit is not None and limit < 1:
        raise InvalidArgumentError(f"argument `limit` is {limit}, expected None or at least 1")
    sources = _sources(source)
    houses = list(islice(_houses(source, completion), limit))
    run = {
        "evonav": __version__,
        "houses": {one.name: one.sha256 for one in sources},
        "limit": limit,
        "options": options.model_dump(mode="json"),
        **({} if completion is None else {"completed": dict(completion.identity)}),
    }
    out = out.resolve()
    with writing(out), closing(Journal(out, run)) as journal:
        last = tasks_of(out, options.arms[-1].name)  # which is written last: if a task is there, it is in all arms
        made = [(index, done) for index, done in journal.outcomes.items() if done.task is not None]
        journal.drop([index for index, done in made if not is_complete(done, last)])
        num_before, num_all = len(journal.outcomes), len(houses) * options.per_house
        on_progress(num_before, num_all)
        if num_before < num_all:
            settings = json.dumps([str(out), options.model_dump_json()])
            with open_pool(WORK, settings, workforce, timeout_s=HOUSE_TIMEOUT_S) as pool:
                left = [index for index in range(num_all) if index not in journal.outcomes]
                for answer in answers(pool, (_job(index, houses, options) for index in left)):
                    journal.add(outcome_of(answer, houses[answer.key // options.per_house].name))
                    on_progress(len(journal.outcomes), num_all)
            shutil.rmtree(out / PARTIAL_NAME, ignore_errors=True)
        journal.rewrite()
        outcomes = journal.ordered_outcomes()
        record = _write(out, options, sources, limit, outcomes)
        return record, len(outcomes) - num_before


def _job(index: int, houses: Sequence[HouseText], options: ControlledOptions) -> Job:
    house = houses[index // options.per_house]
    head = json.dumps([index, house.name, options.seed + index % options.per_house])
    return Job(index, f"{head}\n{house.text}")


def make_worker(settings: str, _alive: Callable[[], None]) -> Callable[[str], str]:
    """Return the function from a house to its `Outcome`, as `evonav.parallel.pool` calls it.

    Args:
        settings: JSON of the folder of the analysis, and of its options.

    Returns:
        See `worker_of`; a seed heads a house, beside the name.
    """
    folder, text = json.loads(settings)
    options, out = ControlledOptions.model_validate_json(text), Path(folder)

    def arms(house: House, seed: int) -> dict[Path, Task]:
        return {tasks_of(out, arm): task for arm, task in generate_arms(house, options, seed=seed).items()}

    return worker_of(arms)


def _write(
    out: Path,
    options: ControlledOptions,
    sources: tuple[SourceFile, ...],
    limit: int | None,
    outcomes: list[Outcome],
) -> ControlledRecord:
    """Write each arm's `dataset.json`, and `controlled.json` last."""
    made = sorted((done.task.task_id, done.task.house_sha256) for done in outcomes if done.task is not None)
    rejections = tuple(outcome.rejection for outcome in outcomes if outcome.rejection is not None)
    task_ids = tuple(task_id for task_id, _ in made)
    if not made:
        first = f"; the first: {rejections[0].detail}" if rejections else ""
        raise TaskError(f"{sources[0].name}: no house allows it{first}")
    if len(set(task_ids)) < len(task_ids):
        twice = next(one for one, other in pairwise(task_ids) if one == other)
        raise TaskError(f"two houses give a task named {twice}")
    num_attempts = 0
    for arm in options.arms:
        folder = tasks_of(out, arm.name)
        entries = []
        for task_id, house_sha256 in made:
            path = folder / task_id / "task.json"
            entries.append(TaskEntry(task_id=task_id, sha256=sha256_of_file(path), house_sha256=house_sha256))
            if arm == options.arms[0]:
                control = parse_record(TaskHeader, read_file(path), path).control
                num_attempts += 1 if control is None else control.attempt + 1
        parameters = options.parameters.model_copy(update={"evolve_probability": arm.evolve_probability})
        write_dataset(
            DatasetRecord(
                name=f"controlled-{options.kind}",
                split="none",
                generator=f"evonav {__version__}",
                sources=sources,
                seed=options.seed,
                limit=limit,
                subset=None,
                allow_unknown_assets=options.allow_unknown_assets,
                parameters=parameters,
                num_houses=len(outcomes),
                num_tasks=len(entries),
                tasks=tuple(entries),
                rejections=rejections,
            ),
            folder,
        )
    record = ControlledRecord(
        generator=f"evonav {__version__}",
        sources=sources,
        limit=limit,
        options=options,
        task_ids=task_ids,
        num_attempts=num_attempts,
        rejections=rejections,
    )
    write_controlled(record, out)
    return record


def _is_tasks(source: Path | str) -> bool:
    return Path(source).is_dir() and any(Path(source).glob("*/task.json"))


def _houses(source: Path | str, completion: HouseCompletion | None) -> Iterator[HouseText]:
    """Yield the houses of files, or the first houses of a folder's tasks."""
    if not _is_tasks(source):
        yield from HouseTexts(source, completion)
        return
    for root in task_roots(Path(source)):
        header = parse_record(TaskHeader, read_file(root / "task.json"), root / "task.json")
        house = HouseText(header.house.name, read_house(root / "houses/stage_1.json.gz"))
        yield house if completion is None else house._replace(text=completion.complete(*house))


def _sources(source: Path | str) -> tuple[SourceFile, ...]:
    if _is_tasks(source):
        return tuple(
            SourceFile(name=root.name, sha256=sha256_of_file(root / "task.json")) for root in task_roots(Path(source))
        )
    return tuple(SourceFile(name=name, sha256=sha256) for name, sha256 in HouseTexts(source).checksums())
