"""The README, held to what its commands do."""

import re
import sqlite3
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from update_readme import headline, readme_results

pytestmark = pytest.mark.slow
REPOSITORY = Path(__file__).parents[2]
NUM_TASKS_AGAIN = 3


def _evonav(*arguments: object, cwd: Path) -> str:
    command = [sys.executable, "-m", "evonav", *map(str, arguments)]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def _rows(run: Path) -> dict[tuple[str, str, int], str]:
    with sqlite3.connect(run / "records.sqlite") as connection:
        rows: list[Any] = connection.execute("SELECT agent, task_id, stage, record FROM stages").fetchall()
    return {(agent, task_id, stage): record for agent, task_id, stage, record in rows}


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`make demo`, less the set-up: two workers, whatever the machine."""
    folder = tmp_path_factory.mktemp("demo")
    printed = _evonav("demo", "--workers", 2, "--out", "demo", cwd=folder)
    assert "report.html" in printed
    return folder / "demo"


def test_readme_shows_what_the_demo_measures(demo: Path) -> None:
    assert readme_results() == headline(demo), "run `make readme`"


def test_report_is_one_page_with_every_stage(demo: Path) -> None:
    page = (demo / "report.html").read_text(encoding="utf-8")
    rows = _rows(demo)
    assert len(rows) > 250
    assert not re.search(r"(src|href)=\"(https?:)?//", page), "the page opens without a network"
    for task_id in {task_id for _, task_id, _ in rows}:
        assert task_id in page


def test_one_worker_leaves_the_same_bytes_as_two(demo: Path, tmp_path: Path) -> None:
    _evonav("demo", "--workers", 1, "--limit", NUM_TASKS_AGAIN, "--out", "again", cwd=tmp_path)
    again, before = _rows(tmp_path / "again"), _rows(demo)
    assert len({task_id for _, task_id, _ in again}) == NUM_TASKS_AGAIN
    assert again == {key: before[key] for key in again}


def test_readme_code_runs(tmp_path: Path) -> None:
    blocks = re.findall(r"```python\n(.*?)```", (REPOSITORY / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert blocks
    for block in blocks:
        subprocess.run([sys.executable, "-W", "error", "-c", block], cwd=tmp_path, check=True)
