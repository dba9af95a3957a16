"""`evonav evaluate --profile`: time goes to the functions that took it, and records stay the same."""

import json
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from evonav.cli import app
from evonav.errors import StoreError
from evonav.evaluation.records.store import RunStore
from evonav.parallel import profiling
from evonav.parallel.local import EndedError
from evonav.parallel.profiling import IS_SUPPORTED, SINCE_LAST_SAMPLE, VARIABLE, Samples, read_samples, rename, sampled

pytestmark = pytest.mark.skipif(not IS_SUPPORTED, reason="needs interval timers")


def spin(seconds: float) -> None:
    end_s = time.process_time() + seconds
    while time.process_time() < end_s:
        pass


def outer(seconds: float) -> None:
    spin(seconds)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    return tmp_path


def only(folder: Path) -> Samples:
    (samples,) = read_samples(folder)
    return samples


def test_time_counts_for_the_function_that_took_it(folder: Path) -> None:
    began_s = time.process_time()
    with sampled("a"):
        outer(0.2)
        rename("b")
        spin(0.1)
    took_s = time.process_time() - began_s
    samples = only(folder)
    assert samples.name == "b"
    assert 0.8 * took_s <= samples.total_s <= took_s
    own = {frame.name: seconds for frame, seconds in samples.own_s().items() if frame.file == __file__}
    assert own["spin"] == pytest.approx(0.3, abs=0.1)
    assert own.get("outer", 0.0) < 0.05
    below_outer = sum(s for stack, s in samples.cpu_s.items() if "outer" in [frame.name for frame in stack])
    assert below_outer == pytest.approx(0.2, abs=0.07)


def test_waiting_counts_for_nothing(folder: Path) -> None:
    with sampled("waiting"):
        time.sleep(0.4)
    assert only(folder).total_s < 0.1


def test_time_that_the_clock_missed_is_counted(folder: Path) -> None:
    with sampled("short"):
        spin(0.002)
    own = {frame.name: seconds for frame, seconds in only(folder).own_s().items()}
    assert 0.0015 < own[SINCE_LAST_SAMPLE] < 0.1


def test_nothing_is_sampled_unasked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    with sampled("a"):
        spin(0.05)
    assert read_samples(tmp_path) == []


@pytest.mark.parametrize(
    "text", ["", "[]", '{"name": "a"}', '{"name": "a", "functions": [], "stacks": [{"frames": [3]}]}']
)
def test_a_file_that_is_no_profile_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "1.json").write_text(text)
    with pytest.raises(StoreError, match=r"1\.json: no samples of a profile"):
        read_samples(tmp_path)


def evaluate(out: Path, *options: str) -> str:
    words = ["evaluate", "--agent", "fu", "--limit", "1", "--workers", "1", "--out", str(out), *options]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    return done.output


@pytest.mark.slow
def test_a_run_has_a_flame_graph_and_the_same_records(tmp_path: Path) -> None:
    output = evaluate(tmp_path / "a", "--profile")
    assert "CPU ms a stage by component" in " ".join(output.split())  # a narrow table breaks its title
    folder = tmp_path / "a" / "profile"
    graph = json.loads((folder / "profile.speedscope.json").read_text())
    assert [profile["name"] for profile in graph["profiles"]] == ["agent fu", "driver", "workers"]
    frames = graph["shared"]["frames"]
    for profile in graph["profiles"]:
        assert len(profile["samples"]) == len(profile["weights"]) > 0
        assert {index for stack in profile["samples"] for index in stack} <= set(range(len(frames)))
        assert profile["endValue"] == pytest.approx(sum(profile["weights"]))
    assert {"ObjectMap.update", "update"} & {frame["name"] for frame in frames}
    assert "## CPU time by function: agent fu" in (folder / "profile.md").read_text()
    evaluate(tmp_path / "b")
    assert not (tmp_path / "b" / "profile").exists()
    with RunStore(tmp_path / "a") as a, RunStore(tmp_path / "b") as b:
        assert list(a.records("fu")) == list(b.records("fu"))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--isolation", "sandbox"), "--isolation process"),
        (("--set", "engine=ray"), "engine=ray"),
    ],
)
def test_a_run_that_cannot_be_sampled_says_why(tmp_path: Path, options: tuple[str, ...], message: str) -> None:
    words = ["evaluate", "--agent", "stay-still", "--limit", "1", "--out", str(tmp_path / "run"), "--profile", *options]
    done = CliRunner().invoke(app, words, env={"COLUMNS": "200"})
    assert done.exit_code == 2
    assert message in done.output


def test_a_signal_to_end_does_not_cost_the_samples(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A driver closes a worker's connection, and ends it at once by a signal."""
    written = profiling.write_atomically
    is_first = iter([True])

    def interrupted(path: Path, text: str) -> Path:
        if next(is_first, False):
            raise EndedError(143)
        return written(path, text)

    monkeypatch.setattr(profiling, "write_atomically", interrupted)
    with pytest.raises(EndedError), sampled("a"):
        spin(0.05)
    assert only(folder).total_s > 0.0
