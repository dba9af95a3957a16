"""Rank packed runs: each file is verified, and only agents that were evaluated alike share a table."""

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evonav.errors import InvalidArgumentError
from evonav.submission.file import SUFFIX, Submission, SubmissionError, read_header
from evonav.submission.packed_setup import PackedSetup, packed_setup
from evonav.submission.verify import PackVerdict, verify
from evonav.tasks.listing import TaskFile


@dataclass(frozen=True, slots=True)
class RankedTasks:
    """Tasks that an entry of a leaderboard has to contain, all of them."""

    name: str
    tasks: tuple[TaskFile, ...]

    @property
    def num_stages(self) -> int:
        """Number of stages of all tasks."""
        return sum(task.num_stages for task in self.tasks)

    @property
    def sha256(self) -> str:
        """SHA-256 over the ids and checksums of the tasks, in order of their ids."""
        lines = sorted(f"{task.task_id} {task.digest}\n" for task in self.tasks)
        return hashlib.sha256("".join(lines).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class Conditions:
    """Conditions that two agents must share to be compared."""

    task_set: str
    """SHA-256 of the task set."""
    perception: str
    """Perception, as `--perception` names it."""
    decision: str
    """Kind of the decision model: text, looks, vlm or custom; with the rates of its simulated mistakes."""
    simulator: str
    """Simulator, unless it is the usual one."""


@dataclass(frozen=True, slots=True)
class RankedAgent:
    """An agent of a file that was verified."""

    file: str
    agent: str
    rates: Mapping[str, Any]
    """Its rates as scored again, by the names of `summary.json`."""
    sha256: str
    """SHA-256 of its records."""
    header: Submission
    setup: PackedSetup


@dataclass(frozen=True, slots=True)
class Unranked:
    """A file, or an agent of it, that has no place in a table."""

    file: str
    status: str
    """`incomplete`, `rejected` or `repeated`."""
    detail: str


@dataclass(frozen=True, slots=True)
class Leaderboard:
    """Packed runs, by the conditions under which they are comparable."""

    tables: dict[Conditions, list[RankedAgent]] = field(default_factory=dict)
    """Entries under the same conditions, the largest SR first."""
    task_sets: dict[str, RankedTasks] = field(default_factory=dict)
    """The task sets by their SHA-256."""
    unranked: list[Unranked] = field(default_factory=list)
    is_rescored: bool = True
    """True if the actions of every entry were executed again."""


def packed_files(paths: Iterable[Path]) -> list[Path]:
    """List packed runs: the files named, and those in the folders named and below them.

    Raises:
        InvalidArgumentError: There is none.
    """
    named = list(paths)
    found = [file for path in named for file in (sorted(path.rglob(f"*{SUFFIX}")) if path.is_dir() else [path])]
    if not found:
        where = ", ".join(map(str, named))
        raise InvalidArgumentError(f"{where}: no packed run (*{SUFFIX}); `evonav pack RUN` writes one")
    return list(dict.fromkeys(found))


def rank(
    files: Sequence[Path],
    task_sets: Sequence[RankedTasks],
    *,
    scores_only: bool = False,
    num_workers: int = 0,
    on_progress: Callable[[int, int, str], None] = lambda _done, _all, _name: None,
) -> Leaderboard:
    """Verify packed runs, and sort their agents into tables.

    Args:
        task_sets: Sets of tasks. An entry has all tasks of one of them.
        scores_only: Compute scores from the recorded paths instead of executing the actions again.
        num_workers: Number of processes; 0 runs in this one.
        on_progress: Called with the number of files verified, of all, and the name of the next one.
    """
    board = Leaderboard(task_sets={one.sha256: one for one in task_sets}, is_rescored=not scores_only)
    seen: dict[tuple[Conditions, str], str] = {}
    for number, path in enumerate(files):
        on_progress(number, len(files), path.name)
        try:
            header = read_header(path)
            tasks = _task_set(header, task_sets)
            known = {packed.task_id for packed in header.tasks}
            required = [task for task in tasks.tasks if task.task_id in known]
            verdict = verify(path, required, scores_only=scores_only, num_workers=num_workers)
            if (reason := _refusal(path, verdict, header, tasks)) is not None:
                board.unranked.append(reason)
                continue
            setup = packed_setup(header)
        except (SubmissionError, InvalidArgumentError) as error:
            board.unranked.append(Unranked(path.name, "rejected", str(error).removeprefix(f"{path}: ")))
            continue
        conditions = Conditions(tasks.sha256, setup.perception, setup.decision, setup.simulator)
        for agent, sha256 in verdict.digests.items():
            if (first := seen.setdefault((conditions, sha256), path.name)) != path.name:
                board.unranked.append(Unranked(path.name, "repeated", f"{agent} has the same records as in {first}"))
                continue
            assert verdict.summary is not None  # every check is passed
            entry = RankedAgent(path.name, agent, verdict.summary["agents"][agent], sha256, header, setup)
            board.tables.setdefault(conditions, []).append(entry)
    for entries in board.tables.values():
        entries.sort(key=lambda entry: (-(entry.rates["sr"] or 0), -(entry.rates["spl"] or 0), entry.file))
    on_progress(len(files), len(files), "")
    return board


def _task_set(header: Submission, task_sets: Sequence[RankedTasks]) -> RankedTasks:
    """Return the set with the most tasks of a file."""
    packed = {(task.task_id, task.digest) for task in header.tasks}
    common = [len(packed & {(task.task_id, task.digest) for task in one.tasks}) for one in task_sets]
    if not any(common):
        raise SubmissionError("its tasks are not among those to verify with: name their folder with --tasks")
    fewest = min(len(one.tasks) for one, number in zip(task_sets, common, strict=True) if number == max(common))
    return next(
        one for one, number in zip(task_sets, common, strict=True) if number == max(common) and len(one.tasks) == fewest
    )


def _refusal(path: Path, verdict: PackVerdict, header: Submission, tasks: RankedTasks) -> Unranked | None:
    failed = next((check for check in verdict.checks if not check.is_passed), None)
    if failed is not None:
        status = "incomplete" if failed.name == "complete" else "rejected"
        return Unranked(path.name, status, f"{failed.name}: {failed.detail.removeprefix(f'{path}: ')}")
    if len(header.tasks) < len(tasks.tasks):
        return Unranked(path.name, "incomplete", f"{len(header.tasks)} of {len(tasks.tasks)} tasks of {tasks.name}")
    return None
