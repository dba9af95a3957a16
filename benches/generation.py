"""Tasks from houses with all of their files written: how many a second, where the time goes, what memory it takes."""

import os
import resource
import statistics
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import files
from itertools import count, islice
from pathlib import Path
from typing import Any

from evonav import _core
from evonav.generation import worker
from evonav.generation.journal import Outcome
from evonav.generation.worker import GenerationOptions, process_house
from evonav.house import House
from evonav.house.files import HouseText, HouseTexts

NOTES = """One process, the paper's parameters, everything written: houses, records and images of all stages. Times are
CPU time, kernel included. *Core* is Algorithm 1 in Rust with the reference images drawn, *files* packing and writing,
*rest* is parsing the house, instructions, records and checksums. Memory is the process's greatest resident set after
the first 100 tasks and after all; where a file has fewer houses than tasks, it is gone through again with other seeds.
There is no peer to run beside it: EvoNav-Bench's own generator is not published. Nearest is the object placement of the
published `procthor` package, which asks Unity about every collision (docs/procthor.md has its times on our engine).
A task is some 17 small files, and the file system's own time for them counts: `TMPDIR=/dev/shm` leaves it out.
"""
HISTORY = Path(os.environ.get("EVONAV_DATA", "")) / "ram81-procthor-100k-history"
"""Folder of a data set that CONTRIBUTING.md lists; without it, its rows are left out."""
SOURCES = {
    "bundled, 1-10 rooms": (Path(str(files("evonav") / "data" / "houses.jsonl.gz")), 1000),
    "attr-onav-1k, 2-3 rooms": (HISTORY / "attr-onav-1k-train-1000.jsonl.gz", 1000),
    "uniform-hard-val-75, 4-10 rooms": (HISTORY / "uniform-hard-val-75.jsonl.gz", 150),
}
"""File and number of tasks."""


def run() -> str:
    """A table with a row a source that is there."""
    titles = ["houses", "objects (median)", "tasks", "tasks/s a core", "ms a task", "core", "files", "rest"]
    titles += ["MB after 100", "MB after all"]
    lines = [f"| {' | '.join(titles)} |", f"| --- {'| ---: ' * (len(titles) - 1)}|"]
    lines += [_row(name, path, num_tasks) for name, (path, num_tasks) in SOURCES.items() if path.exists()]
    return "\n".join(lines)


def _row(name: str, path: Path, num_tasks: int) -> str:
    num_objects = statistics.median(len(House(house.text, name=house.name).objects) for house in HouseTexts(path))
    memory_mb: list[float] = []
    num_made = 0
    with tempfile.TemporaryDirectory() as out, _timed() as spans:
        for seed, house in _houses(path):
            with _span(spans, "all"):
                outcome = _process(house, seed, Path(out))
            num_made += outcome.task_id is not None
            if num_made in (100, num_tasks) and outcome.task_id is not None:
                memory_mb.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
            if num_made == num_tasks:
                break
    whole_s, core_s, files_s = (spans[key] for key in ("all", "core", "files"))
    shares = " | ".join(f"{100 * part / whole_s:.0f}%" for part in (core_s, files_s, whole_s - core_s - files_s))
    rate = f"{num_made / whole_s:.1f} | {1e3 * whole_s / num_made:.1f}"
    return f"| {name} | {num_objects:.0f} | {num_made} | {rate} | {shares} | {memory_mb[0]:.0f} | {memory_mb[-1]:.0f} |"


def _process(house: HouseText, seed: int, out: Path) -> Outcome:
    """Generate and write the task of a house."""
    options = GenerationOptions(seed=seed)
    return process_house(0, house.name, house.text, lambda parsed: {out: options.generate(parsed)})


def _houses(path: Path) -> Iterator[tuple[int, HouseText]]:
    """Houses without an end, a seed for every time through the file; ten tasks are made before, as a warm-up."""
    with tempfile.TemporaryDirectory() as out:
        for house in islice(HouseTexts(path), 10):
            _process(house, 0, Path(out))
    for seed in count():
        for house in HouseTexts(path):
            yield seed, house


@contextmanager
def _timed() -> Iterator[Counter[str]]:
    """CPU seconds by part of the work."""
    spans: Counter[str] = Counter()
    generate, put = _core.generate_task, worker.put_task

    def in_span(part: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*arguments: object, **keywords: object) -> Any:  # noqa: ANN401
            with _span(spans, part):
                return call(*arguments, **keywords)

        return timed

    _core.generate_task, worker.put_task = in_span("core", generate), in_span("files", put)
    try:
        yield spans
    finally:
        _core.generate_task, worker.put_task = generate, put


@contextmanager
def _span(spans: Counter[str], part: str) -> Iterator[None]:
    start_s = time.process_time()
    yield
    spans[part] += time.process_time() - start_s  # type: ignore[assignment]
