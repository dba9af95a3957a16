"""A packed run of two agents on two tasks, for tests that forge it."""

from pathlib import Path

import pytest
from forged_pack import ForgedPack

from evonav.evaluation.run.evaluate import evaluate
from evonav.submission.pack import pack
from evonav.tasks.listing import BUNDLED_TASKS, TaskFile, task_files


@pytest.fixture(scope="module")
def tasks() -> list[TaskFile]:
    return task_files(BUNDLED_TASKS, 2)


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory, tasks: list[TaskFile]) -> Path:
    """Two agents on two tasks."""
    folder = tmp_path_factory.mktemp("packed")
    evaluate(["fu", "ftu"], tasks, folder / "run", num_workers=0)
    pack(folder / "run", folder / "run.gz")
    return folder / "run.gz"


@pytest.fixture
def parts(packed: Path) -> ForgedPack:
    return ForgedPack.of(packed)
