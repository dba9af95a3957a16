"""`evonav tasks card`: cards that the Hub's, Croissant's and evonav's own readers accept, of files that are there."""

import hashlib
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner, Result

from evonav.cli import app
from evonav.tasks import Task, load_tasks
from evonav.tasks.bundled import bundled_tasks
from evonav.tasks.dataset import check_dataset, read_dataset

ROOT = Path(__file__).parents[2]
DATE = "2026-11-23"
READS_CROISSANT = pytest.mark.filterwarnings("ignore:ConjunctiveGraph is deprecated")  # mlcroissant's own


def card(*words: str | Path) -> Result:
    return CliRunner().invoke(app, ["tasks", "card", *map(str, words)], env={"COLUMNS": "200"})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("card") / "out"
    shown = card("bundled", "--out", out, "--repo", "my-lab/evonav-mini", "--date", DATE)
    assert shown.exit_code == 0, shown.output
    assert f"hf upload my-lab/evonav-mini {out} --repo-type dataset" in shown.output
    return out


@pytest.fixture(scope="module")
def tasks() -> list[Task]:
    with bundled_tasks() as bundled:
        return list(load_tasks(bundled))


def test_the_folder_holds_the_tasks_themselves(folder: Path, tasks: list[Task]) -> None:
    record = read_dataset(folder)
    assert check_dataset(record, folder) == []
    assert [task.header for task in load_tasks(folder)] == [task.header for task in tasks]


def test_the_hub_reads_the_header_and_its_files_exist(folder: Path, tasks: list[Task]) -> None:
    hub = pytest.importorskip("huggingface_hub", reason="the Hub's reader of cards is in the group `cards`")
    data = hub.DatasetCard.load(folder / "README.md").data
    assert (data.license, data.pretty_name) == ("apache-2.0", "EvoNav-Bench: evonav-mini")
    assert (data.task_categories, data.size_categories) == (["robotics"], ["n<1K"])
    ((config),) = data.to_dict()["configs"]
    ((files),) = config["data_files"]
    table, images = files["path"]
    rows = [json.loads(line) for line in (folder / table).read_text(encoding="utf-8").splitlines()]
    assert {row["file_name"] for row in rows} == {
        path.relative_to(folder).as_posix() for path in folder.glob(images)
    }, "a row for each image of the pattern, and an image for each row"
    assert files["split"] == "test"
    assert [(row["task_id"], row["stage"], row["unified_instruction"]) for row in rows] == [
        (task.task_id, stage.stage, stage.unified_instruction) for task in tasks for stage in task.public_stages
    ]


def test_the_rows_hold_nothing_of_the_answers(folder: Path) -> None:
    columns = set(json.loads((folder / "metadata.jsonl").read_text(encoding="utf-8").splitlines()[0]))
    public = {"category", "basic_instruction", "appearance_instruction", "unified_instruction", "writer", "stage"}
    assert columns == public | {"file_name", "task_id", "num_stages", "num_rooms"}


def test_the_body_counts_and_names_what_is_there(folder: Path, tasks: list[Task]) -> None:
    text = (folder / "README.md").read_text(encoding="utf-8")
    counts = dict(re.findall(r"^\| ([a-z ]+) \| (\d+) \|$", text, re.MULTILINE))
    stages = [stage for task in tasks for stage in task.oracle_stages]
    assert counts["tasks"] == str(len(tasks))
    assert counts["stages"] == str(len(stages))
    assert counts["stages before which a room changed"] == str(sum(bool(stage.evolution.changes) for stage in stages))
    assert counts["objects moved by these changes"] == str(sum(len(stage.evolution.changes) for stage in stages))
    assert counts["categories of goals"] == str(len({stage.target.category for stage in stages}))
    for path in [folder / "dataset.json", *folder.glob("*/task.json")]:
        assert hashlib.sha256(path.read_bytes()).hexdigest() in text, path
    assert "| tasks with an evolution | 85.9% | 83.3% [" in text


def test_the_citation_is_that_of_the_repository(folder: Path) -> None:
    paper = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))["preferred-citation"]
    text = (folder / "README.md").read_text(encoding="utf-8")
    authors = " and ".join(f"{author['family-names']}, {author['given-names']}" for author in paper["authors"])
    assert f"{{{authors}}}" in text
    assert f"{{{paper['title']}}}" in text
    assert paper["url"] in text


@READS_CROISSANT
def test_croissant_loads_every_record_of_the_tasks(folder: Path, tasks: list[Task]) -> None:
    mlc = pytest.importorskip("mlcroissant", reason="the reader of Croissant is in the group `cards`")
    dataset = mlc.Dataset(jsonld=str(folder / "croissant.json"))
    assert not dataset.metadata.ctx.issues.errors
    assert not dataset.metadata.ctx.issues.warnings

    def records(name: str) -> list[dict[str, Any]]:
        read = ({key.partition("/")[2]: _text(value) for key, value in row.items()} for row in dataset.records(name))
        return sorted(read, key=lambda row: (row["task_id"], row.get("stage")))

    headers = [task.header for task in tasks]
    assert [(row["task_id"], row["seed"], row["num_stages"], row["house_sha256"]) for row in records("tasks")] == [
        (header.task_id, header.seed, header.num_stages, header.house.sha256) for header in headers
    ]
    assert [row["start_position_m"] for row in records("tasks")] == [
        pytest.approx(header.start_pose.position_m) for header in headers
    ]
    goals = [stage for task in tasks for stage in task.public_stages]
    images = [image for task in tasks for image in task.reference_images]
    for row, goal, image in zip(records("stages"), goals, images, strict=True):
        assert (row["stage"], row["category"], row["writer"]) == (goal.stage, goal.category, goal.writer)
        assert row["appearance_instruction"] == goal.appearance_instruction
        assert np.array_equal(np.asarray(row["image"]), image)
    answers = [stage for task in tasks for stage in task.oracle_stages]
    for row, answer in zip(records("oracle_stages"), answers, strict=True):
        assert (row["outcome"], row["mode"]) == (answer.evolution.outcome, answer.evolution.mode)
        assert (row["target_id"], row["is_relocated_ever"]) == (answer.target.id, answer.target.is_relocated_ever)
        assert row["target_position_m"] == pytest.approx(answer.target.position_m)


def _text(value: Any) -> Any:
    return value.decode() if isinstance(value, bytes) else value


@READS_CROISSANT
def test_croissant_refuses_a_file_that_was_altered(folder: Path, tmp_path: Path) -> None:
    mlc = pytest.importorskip("mlcroissant", reason="the reader of Croissant is in the group `cards`")
    data = json.loads((folder / "croissant.json").read_text(encoding="utf-8"))
    assert {one["@id"] for one in data["distribution"] if "sha256" in one} == {"dataset.json", "metadata.jsonl"}
    (tmp_path / "croissant.json").write_text(json.dumps(data), encoding="utf-8")
    rows = (folder / "metadata.jsonl").read_text(encoding="utf-8")
    (tmp_path / "metadata.jsonl").write_text(rows.replace("Please", "please", 1), encoding="utf-8")
    (tmp_path / "dataset.json").write_bytes((folder / "dataset.json").read_bytes())
    with pytest.raises(mlc.GenerationError, match="Download"):
        list(mlc.Dataset(jsonld=str(tmp_path / "croissant.json")).records("stages"))


def test_the_benchmark_has_a_leaderboard_for_each_metric_and_perception(folder: Path) -> None:
    benchmark = yaml.safe_load((folder / "eval.yaml").read_text(encoding="utf-8"))
    assert set(benchmark) == {"name", "description", "evaluation_framework", "tasks"}
    assert benchmark["evaluation_framework"] == "evonav"
    assert [task["id"] for task in benchmark["tasks"]] == [
        "sr_ground_truth",
        "spl_ground_truth",
        "sr_predicted",
        "spl_predicted",
    ]
    assert {(task["config"], task["split"]) for task in benchmark["tasks"]} == {("default", "test")}


def test_cards_beside_the_tasks_are_the_same(folder: Path) -> None:
    before = {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    shown = card(folder / "dataset.json", "--out", folder, "--repo", "my-lab/evonav-mini", "--date", DATE)
    assert shown.exit_code == 0, shown.output
    assert {path: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before


def altered(folder: Path, to: Path, name: str, old: str, new: str) -> Path:
    """Copy the first task and its `dataset.json`, with a text replaced in a file."""
    record = json.loads((folder / "dataset.json").read_text(encoding="utf-8"))
    first = record["tasks"][0]["task_id"]
    record |= {"tasks": record["tasks"][:1], "num_tasks": 1, "num_houses": 1}
    for path in (folder / first).rglob("*.*"):
        copy = to / path.relative_to(folder)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    (to / "dataset.json").write_text(json.dumps(record), encoding="utf-8")
    (path,) = to.glob(name)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    return to


def test_tasks_that_were_altered_are_refused(folder: Path, tmp_path: Path) -> None:
    tasks = altered(folder, tmp_path / "tasks", "*/public/stage_1.json", "Please", "please")
    shown = card(tasks, "--out", tmp_path / "out")
    assert shown.exit_code == 1
    assert "stage_1.json" in str(shown.exception)
    assert not (tmp_path / "out").exists()


def test_a_folder_without_a_list_of_its_tasks_is_refused(folder: Path, tmp_path: Path) -> None:
    tasks = altered(folder, tmp_path / "tasks", "dataset.json", "evonav-mini", "one")
    (tasks / "dataset.json").unlink()
    assert "has no dataset.json" in str(card(tasks, "--out", tmp_path / "out").exception)


def test_a_licence_that_is_not_known_is_asked_for(folder: Path, tmp_path: Path) -> None:
    source = "a75a5b67fb0c24041628bf738c52c8898a228451b8b203f7c915c6b42558ce4a"
    tasks = altered(folder, tmp_path / "tasks", "dataset.json", source, "0" * 64)
    shown = card(tasks, "--out", tmp_path / "out")
    assert "name it with --license" in str(shown.exception)
    shown = card(tasks, "--out", tmp_path / "out", "--license", "cc-by-4.0", "--name", 'Mine: "new" <b>')
    assert shown.exit_code == 0, shown.output
    header = (tmp_path / "out" / "README.md").read_text(encoding="utf-8").split("---\n")[1]
    read = yaml.safe_load(header)
    assert (read["license"], read["pretty_name"]) == ("cc-by-4.0", 'Mine: "new" <b>')


def test_a_folder_of_other_tasks_is_refused(folder: Path, tmp_path: Path) -> None:
    tasks = altered(folder, tmp_path / "tasks", "dataset.json", "evonav-mini", "one")
    shown = card(tasks, "--out", folder)
    assert "holds other tasks" in str(shown.exception)


@pytest.mark.parametrize("words", [("--repo", "mine"), ("--license", "CC BY"), ("--date", "23.11.2026")])
def test_a_malformed_option_is_named(words: tuple[str, str], tmp_path: Path) -> None:
    shown = card("bundled", "--out", tmp_path, *words)
    assert str(shown.exception).startswith(f"{words[0]} {words[1]!r}: expected a value such as ")
