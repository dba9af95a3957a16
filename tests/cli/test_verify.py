"""`evonav verify`: what a limit requires, and what it says."""

from pathlib import Path

from typer.testing import CliRunner

from evonav.cli import app
from evonav.evaluation.run.evaluate import evaluate
from evonav.submission.pack import pack
from evonav.tasks.listing import BUNDLED_TASKS, task_files


def test_a_limit_requires_and_replays_only_the_first_tasks(tmp_path: Path) -> None:
    evaluate(["ftu"], task_files(BUNDLED_TASKS, 2), tmp_path / "two", num_workers=0)
    pack(tmp_path / "two", tmp_path / "two.gz")
    words = ["verify", str(tmp_path / "two.gz"), "--workers", "0", "--limit"]
    for limit, code, told in (
        ("1", 0, "verified 1 of 2 tasks"),
        ("2", 0, "accepted"),
        ("3", 1, "only the first 2 of 3 are there: --limit 2"),
    ):
        shown = CliRunner().invoke(app, [*words, limit], env={"COLUMNS": "200"})
        assert (shown.exit_code, told in shown.stdout) == (code, True), shown.stdout
    shown = CliRunner().invoke(app, [*words, "2"], env={"COLUMNS": "200"}).stdout
    assert "verified" not in shown
    assert "isolation of agents, as the run notes it: none" in shown
