"""Every command of `evonav bench` measures real figures on a bundled house, and compares them with a file."""

import json
from importlib.util import find_spec

import numpy as np
import pytest
from typer.testing import CliRunner

from evonav.cli import app
from evonav.speed_benchmark import agents, mapping, navigation, rendering
from evonav.speed_benchmark.timing import Sampling
from evonav.world.camera import unproject

COMMANDS = {
    "render": ["--limit", "1", "--peer", "none"],
    "navigation": ["--limit", "1", "--peer", "none"],
    "mapping": ["--limit", "1", "--peer", "none"],
    "gym": ["--envs", "1", "--steps", "4", "--limit", "1", "--peer", "sync"],
    "agents": ["--agent", "fu", "--no-growth"],
    "generation": ["--limit", "3"],
}


def parts_add_up(rows):
    (facts,) = (row["facts"] for row in rows)
    parts = [facts[f"{part} %"] for part in ("core", "files", "rest")]
    assert sum(parts) == pytest.approx(100)
    assert all(part > 0 for part in parts)
    assert facts["tasks/s"] == pytest.approx(1e3 / rows[0]["ms"], rel=1.0)


def gymnasiums_own_environment_is_the_peer(rows):
    assert [row["peer"] for row in rows] == ["gymnasium SyncVectorEnv", None]
    assert rows[0]["ratio"] > 0
    assert rows[0]["facts"]["steps/s"] > 10


CHECKS = {"generation": parts_add_up, "gym": gymnasiums_own_environment_is_the_peer}


def bench(*words):
    return CliRunner().invoke(app, ["bench", "speed", *map(str, words)], env={"COLUMNS": "200"})


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_writes_real_figures_and_compares_them(name, tmp_path):
    run = bench(name, *COMMANDS[name], "--out", tmp_path)
    assert run.exit_code == 0, run.output
    file = tmp_path / name / "speed.json"
    speeds = json.loads(file.read_text())
    assert speeds["machine"] in " ".join(run.stdout.split())
    assert speeds["rows"]
    for row in speeds["rows"]:
        assert row["ms"] > 0
        assert row["n"] >= 3
        assert row["operation"].split()[0] in run.stdout
    CHECKS.get(name, lambda _: None)(speeds["rows"])
    for row in speeds["rows"]:
        row["ms"] /= 4
        row["ms_by_house"] = {}
    old = tmp_path / "old.json"
    old.write_text(json.dumps(speeds))
    again = bench(name, *COMMANDS[name], "--against", old)
    assert again.exit_code == 1, again.output
    assert f"worse: {speeds['rows'][0]['operation']}, ms: " in again.stdout
    assert "figures are worse than in" in again.stdout


def test_agents_know_the_house_while_they_are_timed():
    (row,) = agents.measure(Sampling(), agents=["fu"], has_growth=False)
    assert row.facts["entries, least"] >= agents.NUM_ENTRIES
    assert row.facts["p95 ms"] >= row.ms


@pytest.mark.slow
def test_growth_of_memory_is_measured_in_a_process_of_its_own():
    assert 1 < agents.growth_mb("stage-reset") < agents.MAX_GROWTH_MB


@pytest.mark.skipif(find_spec("embreex") is None, reason="needs the extra `bench`")
def test_embree_sees_the_same(monkeypatch):
    monkeypatch.setattr(rendering, "SIZES_PX", ((64, 48),))
    rows = list(rendering.measure(Sampling(limit=1, peers=["embreex"])))
    assert [row.peer for row in rows] == ["embreex", "embreex, no colours"]
    assert all(row.ratio > 0 for row in rows)


@pytest.mark.skipif(find_spec("scipy") is None, reason="needs the extra `bench`")
def test_scipy_s_field_is_a_peer_of_distances():
    *paths, distances = navigation.measure(Sampling(limit=1, peers=["scipy"]))
    assert [row.peer for row in paths] == [None, None]
    assert distances.peer == navigation.DIJKSTRA
    assert distances.ratio > 0


@pytest.mark.skipif(find_spec("octomap") is None, reason="needs the extra `bench`")
def test_octomap_s_volume_is_a_peer_of_the_occupancy():
    octree = mapping.Octree(mapping._views(1))
    octree.prepare(0)
    octree(0)
    assert octree._tree.getNumLeafNodes() > 100
    (row,) = mapping.measure(Sampling(limit=1, peers=["octomap"]))
    assert row.peer == octree.TITLE
    assert row.ratio > 0


@pytest.mark.skipif(find_spec("open3d") is None, reason="needs the extra `bench`")
def test_open3d_s_volume_has_surfaces_where_the_depth_images_have_them():
    views = mapping._views(1)[:3]
    volume = mapping.Tsdf(views)
    for number in range(3):
        volume.prepare(number)
        volume(number)
    surface_m = volume._grid.extract_point_cloud(weight_threshold=0.5).point.positions.numpy()
    for view in views:
        points_m = unproject(view.depth_m, view.pose, view.intrinsics)[view.depth_m < mapping.RANGE_M - 0.1][::50]
        apart_m = np.linalg.norm(points_m[:, None] - surface_m[None], axis=2).min(axis=1)
        assert np.mean(apart_m < 1.5 * view.grid.cell_m) > 0.95
    (row,) = mapping.measure(Sampling(limit=1, peers=["open3d"]))
    assert row.peer == volume.TITLE
    assert row.ratio > 0


def test_mistakes_are_told(tmp_path):
    assert bench("gym", "--envs", "0").exit_code == 2
    run = bench("render", "--peer", "unity")
    assert "no peer 'unity' here; there are embreex, moderngl" in str(run.exception)
    assert "cannot be read" in str(bench("render", "--against", tmp_path / "no.json").exception)


def test_an_interrupt_shows_what_was_measured(monkeypatch, tmp_path):
    def interrupted(sampling):
        yield from navigation_rows
        raise KeyboardInterrupt

    navigation_rows = list(navigation.measure(Sampling(limit=1, peers=[])))[:1]
    monkeypatch.setattr(navigation, "measure", interrupted)
    run = bench("navigation", "--out", tmp_path)
    assert run.exit_code == 130
    assert "Navigation, interrupted" in run.stdout
    assert "first path" in run.stdout
    assert "nothing is written" in run.stderr
    assert not (tmp_path / "navigation").exists()
