"""A named subset is the same, made alone or taken from the whole, in any order of houses, by any number of workers."""

import json
import random
from pathlib import Path

import pytest
from typer.testing import CliRunner

from evonav.cli import app
from evonav.errors import InvalidArgumentError, StoreError, TaskError
from evonav.generation.dataset import generate_dataset
from evonav.generation.worker import GenerationOptions
from evonav.house import bundled_houses
from evonav.parallel.worker import Workforce
from evonav.tasks.dataset import read_dataset
from evonav.tasks.parameters import GenerationParameters
from evonav.tasks.subsets import SubsetError, subset_of, subset_roots

OPTIONS = GenerationOptions(
    split="test", parameters=GenerationParameters(num_stages=(1,), reference_image_px=32, reference_min_visible_px=1)
)


@pytest.fixture(scope="module")
def houses() -> list[str]:
    """Eight houses, one of them twice, one without a start, one of a single room, and one that is none."""
    small = sorted(bundled_houses(30), key=lambda house: len(house.objects))[:9]
    texts = [house.to_json() for house in small]
    broken = json.loads(texts[0])
    broken["metadata"] = {}
    single = json.loads(texts[1])
    single |= {"rooms": single["rooms"][:1], "doors": [], "windows": [], "walls": []}
    return [json.dumps(broken), *texts[1:], texts[3], json.dumps(single), "{}"]


def write(houses: list[str], path: Path) -> Path:
    path.write_text("\n".join(houses), encoding="utf-8")
    return path


def houses_in(folder: Path, name: str) -> set[str]:
    return {entry.house_sha256 for entry in subset_of(read_dataset(folder), name)}


def test_made_alone_or_taken_from_the_whole(houses: list[str], tmp_path: Path) -> None:
    whole, alone = tmp_path / "whole", tmp_path / "alone"
    generate_dataset(write(houses, tmp_path / "a.jsonl"), whole, options=OPTIONS)
    shuffled = random.Random(3).sample(houses, len(houses))
    file = write(shuffled, tmp_path / "another name.jsonl")
    made = generate_dataset(file, alone, options=OPTIONS, subset="test-5", workforce=Workforce(num_workers=2))
    assert len(made.roots) == 5
    record = read_dataset(alone)
    assert record.subset == "test-5"
    assert {entry.house_sha256 for entry in record.tasks} == houses_in(whole, "test-5")
    assert houses_in(alone, "test-3") == houses_in(whole, "test-3")
    # Everything but what follows from the file's name is the same.
    tasks = {read.house_sha256: read for read in record.tasks}
    for entry in subset_of(read_dataset(whole), "test-5"):
        twin = alone / tasks[entry.house_sha256].task_id
        for path in (whole / entry.task_id / "oracle").iterdir():
            assert path.read_bytes() == (twin / "oracle" / path.name).read_bytes()


def test_houses_that_give_no_task_are_passed_over(houses: list[str], tmp_path: Path) -> None:
    """The subset of all eight is had although the house without a start comes first in some order."""
    made = generate_dataset(write(houses, tmp_path / "a.jsonl"), tmp_path / "out", options=OPTIONS, subset="test-8")
    assert len(made.roots) == 8
    assert read_dataset(tmp_path / "out").num_rejected == {"no_start": 1}
    with pytest.raises(SubsetError, match="only 8 houses"):
        generate_dataset(tmp_path / "a.jsonl", tmp_path / "more", options=OPTIONS, subset="test-9")


def test_single_room_houses_are_counted(houses: list[str], tmp_path: Path) -> None:
    generate_dataset(write(houses, tmp_path / "a.jsonl"), tmp_path / "out", options=OPTIONS)
    reasons = read_dataset(tmp_path / "out").num_rejected
    assert reasons == {"no_start": 1, "too_few_rooms": 1, "malformed_house": 1}


def test_a_subset_of_something_else_is_refused(houses: list[str], tmp_path: Path) -> None:
    file = write(houses[1:3], tmp_path / "a.jsonl")
    with pytest.raises(SubsetError, match="of split 'test', not of 'val'"):
        generate_dataset(file, tmp_path / "out", options=OPTIONS, subset="val-1")
    with pytest.raises(InvalidArgumentError, match="limit"):
        generate_dataset(file, tmp_path / "out", options=OPTIONS, subset="test-1", limit=1)
    generate_dataset(file, tmp_path / "out", options=OPTIONS, subset="test-1")
    with pytest.raises(StoreError, match="subset"):
        generate_dataset(file, tmp_path / "out", options=OPTIONS, subset="test-2")


def test_the_commands_take_subsets(houses: list[str], tmp_path: Path) -> None:
    file, out = write(houses[1:5], tmp_path / "a.jsonl"), tmp_path / "out"
    run = CliRunner().invoke
    made = run(app, ["tasks", "generate", "--houses", str(file), "--out", str(out), "--split", "val", "--workers", "0",
                     "--num-stages", "1"])  # fmt: skip
    assert made.exit_code == 0, made.output
    chosen = [root.name for root in subset_roots(out, "val-2")]
    listed = run(app, ["tasks", "subset", str(out), "val-2"])
    assert listed.output.split() == chosen
    written = run(app, ["tasks", "subset", str(out), "val-2", "--out", str(tmp_path / "list.txt")])
    assert written.exit_code == 0
    assert (tmp_path / "list.txt").read_text(encoding="utf-8").split() == chosen
    assert isinstance(run(app, ["tasks", "subset", str(out), "test-2"]).exception, SubsetError)
    assert isinstance(run(app, ["tasks", "subset", str(tmp_path), "test-2"]).exception, TaskError)
    arguments = ["evaluate", "--tasks", str(out), "--agent", "random-walk", "--workers", "0", "--out"]
    evaluated = run(app, [*arguments, str(tmp_path / "run"), "--subset", "val-2"])
    assert evaluated.exit_code == 0, evaluated.output
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))
    assert "2" in json.dumps(summary)
    both = run(app, [*arguments, str(tmp_path / "other"), "--subset", "val-2", "--limit", "1"])
    assert both.exit_code == 2
