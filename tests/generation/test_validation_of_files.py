"""Damaged files are named, and so is what public files say of oracle data."""

import dataclasses
import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest
from damaged_task import kinds, signed
from PIL import Image, PngImagePlugin

from evonav.generation.validation import validate_files
from evonav.tasks import Task, load_task
from evonav.tasks.records import read_gzip, write_gzip


def test_all_that_is_wrong_is_collected_and_not_the_first_only(root: Path) -> None:
    (root / "public/stage_1.png").unlink()
    (root / "houses/stage_2.json.gz").write_bytes(b"noise")
    document = json.loads((root / "oracle/stage_3.json").read_text(encoding="utf-8"))
    document["target"]["score"] = math.nan
    document["stranger"] = 1
    (root / "oracle/stage_3.json").write_text(json.dumps(document), encoding="utf-8")
    problems = [(problem.stage, problem.kind, problem.detail) for problem in validate_files(root).problems]
    assert [(stage, kind) for stage, kind, _ in problems] == [(1, "file"), (2, "file"), (3, "schema"), (3, "schema")]
    assert "public/stage_1.png" in problems[0][2]
    assert "houses/stage_2.json.gz" in problems[1][2]
    assert {"score", "stranger"} == {
        word for _, _, detail in problems[2:] for word in ("score", "stranger") if word in detail
    }


@pytest.mark.parametrize("name", ["task.json", "public/stage_1.json", "oracle/stage_2.json", "houses/stage_3.json.gz"])
@pytest.mark.parametrize("damage", ["gone", "cut", "empty"])
def test_damaged_files_are_named(root: Path, name: str, damage: str) -> None:
    data = (root / name).read_bytes()
    (root / name).unlink()
    if damage != "gone":
        (root / name).write_bytes(data[: len(data) // 2] if damage == "cut" else b"")
    report = validate_files(root)
    assert any(name in problem.detail and problem.kind in ("file", "schema") for problem in report.problems)


@pytest.mark.parametrize("name", ["oracle/stage_1.json", "public/stage_2.json"])
def test_another_schema_version_and_unknown_keys_are_refused(root: Path, name: str) -> None:
    path = root / name
    for change in ({"schema_version": 2}, {"unknown": None}):
        path.write_text(json.dumps({**json.loads(path.read_text(encoding="utf-8")), **change}), encoding="utf-8")
        assert kinds(validate_files(root)) == {"schema"}


def test_changed_contents_do_not_match_their_checksum(root: Path) -> None:
    path = root / "houses/stage_2.json.gz"
    house = json.loads(read_gzip(path))
    house["metadata"]["note"] = "changed"
    path.write_bytes(write_gzip(json.dumps(house).encode()))
    report = validate_files(root)
    assert {(problem.stage, problem.kind) for problem in report.problems} >= {(0, "checksum"), (2, "checksum")}


def test_strange_files_are_found(root: Path) -> None:
    (root / "notes.txt").touch()
    (root / "public/solution.json").touch()
    found = {(problem.kind, problem.detail.split(":")[0]) for problem in validate_files(root).problems}
    assert found == {("stranger", "notes.txt"), ("leak", "public/solution.json")}


def test_files_that_contradict_each_other(root: Path) -> None:
    task = load_task(root)
    public = tuple(stage.model_copy(update={"category": "Bed"}) for stage in task.public_stages)
    signed(dataclasses.replace(task, public_stages=public), root)
    assert "contradiction" in kinds(validate_files(root))
    moved = root.rename(root.parent / "another")
    assert "contradiction" in kinds(validate_files(moved))


def leaking(word: str) -> Callable[[Task], Task]:
    def change(task: Task) -> Task:
        first = task.public_stages[0]
        text = first.basic_instruction.replace(".", f" {word}.")
        public = (first.model_copy(update={"basic_instruction": text}), *task.public_stages[1:])
        return dataclasses.replace(task, public_stages=public)

    return change


@pytest.mark.parametrize("what", ["id", "room", "coordinate"])
def test_ids_and_coordinates_in_public_words_are_leaks(root: Path, what: str) -> None:
    task = load_task(root)
    target = task.oracle(1).target
    word = {"id": target.id, "room": target.room_id, "coordinate": f"at {target.position_m[0]:.2f}"}[what]
    signed(leaking(word)(task), root)
    assert kinds(validate_files(root)) == {"leak"}


def test_text_in_an_image_is_a_leak(root: Path) -> None:
    path = root / "public/stage_1.png"
    info = PngImagePlugin.PngInfo()
    info.add_text("target", "4|0|1")
    with Image.open(path) as image:
        image.save(path, pnginfo=info)
    report = validate_files(root)
    assert kinds(report) == {"leak"}
    assert "tEXt" in report.problems[0].detail


def test_bytes_after_an_image_are_a_leak(root: Path) -> None:
    path = root / "public/stage_1.png"
    path.write_bytes(path.read_bytes() + b"4|0|1")
    assert kinds(validate_files(root)) == {"leak"}
