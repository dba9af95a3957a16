"""`evonav bench memory`: measure, compare with an earlier result, export streams and score answers to them."""

import json
import shutil
from dataclasses import asdict
from pathlib import Path

import pytest
from typer.testing import CliRunner

from evonav.cli import app
from evonav.cli.bench.memory import chosen_streams
from evonav.memory_benchmark.references import ObjectMapMemory
from evonav.memory_benchmark.streams.export.read import ExportedStream

SMALL = ["--streams", "S6", "--quick", "--size", "64x48"]


def bench(*words):
    return CliRunner().invoke(app, ["bench", "memory", *map(str, words)], env={"COLUMNS": "250"})


@pytest.fixture(scope="module")
def out(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("memory")
    run = bench(*SMALL, "--memory", "never,see-through", "--workers", "0", "--in-process", "--out", folder)
    assert run.exit_code == 0, run.output
    assert "see-through" in run.stdout
    assert "false forgets %" in run.stdout
    return folder


@pytest.mark.slow
def test_a_run_writes_its_files_and_goes_on(out):
    assert {"report.html", "result.json", "summary.md", "memory.json"} <= {path.name for path in out.iterdir()}
    run = bench(*SMALL, "--memory", "never", "--workers", "0", "--in-process", "--out", out)
    assert run.exit_code == 0, run.output
    assert "see-through" in run.stdout, "memories of earlier commands stay"


def test_what_became_worse_is_listed(out, tmp_path):
    words = [*SMALL, "--memory", "never", "--workers", "0", "--in-process", "--out", out]
    same = bench(*words, "--against", out / "result.json")
    assert same.exit_code == 0, same.output
    assert "0 of" in same.stdout
    old = json.loads((out / "result.json").read_text())
    for streams in old["memories"].values():
        for stream in streams:
            stream["size"]["bytes_per_entry"] /= 2
    (tmp_path / "old.json").write_text(json.dumps(old))
    worse = bench(*words, "--against", tmp_path / "old.json")
    assert worse.exit_code == 1
    assert "worse: never: bytes_per_entry: " in worse.stdout


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["tum", "replica"])
def test_answers_to_exported_streams_score_as_the_memory_in_process_does(layout, out, tmp_path):
    streams = tmp_path / "streams"
    run = bench("export", streams, "--layout", layout, *SMALL, "--no-colours", "--oracle", tmp_path / "truth")
    assert run.exit_code == 0, run.output
    (folder,) = streams.iterdir()
    assert not (folder / "oracle.jsonl.xz").exists()
    exported, memory, visit = ExportedStream(folder), ObjectMapMemory("never"), 0
    memory.reset(exported.info)
    lines = []
    for frame, _ in exported.frames():
        if frame.visit != visit:
            visit = frame.visit
            memory.visit(frame.time_s)
        memory.observe(frame)
        lines.append({"frame": frame.index, "seconds": 0.01, "entries": [asdict(one) for one in memory.entries()]})
    (folder / "entries.jsonl").write_text("\n".join(map(json.dumps, lines)))
    scored = tmp_path / "scored"
    run = bench("score", streams, "--oracle", tmp_path / "truth", "--system", "mine", "--out", scored)
    assert run.exit_code == 0, run.output
    (mine,) = json.loads((scored / "result.json").read_text())["memories"]["mine"]
    assert mine["hosting"] == "offline"
    here = json.loads((out / "result.json").read_text())["memories"]["never"][0]
    theirs = mine["update"]
    if layout == "tum":  # Replica's depth images are coarser
        for name in ("removals", "seen", "standing"):
            assert theirs[name] == pytest.approx(here["update"][name], rel=0.1, abs=2), name
    assert mine["num_frames"] == here["num_frames"]
    alone = bench("score", folder, folder / "entries.jsonl", "--oracle", tmp_path / "truth", "--out", tmp_path / "one")
    assert alone.exit_code == 0, alone.output


def test_options_choose_streams():
    def chosen(kinds=None, seeds=None, size="300x300", perception=None, *, is_quick=False):
        return chosen_streams(kinds, "bundled", seeds, size, perception, is_quick=is_quick)

    assert len({spec.name for spec in chosen(["S0,S3"])}) == 30
    assert [spec.kind for spec in chosen(["s1"], is_quick=True)] == ["S1"]
    seeds = {spec.seed for spec in chosen(["S1"], ["4,7"], is_quick=True)}
    assert seeds == {4, 7}
    (wide,) = chosen(["S2"], size="640x480", perception="noisy:poor", is_quick=True)
    assert (wide.width_px, wide.height_px, wide.perception) == (640, 480, "noisy:poor")
    assert len({spec.perception for spec in chosen(["S8"], perception="gt", is_quick=True)}) == 3


def test_mistakes_are_told(tmp_path):
    assert "--streams S12: expected some of S0, S1" in " ".join(bench("--streams", "S12").stderr.split())
    assert "--size 64: expected width and height" in " ".join(bench("--size", "64").stderr.split())
    assert bench("export", tmp_path, "--layout", "ros").exit_code == 2
    assert "holds no stream" in str(bench("score", tmp_path).exception)
    assert "no memory 'nevr'" in str(bench("--memory", "nevr").exception)


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    streams = tmp_path_factory.mktemp("recordings") / "streams"
    run = bench("export", streams, *SMALL, "--no-colours", "--oracle", streams.with_name("truth"))
    assert run.exit_code == 0, run.output
    (folder,) = streams.iterdir()
    return folder


@pytest.mark.slow
def test_recordings_give_speed_and_size_only(recording, tmp_path):
    bare = tmp_path / "bare"
    shutil.copytree(recording, bare)
    (bare / "frames.jsonl").unlink()
    words = [
        "--recording",
        recording,
        "--recording",
        bare,
        "--memory",
        "never",
        "--workers",
        0,
        "--out",
        tmp_path / "o",
    ]
    run = bench(*words)
    assert run.exit_code == 0, run.output
    assert f"{bare}: " in run.stdout
    assert "no detections, no truth: only speed and size" in run.stdout
    seeing, blind = json.loads((tmp_path / "o" / "result.json").read_text())["memories"]["never"]
    for one in (seeing, blind):
        assert one["kind"] == "recording"
        assert one["failure"] is None
        assert (one["update"], one["belief"], one["queries"], one["spells"]) == (None, None, None, [])
        assert one["speed"]["observe_wall"]["n"] == one["num_frames"] - 20
    assert seeing["size"]["num_entries"] > 10 > blind["size"]["num_entries"] == 0
    assert seeing["speed"]["locate_wall"] is not None
    assert seeing["notes"] == []
    assert "no frame has a detection" in blind["notes"][0]
    table = (tmp_path / "o" / "summary.md").read_text()
    assert "p95 ms" in table
    assert "false forgets" not in table.split("p95:")[0]
    assert bench(*words).exit_code == 0, "the records are found again"


def test_bad_recordings_are_one_error(recording, tmp_path):
    words = ["--memory", "never,numpy-list", "--workers", 0, "--out", tmp_path / "o"]
    assert "cam_params.json: cannot be read" in str(bench("--recording", tmp_path, *words).exception)
    assert "--up x: expected z, y, -y" in " ".join(bench("--recording", recording, "--up", "x", *words).stderr.split())
    damaged = tmp_path / "damaged"
    shutil.copytree(recording, damaged)
    (damaged / "depth" / "000007.png").write_text("no image")
    run = bench("--recording", damaged, *words)
    assert run.exit_code == 3
    assert run.stderr.count("000007.png: cannot be read as an image") == 1
    (damaged / "depth" / "000007.png").unlink()
    assert "000007.png: is missing" in str(bench("--recording", damaged, *words).exception)
