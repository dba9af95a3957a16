"""Houses from seeds: into files and as they are read, whatever the number of workers, and what users do wrong."""

import gzip
import json
import sys
from itertools import islice
from pathlib import Path

import pytest

import evonav
from evonav.cli import main
from evonav.errors import InvalidArgumentError, SimulationError, StoreError
from evonav.generation.dataset import generate_dataset
from evonav.generation.house_check import check_house, odd_bodies
from evonav.generation.validation import validate_folder
from evonav.generation.worker import GenerationOptions
from evonav.house import House, stream_houses
from evonav.house.generated import MakingProgress, house_maker, make_houses, read_house_parameters
from evonav.parallel.worker import Workforce
from evonav.tasks.parameters import GenerationParameters


def lines_of(file: Path) -> list[str]:
    return gzip.decompress(file.read_bytes()).decode().splitlines()


def interrupted_at(count: int):
    def stop(state: MakingProgress) -> None:
        if state.num_houses == count:
            raise KeyboardInterrupt

    return stop


def test_the_file_is_the_same_for_any_number_of_workers_and_after_interrupts(tmp_path: Path) -> None:
    plain, parallel, resumed = (tmp_path / f"{name}.jsonl.gz" for name in ("plain", "parallel", "resumed"))
    make_houses(plain, 9, seed=3)
    make_houses(parallel, 9, seed=3, workforce=Workforce(num_workers=2))
    for count in (2, 5):
        with pytest.raises(KeyboardInterrupt):
            make_houses(resumed, 9, seed=3, on_progress=interrupted_at(count))
        assert not resumed.exists()
    unfinished = tmp_path / "resumed.jsonl.gz.partial"
    unfinished.write_bytes(unfinished.read_bytes()[:-100])  # killed in the middle of a house
    assert make_houses(resumed, 9, seed=3).num_new == 5
    assert plain.read_bytes() == parallel.read_bytes() == resumed.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "parallel.jsonl.gz",
        "plain.jsonl.gz",
        "resumed.jsonl.gz",
    ]
    text = tmp_path / "text.jsonl"
    with pytest.raises(KeyboardInterrupt):
        make_houses(text, 4, seed=3, first=5, on_progress=interrupted_at(1))
    make_houses(text, 4, seed=3, first=5)
    assert text.read_text().splitlines() == lines_of(plain)[5:]


@pytest.mark.slow
def test_ray_makes_the_same_file(tmp_path: Path) -> None:
    pytest.importorskip("ray")
    plain, parallel = tmp_path / "plain.jsonl.gz", tmp_path / "ray.jsonl.gz"
    make_houses(plain, 9, seed=3)
    make_houses(parallel, 9, seed=3, workforce=Workforce(2, "ray"))
    assert parallel.read_bytes() == plain.read_bytes()


def test_endless_houses_are_those_of_the_file(tmp_path: Path) -> None:
    make_houses(tmp_path / "houses.jsonl.gz", 3, seed=12)
    endless = list(islice(stream_houses("endless:12"), 3))
    assert [house.to_json() for house in endless] == lines_of(tmp_path / "houses.jsonl.gz")
    assert [house.name for house in endless] == ["endless:12:1", "endless:12:2", "endless:12:3"]
    (third,) = evonav.load_houses("endless:12:3")
    assert third.to_json() == endless[2].to_json()
    assert len(evonav.load_houses("endless:12", limit=2)) == 2


@pytest.mark.parametrize("name", ["endless:", "endless:x", "endless:3:0", "endless:-1", f"endless:{2**64}"])
def test_wrong_names_of_endless_houses(name: str) -> None:
    with pytest.raises(InvalidArgumentError, match="endless"):
        next(stream_houses(name))


def test_endless_houses_need_a_limit_where_all_are_wanted(tmp_path: Path) -> None:
    for call in (
        lambda: evonav.load_houses("endless:1"),
        lambda: generate_dataset("endless:1", tmp_path / "tasks"),
    ):
        with pytest.raises(InvalidArgumentError, match=r"endless:1: there is no last house.*--limit"):
            call()


def test_houses_pass_the_checks_and_give_valid_tasks(tmp_path: Path) -> None:
    for house in islice(stream_houses("endless:4"), 25):
        found = check_house(house.name, house.to_json())
        assert found.is_fine, found.findings
        assert {finding.message for finding in found.findings} <= {"is one room; tasks need at least two"}
        assert sum(odd_bodies(house).values()) <= sum(item.category == "Faucet" for item in house.objects)
    small = GenerationParameters(reference_image_px=64, reference_min_visible_px=4)
    made = generate_dataset(
        "endless:4", tmp_path / "tasks", options=GenerationOptions(parameters=small, dataset="evonav"), limit=6
    )
    assert len(made.roots) == 6
    assert list(validate_folder(tmp_path / "tasks").problems) == []


def test_parameters_from_a_file(tmp_path: Path) -> None:
    config = tmp_path / "flat.toml"
    config.write_text(
        """
        split = "test"
        [structure]
        height_m = [3.0, 3.0]
        [[room_specs]]
        id = "studio"
        weight = 1
        cells = [[3, 3], [4, 4]]
        rooms = [{ratio = 3, type = "LivingRoom"}, {ratio = 1, type = "Bathroom", is_private = true}]
        """
    )
    house = House(house_maker(read_house_parameters(config)).make(0, 0))
    assert sorted(room.room_type for room in house.rooms) == ["Bathroom", "LivingRoom"]
    document = json.loads(house.to_json())
    assert document["metadata"]["roomSpecId"] == "studio"
    assert {corner["y"] for wall in document["walls"] for corner in wall["polygon"]} == {0.0, 3.0}
    config.write_text("[structure]\nheight_m = [3.0, 1.0]\n")
    with pytest.raises(InvalidArgumentError, match=r"flat.toml: argument `structure.height_m` is \[3, 1\]"):
        read_house_parameters(config)


def test_what_goes_wrong_is_named(tmp_path: Path) -> None:
    out = tmp_path / "houses.jsonl"
    with pytest.raises(InvalidArgumentError, match=r"houses.json: expected a file with one of .jsonl"):
        make_houses(tmp_path / "houses.json", 3)
    with pytest.raises(KeyboardInterrupt):
        make_houses(out, 3, on_progress=interrupted_at(1))
    with pytest.raises(StoreError, match="begun with other arguments"):
        make_houses(out, 3, seed=1)
    make_houses(out, 3)
    with pytest.raises(StoreError, match="exists already"):
        make_houses(out, 3)
    crowded = [
        {"id": "crowded", "weight": 1, "cells": [[2, 2], [2, 2]], "rooms": [{"ratio": 1, "type": "Kitchen"}] * 8}
    ]
    parameters = json.dumps({"room_specs": crowded, "max_structures": 2})
    for num_workers in (0, 1):
        with pytest.raises(SimulationError, match='room spec "crowded"'):
            make_houses(tmp_path / "no.jsonl", 2, parameters=parameters, workforce=Workforce(num_workers=num_workers))


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def run(*words: str) -> int:
        monkeypatch.setattr(sys, "argv", ["evonav", *words])
        with pytest.raises(SystemExit) as exit_:
            main()
        return int(exit_.value.code or 0)

    out = tmp_path / "houses.jsonl.gz"
    assert run("houses", "make", "--count", "2", "--seed", "7", "--workers", "0", "--out", str(out)) == 0
    assert "2 houses in" in capsys.readouterr().out
    assert run("houses", "check", str(out), "endless:7:1") == 0
    assert capsys.readouterr().out.endswith("0 of 3 houses wrong\n")
    assert run("houses", "list", "endless:7") != 0
    assert "--limit" in capsys.readouterr().err
    assert run("houses", "list", "endless:7", "--limit", "2") == 0
