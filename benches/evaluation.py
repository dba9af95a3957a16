"""Whole evaluations: stages a second with one and two workers, what two gain, and memory of workers and agents."""

import argparse
import os
import shutil
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import Progress, RunConfig
from evonav.tasks.listing import BUNDLED_TASKS, TaskFile, task_files

NOTES = """\
`evonav evaluate` as a user runs it; stages/s are by the wall clock. *Efficiency*: of two workers, compared with twice
the rate of one. Again: `python -m benches evaluation --tasks FOLDER [--limit N] [--agents fu,ftu] [--workers 1,2]`.
"""
EVERY_S = 0.5
"""Looks at memory."""


@dataclass
class Options:
    """Of the command line."""

    tasks: Path | None = None
    limit: int | None = None
    agents: tuple[str, ...] = ("fu", "ftu", "stage-reset")
    workers: tuple[int, ...] = (1, 2)
    keep: Path | None = None
    """Folder for the runs."""


@dataclass
class Measured:
    """A run."""

    num_stages: int = 0
    wall_s: float = 0.0
    cpu_s: float = 0.0
    texts: list[str] = field(default_factory=list, repr=False)
    worker_mb: float = 0.0
    agent_mb: float = 0.0

    @property
    def per_s(self) -> float:
        """Stages."""
        return self.num_stages / self.wall_s

    @property
    def per_cpu_s(self) -> float:
        """Stages."""
        return self.num_stages / self.cpu_s


options = Options()


def configure(arguments: Sequence[str]) -> None:
    """Takes the options of the command line."""
    parser = argparse.ArgumentParser(prog="python -m benches evaluation")
    parser.add_argument("--tasks", type=Path)
    parser.add_argument("--limit", type=int)
    parser.add_argument("--agents", type=lambda text: tuple(text.split(",")), default=options.agents)
    parser.add_argument("--workers", type=lambda text: tuple(map(int, text.split(","))), default=options.workers)
    parser.add_argument("--keep", type=Path)
    parser.parse_args(arguments, namespace=options)  # type: ignore[type-var]


def run() -> str:
    """Measures every agent with one worker and with two."""
    lines = [
        "| agent | stages | workers | wall | stages/s | efficiency, wall | efficiency, CPU | stages a CPU second "
        "| peak of a worker | of an agent |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    load = os.getloadavg()[0]
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, range(os.cpu_count() or 1))
    try:
        with tempfile.TemporaryDirectory() as folder:
            tasks = task_files(options.tasks or BUNDLED_TASKS, options.limit)
            for agent in options.agents:
                runs = {
                    number: measured(agent, tasks, number, options.keep or Path(folder)) for number in options.workers
                }
                if len({tuple(one.texts) for one in runs.values()}) > 1:
                    raise AssertionError(f"{agent}: records differ with the number of workers")
                lines += [row(agent, number, one, runs.get(1)) for number, one in runs.items()]
    finally:
        os.sched_setaffinity(0, allowed)
    lines += ["", f"{len(tasks)} houses; {os.cpu_count()} cores, load before it began: {load:.1f}."]
    return "\n".join(lines)


def row(agent: str, num_workers: int, done: Measured, alone: Measured | None) -> str:
    """A run's line; efficiency is compared with one worker."""
    if alone is None or alone is done:
        shares = "|"
    else:
        shares = f"{done.per_s / alone.per_s / num_workers:.0%} | {done.per_cpu_s / alone.per_cpu_s:.0%}"
    return (
        f"| {agent} | {done.num_stages} | {num_workers} | {done.wall_s:.0f} s | {done.per_s:.2f} | {shares} "
        f"| {done.per_cpu_s:.2f} | {done.worker_mb:.0f} MB | {done.agent_mb:.0f} MB |"
    )


def measured(agent: str, tasks: Sequence[TaskFile], num_workers: int, folder: Path) -> Measured:
    """A run into a fresh folder."""
    done, run_dir, looked_s = Measured(), folder / f"{agent}-{num_workers}", 0.0

    def look(news: Progress) -> None:
        nonlocal looked_s
        if time.monotonic() - looked_s >= EVERY_S:
            looked_s = time.monotonic()
            done.worker_mb = max(done.worker_mb, *map(peak_mb, workers()), 0.0)

    began_s, cpu_s = time.monotonic(), time.process_time()
    evaluate([agent], tasks, run_dir, config=RunConfig(), num_workers=num_workers, on_progress=look)
    done.wall_s, done.cpu_s = time.monotonic() - began_s, time.process_time() - cpu_s
    with RunStore(run_dir) as store:
        done.texts = list(store.record_texts())
        done.cpu_s += sum(cpu_s for _, cpu_s in store.timings().values())
        done.agent_mb = max(costs["agent_peak_rss_mb"] for costs in store.costs().values())
        if failures := store.failures():
            raise AssertionError(failures[0])
    done.num_stages = len(done.texts)
    if options.keep is None:
        shutil.rmtree(run_dir)
    return done


def workers() -> list[int]:
    """Children of this process that have children, which are their fork servers."""
    parents: dict[int, int] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with suppress(OSError, IndexError):
                parents[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
    return [child for child, parent in parents.items() if parent == os.getpid() and child in parents.values()]


def peak_mb(pid: int) -> float:
    """Resident memory of a process at its most so far; 0 of one that has ended."""
    with suppress(OSError, StopIteration):
        status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
        return int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1]) / 1024
    return 0.0
