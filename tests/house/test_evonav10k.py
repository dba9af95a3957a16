"""The houses of `evonav-10k`: the same everywhere, made when first used, and checked whenever they are read."""

import gzip
import hashlib
import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest

import evonav
from evonav.cli import main
from evonav.errors import HouseError, InvalidArgumentError, StoreError
from evonav.generation import generate_task
from evonav.generation.dataset import generate_dataset, inherited_names
from evonav.generation.worker import GenerationOptions
from evonav.house import House, evonav10k, stream_houses
from evonav.house.evonav10k import SPLITS, MadeSplit, made_split, split_path
from evonav.house.files import HouseTexts
from evonav.house.generated import MakingProgress, house_maker
from evonav.house.procthor10k import Split
from evonav.parallel.worker import Workforce
from evonav.tasks.dataset import read_dataset
from evonav.tasks.parameters import GenerationParameters

FIRST_HOUSES = {
    "train": "ea309b841603965dbc1dcc79202f6094d5d357730e3f02a042ee09cb5ddd4427",
    "val": "2ce0cc9d0ca37d275eab02d957764a18eff031eb52db229a3015d3283884e779",
    "test": "7b5fe47455fa6d62644b782b8701f7ae60506a47c2227afee4b602a18ba663a0",
}
"""Checksums of the text of the first three houses. A generator that makes others needs another name for its sets."""


def text_of(split: Split, count: int) -> str:
    maker = house_maker(json.dumps({"split": split}))
    return "".join(maker.make(SPLITS[split].seed, number) + "\n" for number in range(count))


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Splits of three houses, in a cache of their own."""
    splits = {
        split: MadeSplit(made.seed, 3, hashlib.sha256(text_of(split, 3).encode()).hexdigest())
        for split, made in SPLITS.items()
    }
    monkeypatch.setattr(evonav10k, "SPLITS", splits)
    monkeypatch.setenv("EVONAV_CACHE", str(tmp_path))
    return tmp_path


@pytest.mark.parametrize("split", FIRST_HOUSES)
def test_the_first_houses_stay_the_same(split: Split) -> None:
    assert hashlib.sha256(text_of(split, 3).encode()).hexdigest() == FIRST_HOUSES[split]


def test_the_first_task_of_test_90_stays_the_same() -> None:
    """The first in the folder; its id ends in a checksum of house and seed."""
    house = House(house_maker(json.dumps({"split": "test"})).make(SPLITS["test"].seed, 16), name="evonav-10k:test:17")
    task = generate_task(house, seed=0)
    assert task.header.house.sha256.startswith("fffa2a3e22e8f48f")
    goals = [
        (task.oracle(stage).evolution.outcome, task.public(stage).category, task.oracle(stage).target.id)
        for stage in range(1, 5)
    ]
    assert goals == [
        ("first_stage", "CounterTop", "2|0"),
        ("evolved", "RemoteControl", "small|3|7"),
        ("evolved", "PepperShaker", "small|2|1"),
        ("not_triggered", "Book", "small|3|6"),
    ]


def test_the_splits_have_their_sizes_and_no_seed_in_common() -> None:
    assert {split: made.num_houses for split, made in SPLITS.items()} == {"train": 10_000, "val": 1_000, "test": 1_000}
    assert len({made.seed for made in SPLITS.values()}) == 3


@pytest.mark.skipif(sys.platform != "linux" or platform.machine() != "x86_64", reason="glibc's choice of functions")
def test_the_last_bits_of_sines_and_powers_do_not_show() -> None:
    """glibc computes them in another way on processors without FMA."""
    script = (
        "import json, math, random\n"
        "from evonav.house.generated import house_maker\n"
        "draw = random.Random(1)\n"
        "print(sum(hash((math.sin(x), math.pow(x, 0.37))) for x in (draw.random() * 100 for _ in range(200_000))))\n"
        "maker = house_maker(json.dumps({'split': 'test'}))\n"
        f"print([maker.make({SPLITS['test'].seed}, number) for number in range(12)])\n"
    )
    found = []
    for tunables in ("", "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F,-AVX"):
        environment = os.environ | {"GLIBC_TUNABLES": tunables, "PYTHONHASHSEED": "0"}
        command = [sys.executable, "-c", script]
        found.append(subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout)
    (bits, houses), (other_bits, others) = (text.split("\n", 1) for text in found)
    if bits == other_bits:
        pytest.skip("this processor, or this C library, computes the same either way")
    assert houses == others


def test_houses_are_made_when_they_are_first_used(small: Path) -> None:
    houses = evonav.load_houses("evonav-10k:test")
    assert [house.name for house in houses] == [f"evonav-10k:test:{number}" for number in (1, 2, 3)]
    assert "".join(house.to_json() + "\n" for house in houses) == text_of("test", 3)
    path = split_path("test")
    assert path.is_relative_to(small)
    made_at = path.stat().st_mtime_ns
    (third,) = stream_houses("evonav-10k:test:3")
    assert third.to_json() == houses[2].to_json()
    assert path.stat().st_mtime_ns == made_at  # read, not made again
    assert not split_path("train").exists()
    with pytest.raises(HouseError, match="fewer houses"):
        list(stream_houses("evonav-10k:test:4"))


def test_making_goes_on_after_an_interrupt_and_takes_workers(small: Path) -> None:
    def stop(state: MakingProgress) -> None:
        if state.num_houses == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        made_split("val", on_progress=stop)
    told: list[MakingProgress] = []
    made_split("val", workforce=Workforce(num_workers=2), on_progress=told.append)
    assert [(state.num_houses, state.num_new) for state in told] == [(2, 0), (3, 1)]


def test_a_changed_file_is_refused(small: Path) -> None:
    path = made_split("test")
    lines = gzip.decompress(path.read_bytes()).decode().splitlines(keepends=True)
    for damaged in (gzip.compress("".join(lines[:2]).encode()), path.read_bytes()[:-50], b"no gzip"):
        path.write_bytes(damaged)
        with pytest.raises(HouseError, match=r"test.jsonl.gz.*[Rr]emove (it|the file)?"):
            stream_houses("evonav-10k:test")
    path.write_bytes(gzip.compress("".join(lines).encode(), 1))  # packed in another way: the same houses
    assert len(list(stream_houses("evonav-10k:test"))) == 3


def test_another_generator_is_noticed(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evonav10k, "SPLITS", {"test": MadeSplit(1, 2, "0" * 64)})
    with pytest.raises(HouseError, match=r"this machine makes other houses.*endless:1"):
        HouseTexts("evonav-10k:test")


@pytest.mark.parametrize("name", ["evonav-10k", "evonav-10k:dev", "evonav-10k:test:0", "evonav-10k:test:x"])
def test_wrong_names(small: Path, name: str) -> None:
    with pytest.raises(InvalidArgumentError, match=r"expected evonav-10k:SPLIT.*train, val, test"):
        HouseTexts(name)
    assert not any(small.iterdir())


def test_tasks_inherit_set_and_split_and_a_checksum_of_the_houses(small: Path, tmp_path: Path) -> None:
    small_images = GenerationParameters(reference_image_px=64, reference_min_visible_px=4)
    dataset, split = inherited_names(HouseTexts("evonav-10k:test"))
    quick = GenerationOptions(parameters=small_images, dataset=dataset, split=split)
    generate_dataset("evonav-10k:test", tmp_path / "tasks", options=quick, limit=1)
    record = read_dataset(tmp_path / "tasks")
    assert (record.name, record.split) == ("evonav-10k", "test")
    assert [(one.name, one.sha256) for one in record.sources] == [("evonav-10k:test", evonav10k.SPLITS["test"].sha256)]


def test_two_do_not_make_the_same_houses(small: Path) -> None:
    from evonav.parallel.folders import writing

    with writing(split_path("test").parent), pytest.raises(StoreError, match="another evonav is writing"):
        made_split("test")


def test_the_command(small: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def run(*words: str) -> int:
        monkeypatch.setattr(sys, "argv", ["evonav", *words])
        with pytest.raises(SystemExit) as exit_:
            main()
        return int(exit_.value.code or 0)

    for state in ("made", "verified"):
        assert run("houses", "fetch", "evonav-10k", "--split", "val", "--workers", "0") == 0
        assert f"evonav-10k:val\t3 houses\t{state}" in capsys.readouterr().out
    assert run("houses", "list", "evonav-10k:test:2") == 0
    assert "evonav-10k:test:2" in capsys.readouterr().out
    assert run("houses", "list", "evonav-10k:train:0") != 0
    assert not split_path("train").exists()
    assert run("houses", "fetch", "evonav-10k", "--revision", "main") != 0
    assert run("houses", "fetch", "other") != 0
    assert "expected procthor-10k or evonav-10k" in " ".join(capsys.readouterr().err.split())
