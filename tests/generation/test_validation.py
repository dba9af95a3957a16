"""Every kind of damage is named; what is sound is not."""

import dataclasses
import json
import shutil
from pathlib import Path

import pytest

from evonav.cli import app
from evonav.errors import TaskError
from evonav.generation.validation import KINDS, validate_files, validate_folder, validate_task
from evonav.tasks import load_task, write_task
from evonav.tasks.dataset import DatasetRecord, entry_of, write_dataset


def test_a_sound_task_has_no_problem(root: Path) -> None:
    report = validate_files(root)
    assert report.problems == ()
    assert report.num_stages == 3
    assert validate_task(load_task(root)) == report


def test_bundled_tasks_are_sound() -> None:
    from evonav.tasks.listing import BUNDLED_TASKS

    report = validate_folder(BUNDLED_TASKS)
    assert list(report.problems) == []
    assert len(report.reports) >= 24


@pytest.fixture
def folder(root: Path) -> Path:
    task = load_task(root)
    other = dataclasses.replace(task, header=task.header.model_copy(update={"task_id": "another"}))
    write_task(other, root.parent)
    write_dataset(
        DatasetRecord(
            name="evonav",
            split="none",
            generator=task.header.generator,
            sources=(),
            seed=4,
            limit=None,
            subset=None,
            allow_unknown_assets=False,
            parameters=task.header.parameters,
            num_houses=2,
            num_tasks=2,
            tasks=(entry_of(other), entry_of(task)),
            rejections=(),
        ),
        root.parent,
    )
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
    from typer.testing import CliRunner

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
    from typing import get_args

    from evonav.generation.validation import ProblemKind

    assert set(KINDS) == set(get_args(ProblemKind))
