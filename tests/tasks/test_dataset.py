import dataclasses
import hashlib
import json
from itertools import pairwise, permutations
from pathlib import Path
from typing import Any

import pytest
from generated_folder import record_of

from evonav.errors import TaskError
from evonav.tasks import Task, write_task
from evonav.tasks.dataset import (
    TaskEntry,
    check_dataset,
    entry_of,
    read_dataset,
    write_dataset,
)
from evonav.tasks.subsets import SubsetError, subset_of


def sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def entries_of(num: int) -> tuple[TaskEntry, ...]:
    return tuple(
        TaskEntry(task_id=f"t{number:03}", sha256=sha256(f"task {number}"), house_sha256=sha256(f"house {number}"))
        for number in range(num)
    )


@pytest.fixture
def folder(task: Task, tmp_path: Path) -> Path:
    """Two tasks and their record."""
    other = dataclasses.replace(task, header=task.header.model_copy(update={"task_id": "another"}))
    for each in (task, other):
        write_task(each, tmp_path)
    write_dataset(record_of((entry_of(other), entry_of(task))), tmp_path)
    return tmp_path


def test_a_dataset_record_reads_back_and_matches_its_folder(folder: Path, task: Task) -> None:
    record = read_dataset(folder)
    assert record_of(record.tasks) == record
    assert record.num_rejected == {"too_few_rooms": 1}
    assert [entry.task_id for entry in record.tasks] == ["another", task.task_id]
    assert record.tasks[1].house_sha256 == sha256(task.house_json(1))
    assert check_dataset(record, folder) == []
    assert not list(folder.glob("*.partial"))


def test_missing_changed_and_new_tasks_are_named(folder: Path, task: Task) -> None:
    record = read_dataset(folder)
    header = folder / "another" / "task.json"
    header.write_text(header.read_text(encoding="utf-8").replace('"seed": 4', '"seed": 5'), encoding="utf-8")
    (folder / task.task_id / "task.json").unlink()
    write_task(dataclasses.replace(task, header=task.header.model_copy(update={"task_id": "new"})), folder)
    assert dict(check_dataset(record, folder)) == {
        "another": "task.json is not the one that dataset.json lists",
        task.task_id: "listed in dataset.json, but not there",
        "new": "not listed in dataset.json",
    }


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"num_tasks": 3}, "num_tasks"),
        ({"num_houses": 2}, "num_houses"),
        ({"stranger": 1}, "stranger"),
        ({"seed": -1}, "seed"),
        ({"schema_version": 2}, "schema_version"),
    ],
)
def test_a_record_that_contradicts_itself_is_refused_by_field(folder: Path, change: dict[str, Any], field: str) -> None:
    path = folder / "dataset.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**document, **change}), encoding="utf-8")
    with pytest.raises(TaskError, match=rf"dataset\.json: {field} = "):
        read_dataset(folder)


@pytest.mark.parametrize("order", [(1, 0), (0, 0)])
def test_tasks_are_listed_once_and_in_order(tmp_path: Path, order: tuple[int, ...]) -> None:
    entries = entries_of(2)
    write_dataset(record_of(tuple(entries[index] for index in order)), tmp_path)
    with pytest.raises(TaskError, match="tasks = 't000': expected each task once, in order of task id"):
        read_dataset(tmp_path)


def test_a_folder_that_cannot_be_written_is_a_task_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(TaskError, match="cannot be written"):
        write_dataset(record_of(()), tmp_path / "file")


def test_the_order_of_subsets_is_the_published_one() -> None:
    """The sentence of docs/tasks.md, done by hand."""
    entries = entries_of(30)
    by_hand = sorted(entries, key=lambda entry: sha256("evonav-subset-1:" + entry.house_sha256))[:5]
    chosen = subset_of(record_of(entries), "test-5")
    assert chosen == tuple(sorted(by_hand, key=lambda entry: entry.task_id))
    # Frozen: the same list for everyone, for ever.
    assert [entry.task_id for entry in chosen] == ["t001", "t020", "t022", "t028", "t029"]


def test_subsets_depend_on_the_contents_of_houses_alone() -> None:
    entries = entries_of(5)
    chosen = {entry.house_sha256 for entry in subset_of(record_of(entries), "test-3")}
    for number, order in enumerate(permutations(range(5))):
        named = [entry.model_copy(update={"task_id": f"{order[i]}"}) for i, entry in enumerate(entries)]
        record = record_of(tuple(sorted(named, key=lambda entry: entry.task_id)), name=f"other {number}")
        assert {entry.house_sha256 for entry in subset_of(record, "test-3")} == chosen


def test_smaller_subsets_are_part_of_larger_ones() -> None:
    record = record_of(entries_of(40))
    chosen = [set(subset_of(record, f"test-{num}")) for num in range(1, 41)]
    assert all(fewer < more for fewer, more in pairwise(chosen))


def test_a_duplicate_house_counts_once() -> None:
    one, two = entries_of(2)
    record = record_of((one, two, one.model_copy(update={"task_id": "t9"})))
    assert subset_of(record, "test-2") == (one, two)
    with pytest.raises(SubsetError, match="only 2 houses"):
        subset_of(record, "test-3")


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("test-91", {}, "only 90 houses give a task"),
        ("val-10", {}, "of split 'test', not of 'val'"),
        ("test", {}, "expected SPLIT-N"),
        ("test-0", {}, "expected SPLIT-N"),
        ("test-10", {"limit": 90}, "the first 90 of their split"),
    ],
)
def test_the_error_for_an_impossible_subset_gives_the_reason(name: str, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SubsetError, match=message):
        subset_of(record_of(entries_of(90), **changes), name)


def test_a_limit_that_was_not_reached_leaves_the_split_whole() -> None:
    assert len(subset_of(record_of(entries_of(90), limit=91), "test-10")) == 10
