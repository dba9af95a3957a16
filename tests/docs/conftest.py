"""A place in which the blocks of the documentation run."""

import gzip
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import short_stages
from build_docs import ROOT

from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.run.evaluate import evaluate
from evonav.house import bundled_houses
from evonav.tasks.listing import BUNDLED_TASKS, task_files


@pytest.fixture(scope="module", autouse=True)
def few_rounds() -> Iterator[None]:
    """Stages end after a few rounds here."""
    paper = ProtocolConfig.__init__.__defaults__
    ProtocolConfig.__init__.__defaults__ = short_stages.defaults_of_the_protocol()
    yield
    ProtocolConfig.__init__.__defaults__ = paper


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory, few_rounds: None) -> Path:
    """A folder with what commands of the documentation take: houses, tasks, a run."""
    folder = tmp_path_factory.mktemp("docs")
    houses = [house.to_json() for house in sorted(bundled_houses(), key=lambda house: len(house.rooms))[:2]]
    for name in ("houses.jsonl.gz", "uniform-hard-val-75.jsonl.gz"):
        (folder / name).write_bytes(gzip.compress("\n".join(houses).encode()))
    tasks = folder / "tasks"
    task = min(task_files(BUNDLED_TASKS), key=lambda task: task.num_stages)
    shutil.copytree(task.path, tasks / task.task_id)
    evaluate(["fu", "ftu"], task_files(tasks), folder / "out" / "run", num_workers=0)
    return folder


@pytest.fixture
def place(template: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the template to work in."""
    shutil.copytree(template, tmp_path / "here")
    here = tmp_path / "here"
    for name in ("demo", "first", "six", "paper"):
        shutil.copytree(template / "out" / "run", here / "out" / name)
    shutil.copytree(here / "tasks", here / "tasks" / "test")
    for name in ("FOLDER",):
        (here / name).symlink_to("tasks")
    (here / "RUN").symlink_to("out/run")
    for name in ("examples", "scripts"):
        (here / name).symlink_to(ROOT / name)
    monkeypatch.chdir(here)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.delitem(sys.modules, "my_agent", raising=False)  # the agent of another page
    return here
