"""`evonav pack --dataset`: results that the Hub's own reader accepts, for the leaderboards of the tasks' card."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from evonav.cli import app
from evonav.errors import InvalidArgumentError
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.run import evaluate
from evonav.report.cards.hub_benchmark import eval_results_yaml, eval_yaml
from evonav.submission.eval_results import write_eval_results
from evonav.tasks.bundled import bundled_tasks
from evonav.tasks.listing import task_files

OLDER_PACK = Path(__file__).parents[1] / "golden" / "data" / "packed.evonav.zip"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results") / "run"
    with bundled_tasks() as tasks:
        evaluate(["fu"], task_files(tasks, 1), folder, num_workers=0)
    return folder


def packed(run: Path, *words: str) -> list[dict[str, Any]]:
    """Pack a run of one agent, and return the entries of its one file of results."""
    target = run.with_name("packed.evonav.zip")
    shown = CliRunner().invoke(app, ["pack", str(run), "--out", str(target), *words], env={"COLUMNS": "200"})
    assert shown.exit_code == 0, shown.output
    (path,) = (run.parent / ".eval_results").iterdir()
    assert path.name == "packed-fu.yaml"
    assert f"results: {path}" in shown.stdout
    found = yaml.safe_load(path.read_text(encoding="utf-8"))
    shutil.rmtree(path.parent)
    assert isinstance(found, list)
    return found


def test_the_hub_reads_what_was_measured_when_and_where(run: Path) -> None:
    hub = pytest.importorskip("huggingface_hub", reason="the Hub's reader of results is in the group `cards`")
    title = 'Our run: "first" #1'
    entries = packed(run, "--dataset", "my-lab/mini@5503434", "--url", "https://example.org", "--title", title)
    sr, spl = hub.parse_eval_result_entries(entries)
    summary = json.loads((run / "summary.json").read_text(encoding="utf-8"))["agents"]["fu"]
    assert (sr.task_id, sr.value) == ("sr_ground_truth", round(100 * summary["sr"], 2))
    assert (spl.task_id, spl.value) == ("spl_ground_truth", round(100 * summary["spl"], 2))
    with RunStore(run) as store:
        began = store.meta("sessions")[0]["began"]
    for entry in (sr, spl):
        assert (entry.dataset_id, entry.dataset_revision, entry.date) == ("my-lab/mini", "5503434", began[:10])
        assert (entry.source_url, entry.source_name) == ("https://example.org", title)
        assert entry.notes.startswith("agent fu; decision text; 1 task; 4 stages;")


def test_an_entry_without_revision_and_address_has_neither(run: Path) -> None:
    for entry in packed(run, "--dataset", "my-lab/mini"):
        assert set(entry) == {"dataset", "value", "date", "notes"}
        assert set(entry["dataset"]) == {"id", "task_id"}


@pytest.mark.parametrize("perception", ["gt", "predicted:mini", "predicted"])
def test_results_are_for_leaderboards_of_the_card(perception: str) -> None:
    boards = {task["id"] for task in yaml.safe_load(eval_yaml("A", "B", "test"))["tasks"]}
    entries = yaml.safe_load(eval_results_yaml("a/b", perception, {"sr": 50.0, "spl": 40.126}, {}))
    assert {entry["dataset"]["task_id"] for entry in entries} < boards
    assert [entry["value"] for entry in entries] == [50.0, 40.13]


def test_other_perceptions_and_malformed_names_are_refused() -> None:
    with pytest.raises(InvalidArgumentError, match="leaderboards for gt and predicted perception, not noisy:poor"):
        eval_results_yaml("a/b", "noisy:poor", {"sr": 1.0, "spl": 1.0}, {})
    with pytest.raises(InvalidArgumentError, match="such as my-lab/evonav-test"):
        eval_results_yaml("mini", "gt", {"sr": 1.0, "spl": 1.0}, {})


def test_each_agent_of_a_pack_has_a_file(tmp_path: Path) -> None:
    pack = Path(shutil.copy(OLDER_PACK, tmp_path / "both.evonav.zip"))
    paths = write_eval_results(pack, "a/b")
    assert [path.name for path in paths] == ["both-ftu.yaml", "both-fu.yaml"]
    assert all("date" not in entry for path in paths for entry in yaml.safe_load(path.read_text(encoding="utf-8")))
