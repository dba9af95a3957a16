"""Tasks from houses with all of their files written: how many a second, where the time goes, what memory it takes."""

import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count, islice
from pathlib import Path
from typing import Any

from evonav import _core
from evonav.agents.hosting.serving import peak_memory_mb
from evonav.errors import TaskError
from evonav.generation import worker
from evonav.generation.journal import Outcome
from evonav.generation.worker import GenerationOptions, process_house
from evonav.house.files import BUNDLED, HouseText, HouseTexts
from evonav.speed_benchmark.timing import Row, Sampling, rows_of

NAME, TITLE = "generation", "Task generation"
NOTES = """\
One process, the paper's parameters, all files written. *Core*: Algorithm 1 with the reference images; *files*:
packing and writing; *rest*: reading the house, instructions, checksums; *MB*: peak memory.
"""
NUM_TASKS = 1000
NUM_WARM_UP = 10


def measure(sampling: Sampling, *, houses: Path | str = BUNDLED, title: str = "bundled, 1-10 rooms") -> Iterator[Row]:
    """Yield the time of a task.

    Args:
        sampling: Its `limit` is the number of tasks, by default 1000.

    Raises:
        HouseError: The houses cannot be read.
        TaskError: No house gives a task.
    """
    num_tasks = (sampling.limit or NUM_TASKS) * sampling.repeats
    memory_mb: list[float] = []
    task_ms: list[float] = []
    names: list[str] = []
    num_failed = 0
    with tempfile.TemporaryDirectory() as out:
        for house in islice(HouseTexts(houses), NUM_WARM_UP):
            _process(house, 0, Path(out))
    with tempfile.TemporaryDirectory() as out, _timed() as spans:
        for seed, house in _houses(houses):
            start_s = time.process_time()
            outcome = _process(house, seed, Path(out))
            took_ms = 1e3 * (time.process_time() - start_s)
            spans["all"] += took_ms
            if outcome.rejection is not None:
                num_failed += 1
                if num_failed > 100 and not task_ms:
                    raise TaskError(f"{houses}: no task in {num_failed} houses: {outcome.rejection.reason}")
                continue
            task_ms.append(took_ms)
            names.append(house.name)
            sampling.on_progress(len(task_ms), num_tasks, "tasks")
            if len(task_ms) in (100, num_tasks) and (peak_mb := peak_memory_mb()) is not None:
                memory_mb.append(peak_mb)
            if len(task_ms) == num_tasks:
                break
    facts = {"tasks/s": 1e3 * len(task_ms) / spans["all"]}
    rest_ms = spans["all"] - spans["core"] - spans["files"]
    for part, part_ms in (("core", spans["core"]), ("files", spans["files"]), ("rest", rest_ms)):
        facts[f"{part} %"] = 100 * part_ms / spans["all"]
    if memory_mb:
        facts["MB after 100"], facts["MB after all"] = memory_mb[0], memory_mb[-1]
    yield from rows_of(f"a task, {title}", task_ms, {}, names, facts)


def _process(house: HouseText, seed: int, out: Path) -> Outcome:
    """Generate and write the task of a house."""
    options = GenerationOptions(seed=seed)
    return process_house(0, house.name, house.text, lambda parsed: {out: options.generate(parsed)})


def _houses(path: Path | str) -> Iterator[tuple[int, HouseText]]:
    """Yield houses without an end, a seed for every time through the file."""
    for seed in count():
        for house in HouseTexts(path):
            yield seed, house


@contextmanager
def _timed() -> Iterator[dict[str, float]]:
    """Lend CPU milliseconds by part of the work."""
    spans = dict.fromkeys(("all", "core", "files"), 0.0)
    generate, put = _core.generate_task, worker.put_task

    def in_span(part: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*arguments: object, **keywords: object) -> Any:  # noqa: ANN401
            start_s = time.process_time()
            found = call(*arguments, **keywords)
            spans[part] += 1e3 * (time.process_time() - start_s)
            return found

        return timed

    _core.generate_task, worker.put_task = in_span("core", generate), in_span("files", put)
    try:
        yield spans
    finally:
        _core.generate_task, worker.put_task = generate, put
