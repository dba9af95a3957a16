"""Every kind of damage is named, and so is what public files say of oracle data; what is sound is not."""

import dataclasses
import json
import math
import shutil
from pathlib import Path
from typing import get_args

import pytest
from damaged_task import kinds, signed
from generated_folder import record_of
from PIL import Image, PngImagePlugin
from typer.testing import CliRunner

from evonav.cli import app
from evonav.errors import TaskError
from evonav.generation.validation import KINDS, ProblemKind, validate_files, validate_folder, validate_task
from evonav.tasks import load_task, write_task
from evonav.tasks.dataset import entry_of, write_dataset
from evonav.tasks.listing import BUNDLED_TASKS
from evonav.tasks.records import read_gzip, write_gzip


def test_a_sound_task_has_no_problem(root: Path) -> None:
    report = validate_files(root)
    assert report.problems == ()
    assert report.num_stages == 3
    assert validate_task(load_task(root)) == report


@pytest.mark.parametrize("limit", [4, pytest.param(24, marks=pytest.mark.slow)])
def test_bundled_tasks_are_sound(limit: int) -> None:
    report = validate_folder(BUNDLED_TASKS, limit=limit)
    assert list(report.problems) == []
    assert len(report.reports) == limit


@pytest.fixture
def folder(root: Path) -> Path:
    task = load_task(root)
    other = dataclasses.replace(task, header=task.header.model_copy(update={"task_id": "another"}))
    write_task(other, root.parent)
    record = record_of((entry_of(other), entry_of(task)), parameters=task.header.parameters)
    write_dataset(record, root.parent)
    return root.parent


def test_a_folder_gives_the_same_report_for_any_number_of_workers(folder: Path, root: Path) -> None:
    (root / "public/stage_1.png").unlink()
    seen: list[tuple[int, int]] = []
    alone = validate_folder(folder, on_progress=lambda done, total: seen.append((done, total)))
    assert seen == [(0, 2), (1, 2), (2, 2)]
    assert [problem.kind for problem in alone.problems] == ["file"]
    assert alone.num_invalid == 1
    assert validate_folder(folder, num_workers=2) == alone
    assert len(validate_folder(folder, limit=1).reports) == 1


def test_the_dataset_record_is_checked(folder: Path, root: Path) -> None:
    shutil.rmtree(root)
    report = validate_folder(folder)
    assert [(problem.task_id, problem.kind) for problem in report.problems] == [(root.name, "dataset")]
    (folder / "dataset.json").write_text("{}", encoding="utf-8")
    assert {problem.kind for problem in validate_folder(folder).problems} == {"dataset"}


def test_an_empty_folder_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(TaskError, match="holds no task"):
        validate_folder(tmp_path)


def test_the_command_says_what_is_wrong_and_exits_with_1(
    folder: Path, root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["tasks", "validate", str(folder), "--workers", "0"]
    good = CliRunner().invoke(app, arguments)
    assert good.exit_code == 0, good.output
    assert "2 of 2 tasks valid" in good.output
    (root / "oracle/stage_1.json").write_text("{}", encoding="utf-8")
    bad = CliRunner().invoke(app, arguments)
    assert bad.exit_code == 1
    assert "1 of 2 tasks valid" in bad.output
    assert "schema" in bad.output
    as_json = CliRunner().invoke(app, [*arguments, "--json"])
    assert as_json.exit_code == 1
    found = json.loads(as_json.stdout)
    assert found["num_invalid"] == 1
    assert {problem["kind"] for problem in found["problems"]} == {"schema"}
    assert {problem["task_id"] for problem in found["problems"]} == {root.name}


def test_every_kind_is_explained() -> None:
    assert set(KINDS) == set(get_args(ProblemKind))


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


@pytest.mark.parametrize("what", ["id", "room", "coordinate"])
def test_ids_and_coordinates_in_public_words_are_leaks(root: Path, what: str) -> None:
    task = load_task(root)
    target = task.oracle(1).target
    word = {"id": target.id, "room": target.room_id, "coordinate": f"at {target.position_m[0]:.2f}"}[what]
    first = task.public_stages[0]
    text = first.basic_instruction.replace(".", f" {word}.")
    public = (first.model_copy(update={"basic_instruction": text}), *task.public_stages[1:])
    signed(dataclasses.replace(task, public_stages=public), root)
    assert kinds(validate_files(root)) == {"leak"}


def test_text_in_an_image_and_bytes_after_it_are_leaks(root: Path) -> None:
    path = root / "public/stage_1.png"
    plain = path.read_bytes()
    path.write_bytes(plain + b"4|0|1")
    assert kinds(validate_files(root)) == {"leak"}
    info = PngImagePlugin.PngInfo()
    info.add_text("target", "4|0|1")
    path.write_bytes(plain)
    with Image.open(path) as image:
        image.save(path, pnginfo=info)
    report = validate_files(root)
    assert kinds(report) == {"leak"}
    assert "tEXt" in report.problems[0].detail
