"""Agents run in a sandbox by default, read folders of models in it, and a refusal says what helps."""

import os
import tempfile
from dataclasses import replace

import pytest
from toy_run import NEEDS_SANDBOX, TOY

from evonav.component import Component
from evonav.errors import InvalidArgumentError
from evonav.evaluation.hosting import isolation
from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.hosting.process import check_importable
from evonav.evaluation.records.schema import EndState
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run_settings import RunSettings
from evonav.evaluation.run.settings import DecisionSettings
from evonav.parallel.folders import writing

READING = """
import os
from pathlib import Path
from evonav.agents.baselines import RandomWalk

class Reading(RandomWalk):
    def begin_task(self, task):
        super().begin_task(task)
        home = Path(os.environ["HF_HOME"])
        assert (home / "hub" / "weights").read_text() == "1 2 3"
        assert os.environ["HF_HUB_OFFLINE"] == "1"

class Stealing(RandomWalk):
    def begin_task(self, task):
        super().begin_task(task)
        print((Path(os.environ["HF_HOME"]) / "token").read_text())
"""


@pytest.fixture
def has_sandbox(monkeypatch):
    monkeypatch.setattr(isolation, "sandbox_problem", lambda: None)
    monkeypatch.setattr(isolation, "_GPU_DEVICES", ())


def config_of(backend=TOY, **settings):
    return RunSettings(**settings).config(0, backend, **DecisionSettings().time_limits)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"workers": 2}, "sandbox"),
        ({"workers": 2, "isolation": "process"}, "process"),
        ({"workers": 2, "isolation": "none"}, "none"),
        ({"workers": 0}, "process"),
        ({"workers": 2, "engine": "ray"}, "process"),
    ],
)
def test_a_sandbox_is_the_default_for_local_workers(has_sandbox, settings, expected):
    assert config_of(**settings).hosting.isolation == expected


def test_a_model_that_needs_files_has_no_sandbox(has_sandbox):
    own = replace(TOY, decision=Component("evonav.decision.backends:custom", {"path": "x.py"}))
    assert config_of(own, workers=1).hosting.isolation == "process"


@pytest.mark.parametrize(("reason", "devices"), [("no Landlock", ()), (None, ("/dev/null",))])
def test_without_one_or_beside_a_gpu_a_process_is_the_default(monkeypatch, reason, devices):
    monkeypatch.setattr(isolation, "sandbox_problem", lambda: reason)
    monkeypatch.setattr(isolation, "_GPU_DEVICES", devices)
    assert config_of(workers=1).hosting.isolation == "process"


@NEEDS_SANDBOX
def test_downloaded_models_can_be_read_and_their_keys_cannot(tasks, tmp_path, monkeypatch):
    (tmp_path / "cache" / "hub").mkdir(parents=True)
    (tmp_path / "cache" / "hub" / "weights").write_text("1 2 3")
    (tmp_path / "cache" / "token").write_text("hf_secret")
    monkeypatch.setenv("HF_HOME", str(tmp_path / "cache"))
    (tmp_path / "agents").mkdir()
    (tmp_path / "agents" / "mine.py").write_text(READING)
    names = [f"{tmp_path}/agents/mine.py:{kind}" for kind in ("Reading", "Stealing")]
    config = config_of(workers=1, isolation="sandbox")
    evaluate(names, tasks[:1], tmp_path / "run", config=config, num_workers=1)
    with RunStore(tmp_path / "run") as store:
        (first, *_), (refused, *_) = (list(store.records(name)) for name in names)
    assert first.is_scored
    assert refused.state is EndState.ERRORED
    assert "PermissionError" in refused.error.message
    assert "`--isolation process` runs it without a sandbox" in refused.error.message


def test_folders_of_killed_runs_are_deleted_and_no_others(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    left, young, running, foreign = (tmp_path / f"{isolation.SCRATCH_PREFIX}{name}" for name in ("a", "b", "c", "d"))
    outside = tmp_path / "outside"
    for folder in (left, young, running, outside):
        (folder / "large").mkdir(parents=True)
        with writing(folder):
            pass
    foreign.symlink_to(outside)
    for folder in (left, running, outside):
        os.utime(folder, (0, 0))
    with writing(running), isolation.agents_scratch() as name:
        assert not left.exists()
        assert young.exists()
        assert running.exists()
        assert (outside / "large").exists()
        with isolation.agents_scratch():
            assert os.path.isdir(name)  # noqa: PTH112 - a text
    assert not os.path.exists(name)  # noqa: PTH110


@NEEDS_SANDBOX
def test_a_module_that_reads_elsewhere_is_told_what_a_sandbox_allows(tmp_path):
    (tmp_path / "secret").write_text("")
    (tmp_path / "agents").mkdir()
    (tmp_path / "agents" / "mine.py").write_text(f"open({str(tmp_path / 'secret')!r})\n")
    with pytest.raises(InvalidArgumentError, match=r"PermissionError.*EVONAV_MODELS.*--isolation process"):
        check_importable(f"{tmp_path}/agents/mine.py:Mine", AgentHosting("sandbox"))
