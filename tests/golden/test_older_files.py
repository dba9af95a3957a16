"""A run and a pack that evonav wrote before its redesign are still read, resumed and replayed.

Both hold one bundled task as it was when its reference images were drawn in the style `outlined`:
`data/records.sqlite.gz` has the agents fu and random-walk, with errors of perception and of decisions;
`data/packed.evonav.zip` has fu and ftu.
"""

import csv
import gzip
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import evonav
from evonav.generation import GenerationParameters, generate_task
from evonav.tasks import write_task
from evonav.tasks.bundled import FORMER_IMAGES

FORMER = f"the bundled tasks with their {FORMER_IMAGES}"
DATA = Path(__file__).with_name("data")
OPTIONS = ("--limit", 1, "--noise", "wrong=0.2", "--perception", "noisy:good", "--isolation", "none")


def _evonav(*arguments: object, error: str = "") -> str:
    command = [sys.executable, "-m", "evonav", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert error in " ".join(done.stderr.split()), done.stderr
    assert bool(done.returncode) == bool(error), done.stderr
    return done.stdout


@pytest.fixture
def older_run(tmp_path: Path) -> Path:
    run = tmp_path / "run"
    run.mkdir()
    (run / "records.sqlite").write_bytes(gzip.decompress((DATA / "records.sqlite.gz").read_bytes()))
    return run


def test_commands_show_an_older_run(older_run: Path) -> None:
    assert re.search(r"success \(paper\), % +50.0 \[–\] +0.0", _evonav("report", older_run, "--text"))
    compared = " ".join(_evonav("compare", older_run, "fu", "random-walk").split())
    assert "SR: fu minus random-walk: +50.0" in compared
    assert "50.0" in _evonav("breakdown", older_run)
    assert "50.0" in _evonav("paper", older_run)
    _evonav("export", older_run, "--csv", older_run / "stages.csv")
    with (older_run / "stages.csv").open(encoding="utf-8") as file:
        assert sum(row["state"] == "success" for row in csv.DictReader(file)) == 2
    _evonav("report", older_run)
    assert (older_run / "report.html").read_text(encoding="utf-8").count("random-walk") > 10


@pytest.fixture
def former_tasks(tmp_path: Path) -> Path:
    """The task of the run, with its former reference images."""
    (house,) = evonav.load_houses("bundled:84")
    outlined = GenerationParameters(reference_style="outlined")
    write_task(generate_task(house, seed=0, config=outlined, dataset="evonav-mini", split="test"), tmp_path / "former")
    return tmp_path / "former"


def test_an_older_run_is_resumed_on_its_own_tasks_only(older_run: Path, former_tasks: Path) -> None:
    """Another agent is added to it; what is there is not run again."""
    resume = ("evaluate", "--agent", "fu,random-walk,stay-still", *OPTIONS, "--workers", 0, "--out", older_run)
    _evonav(*resume, error=f"holds a run on {FORMER}; use another folder")
    _evonav(*resume, "--tasks", former_tasks)
    summary = json.loads((older_run / "summary.json").read_bytes())
    assert {agent: row["sr"] for agent, row in summary["agents"].items()} == {
        "fu": 0.5,
        "random-walk": 0.0,
        "stay-still": 0.0,
    }


def test_an_older_run_is_not_compared_unasked(older_run: Path) -> None:
    present = older_run.with_name("present")
    _evonav("evaluate", "--agent", "stay-still", "--limit", 1, "--workers", 0, "--out", present)
    compare = ("compare", f"{present}:stay-still", f"{older_run}:fu")
    _evonav(*compare, error=FORMER)
    assert "SR, n = 4 present:stay-still run:fu" in " ".join(_evonav(*compare, "--allow-differences").split())


@pytest.mark.slow
def test_an_older_run_is_replayed(older_run: Path) -> None:
    """`evonav view` fails where a replay is not, byte for byte, what was recorded."""
    _evonav("view", older_run, "--agent", "fu", "--out", older_run / "view")
    assert list((older_run / "view").rglob("*.html"))


@pytest.mark.slow
def test_an_older_pack_is_verified() -> None:
    verdict = json.loads(_evonav("verify", DATA / "packed.evonav.zip", "--limit", 1, "--json"))
    assert verdict["is_accepted"]
    assert next(check["detail"] for check in verdict["checks"] if check["name"] == "tasks") == (
        f"1, all known; 1 with {FORMER_IMAGES}"
    )
    assert {agent: row["sr"] for agent, row in verdict["summary"]["agents"].items()} == {"ftu": 0.75, "fu": 0.5}
