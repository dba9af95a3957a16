"""Read a folder of tasks for its cards: what it holds, whole and checked, and a row for each stage."""

import json
import re
from collections import Counter
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path

from evonav.errors import TaskError
from evonav.parallel.folders import sha256_of_file
from evonav.tasks import Task
from evonav.tasks.dataset import DATASET_NAME, DatasetRecord, check_dataset, read_dataset
from evonav.tasks.files import load_tasks


@dataclass(frozen=True, slots=True)
class TaskSet:
    """A folder of tasks, read for its cards."""

    folder: Path
    record: DatasetRecord
    rows: tuple[dict[str, str | int], ...]
    """The public part of each stage, with its task and the path of its image."""
    num_changes: int
    """Number of objects that change their place between two stages, over all stages."""
    num_evolved: int
    """Number of stages before which a room changed."""
    writers: tuple[str, ...]
    """Writers of the instructions, the most frequent first."""
    paths: tuple[str, ...]
    """All files of the set, relative to the folder."""

    @property
    def split(self) -> str:
        """The split's name in the form that hubs accept."""
        return re.sub(r"\W", "_", self.record.split)

    @property
    def has_bundled_houses(self) -> bool:
        """True if all houses are those that come with evonav, whose licence is known."""
        with as_file(files("evonav") / "data" / "houses.jsonl.gz") as path:
            bundled = sha256_of_file(path)
        return all(source.sha256 == bundled for source in self.record.sources)

    @property
    def metadata(self) -> str:
        """The rows as JSON Lines."""
        return "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in self.rows)


def read_task_set(folder: Path) -> TaskSet:
    """Read a folder of tasks, and check every checksum.

    Args:
        folder: A folder with a `dataset.json`, or that file.

    Raises:
        TaskError: A file is missing or malformed, or the tasks are not those of `dataset.json`.
    """
    folder = folder.parent if folder.name == DATASET_NAME else folder
    if not (folder / DATASET_NAME).is_file():
        raise TaskError(f"{folder}: has no {DATASET_NAME}, which `evonav tasks generate` writes beside the tasks")
    record = read_dataset(folder)
    for task_id, problem in check_dataset(record, folder):
        raise TaskError(f"{folder}: {task_id}: {problem}; generate the tasks again, or remove what does not belong")
    rows: list[dict[str, str | int]] = []
    paths = [DATASET_NAME]
    writers: Counter[str] = Counter()
    num_changes = num_evolved = 0
    for task in load_tasks(folder):
        rows += _rows(task)
        paths += [f"{task.task_id}/{name}" for name in ("task.json", *task.header.checksums)]
        writers.update(stage.writer for stage in task.public_stages)
        num_changes += sum(len(stage.evolution.changes) for stage in task.oracle_stages)
        num_evolved += sum(stage.evolution.outcome == "evolved" for stage in task.oracle_stages)
    return TaskSet(
        folder=folder,
        record=record,
        rows=tuple(rows),
        num_changes=num_changes,
        num_evolved=num_evolved,
        writers=tuple(name for name, _ in writers.most_common()),
        paths=tuple(paths),
    )


def _rows(task: Task) -> list[dict[str, str | int]]:
    return [
        {
            "file_name": f"{task.task_id}/public/stage_{stage.stage}.png",
            "task_id": task.task_id,
            "stage": stage.stage,
            "num_stages": task.num_stages,
            "num_rooms": task.header.house.num_rooms,
            "category": stage.category,
            "basic_instruction": stage.basic_instruction,
            "appearance_instruction": stage.appearance_instruction,
            "unified_instruction": stage.unified_instruction,
            "writer": stage.writer,
        }
        for stage in task.public_stages
    ]
