"""Recordings for rerun, read back with rerun's own reader."""

import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from command_line import command

from evonav.errors import InvalidArgumentError, StoreError
from evonav.evaluation.records.store import RunStore
from evonav.evaluation.run.components import load_spec
from evonav.replay.rerun_export import check_recording
from evonav.tasks.listing import BUNDLED_TASKS
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import SimulatorConfig

rerun_chunk = pytest.importorskip("rerun.chunk", reason="rerun is not installed")


@pytest.fixture(scope="module")
def recording(viewed_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rerun") / "x.rrd"
    command("video", viewed_run, "--agent", "fu", "--out", path)
    assert [item.name for item in path.parent.iterdir()] == ["x.rrd"]
    return path


def rows(recording: Path) -> dict[str, list[dict]]:
    """Rows of every entity, by its path."""
    found: dict[str, list[dict]] = {}
    for chunk in rerun_chunk.RrdReader(recording).stream():
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if name not in ("log_time", "log_tick")]
        found.setdefault(str(chunk.entity_path), []).extend(batch.select(names).to_pylist())
    return found


def test_entities_and_counts_are_the_records(recording: Path, viewed_run: Path) -> None:
    with RunStore(viewed_run) as store:
        records = list(store.records("fu"))
        maps = list(store.floor_plans(records[0].task_id))
    num_rounds = sum(len(record.trace) for record in records)
    found = rows(recording)
    for path in ("/world/agent/heading/rgb", "/world/memory/entries", "/world/memory/frontiers", "/map"):
        assert len(found[path]) == num_rounds, path
    for path in ("/world/house/objects", "/world/house/walls", "/world/target", "/world/target/success_radius"):
        assert len(found[path]) == len(records), path

    def column(row: dict, name: str) -> list:
        (key,) = [key for key in row if key.endswith(f":{name}")]
        return row[key] or []

    entries = sorted(found["/world/memory/entries"], key=lambda row: row["step"])
    assert [row["step"] for row in entries] == list(range(num_rounds))
    steps = [(record.stage, i + 1) for record in records for i in range(len(record.trace))]
    assert [(row["stage"], row["round"]) for row in entries] == steps
    assert [len(column(row, "half_sizes")) for row in entries] == [
        step.num_entries for record in records for step in record.trace
    ]
    stale = [sum(label.endswith("(stale)") for label in column(row, "labels")) for row in entries]
    last = [
        row["step"]
        for row, after in zip(entries, [*entries[1:], None], strict=True)
        if after is None or after["round"] == 1
    ]
    assert [stale[i] for i in last] == [sum(entry.is_stale for entry in record.entries) for record in records]
    assert sum(stale) > 0
    red = Counter(colour for row in entries for colour in column(row, "colors"))
    assert red[(209 << 24) + (26 << 16) + (42 << 8) + 255] == sum(stale)
    houses = sorted(found["/world/house/objects"], key=lambda row: row["step"])
    assert [len(column(row, "half_sizes")) for row in houses] == [len(floor_plan.objects) for floor_plan in maps]
    targets = sorted(found["/world/target"], key=lambda row: row["step"])
    for row, record in zip(targets, records, strict=True):
        x_m, y_m, z_m = record.target.position_m
        assert np.allclose(column(row, "positions"), [(x_m, z_m, y_m)], atol=1e-5)


def test_depth_is_what_the_camera_measured(recording: Path, viewed_run: Path) -> None:
    with RunStore(viewed_run) as store:
        (record, *_) = store.records("fu")
    house_json = load_spec(BUNDLED_TASKS / record.task_id).stages[0].house_json
    simulator = EmbeddedSimulator()
    simulator.reset(house_json)
    pose = record.trace[0].pose
    frame = simulator.render(Pose(pose.x_m, pose.y_m, pose.z_m, pose.yaw_rad, pose.horizon_rad), rgb=False)
    found = [row for row in rows(recording)["/world/agent/heading/depth"] if row["step"] == 0]
    row = {key.rpartition(":")[2]: value for row in found for key, value in row.items() if value}
    shape = row["format"][0]["height"], row["format"][0]["width"]
    depth_m = np.asarray(row["buffer"][0], np.uint8).view(np.uint16).reshape(shape) / row["meter"][0]
    assert shape == frame.depth_m.shape
    assert np.allclose(depth_m, frame.depth_m, atol=5.01e-4)


def test_cameras_stand_at_their_height_and_look_where_the_agent_looks(recording: Path, viewed_run: Path) -> None:
    with RunStore(viewed_run) as store:
        poses = [step.pose for record in store.records("fu") for step in record.trace]
    found = [row for row in rows(recording)["/world/agent/heading"] if any("mat3x3" in key and row[key] for key in row)]
    found.sort(key=lambda row: row["step"])
    assert len(found) == len(poses)
    for row, pose in zip(found, poses, strict=True):
        (matrix,) = next(row[key] for key in row if key.endswith(":mat3x3"))
        axes = np.reshape(matrix, (3, 3)).T  # stored by columns
        (place,) = next(row[key] for key in row if key.endswith(":translation"))
        assert place == pytest.approx((pose.x_m, pose.z_m, SimulatorConfig().camera_height_m), abs=1e-5)
        assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-5)
        assert np.linalg.det(axes) == pytest.approx(1.0, abs=1e-5)
        ahead = axes[:, 2]
        assert np.allclose(
            ahead[:2], np.cos(pose.horizon_rad) * np.array([np.sin(pose.yaw_rad), np.cos(pose.yaw_rad)]), atol=1e-5
        )


def test_what_cannot_be_written_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InvalidArgumentError, match=r"expected a file .rrd"):
        check_recording(tmp_path / "x.mp4")
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(StoreError, match=r"pip install 'evonav\[rerun\]'"):
        check_recording(tmp_path / "x.rrd")
