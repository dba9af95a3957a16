"""Streams as files: layouts, handedness, what is public, and recordings of one's own."""

import json
import math
import shutil

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from stream_digest import digest

from evonav.errors import InvalidArgumentError, StoreError
from evonav.memory_benchmark.streams import make_stream
from evonav.memory_benchmark.streams.export.conversion import (
    EVONAV_FROM_WORLD,
    pose_of,
    quaternion_of,
    rotation_of,
    world_from_camera,
)
from evonav.memory_benchmark.streams.export.read import ExportedStream
from evonav.memory_benchmark.streams.export.recording import Recording
from evonav.memory_benchmark.streams.export.write import export_stream
from evonav.memory_benchmark.streams.spec import StreamSpec
from evonav.world.camera import unproject
from evonav.world.pose import Pose

SPEC = StreamSpec("S3", "bundled:4", frames_a_visit=6, perception="noisy:good")
ANGLES = st.floats(-3.1, 3.1)


@pytest.fixture(scope="module")
def stream(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("EVONAV_CACHE", str(tmp_path_factory.mktemp("cache")))
        return make_stream(SPEC, rgb=True)


@pytest.fixture(scope="module")
def folders(stream, tmp_path_factory):
    root = tmp_path_factory.mktemp("exported")
    for layout in ("tum", "replica"):
        export_stream(stream, root / layout, layout)
    return root


@given(yaw_rad=ANGLES, horizon_rad=st.floats(-1.5, 1.5), x=st.floats(-9, 9), z=st.floats(-9, 9))
def test_a_pose_comes_back_from_its_matrix(yaw_rad, horizon_rad, x, z):
    pose = Pose(x, 1.575, z, yaw_rad, horizon_rad)
    matrix = world_from_camera(pose)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1.0), "a rotation, not a reflection"
    back, roll_rad = pose_of(matrix)
    assert roll_rad == pytest.approx(0.0, abs=1e-6)
    assert back.position_m == pytest.approx(pose.position_m)
    assert math.remainder(back.yaw_rad - yaw_rad, math.tau) == pytest.approx(0.0, abs=1e-6)
    assert back.horizon_rad == pytest.approx(horizon_rad, abs=1e-6)


@given(quaternion=st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_a_quaternion_is_its_rotation(quaternion):
    rotation = rotation_of(quaternion)
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-9)
    unit = np.array(quaternion) / np.linalg.norm(quaternion)
    assert abs(np.dot(quaternion_of(rotation), unit)) == pytest.approx(1.0)


def test_known_rotations():
    assert rotation_of((0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))) @ [1.0, 0.0, 0.0] == pytest.approx([0, 1, 0])
    ahead = world_from_camera(Pose(1.0, 2.0, 3.0, 0.0, 0.0))
    assert ahead[:3, 3].tolist() == [1.0, 3.0, 2.0]
    assert ahead[:3, 2] == pytest.approx([0.0, 1.0, 0.0]), "evonav's +z is the file's +y"
    assert ahead[:3, 1] == pytest.approx([0.0, 0.0, -1.0]), "the image's lower side is down"
    assert ahead[:3, 0] == pytest.approx([1.0, 0.0, 0.0])


@pytest.mark.parametrize("layout", ["tum", "replica"])
def test_a_depth_pixel_of_the_files_is_the_world_point_of_the_frame(layout, stream, folders):
    folder = folders / layout
    camera = json.loads((folder / "cam_params.json").read_text())["camera"]
    matrices = trajectory(folder, layout)
    frames = [frame for frame, _ in stream.frames()]
    assert len(matrices) == len(frames)
    names = {"tum": "depth/{:06d}.png", "replica": "results/depth{:06d}.png"}
    for frame, matrix in zip(frames, matrices, strict=True):
        pixels = np.asarray(Image.open(folder / names[layout].format(frame.index))).astype(float)
        depth_m = pixels / camera["scale"]
        rows, cols = np.nonzero(depth_m)
        across = (cols - camera["cx"]) / camera["fx"] * depth_m[rows, cols]
        down = (rows - camera["cy"]) / camera["fy"] * depth_m[rows, cols]
        points = np.stack([across, down, depth_m[rows, cols], np.ones(len(rows))])
        in_file = (matrix @ points)[:3]
        in_evonav = unproject(frame.view.depth_m, frame.view.pose, frame.view.intrinsics)[rows, cols]
        assert np.abs(in_file[[0, 2, 1]].T - in_evonav).max() < 2e-3


def trajectory(folder, layout):
    if layout == "replica":
        return np.loadtxt(folder / "traj.txt").reshape(-1, 4, 4)
    found = []
    for row in np.loadtxt(folder / "groundtruth.txt"):
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rotation_of(row[4:]), row[1:4]
        found.append(matrix)
    return np.array(found)


@pytest.mark.parametrize("layout", ["tum", "replica"])
def test_an_exported_stream_is_read_again(layout, stream, folders):
    read = ExportedStream(folders / layout)
    assert (read.name, read.kind, read.house, read.info) == (stream.name, stream.kind, stream.house, stream.info)
    assert read.has_truth
    assert tuple(read.changes) == tuple(stream.changes)
    assert read.file.digest == digest(stream)
    for (one, truth), (other, other_truth) in zip(read.frames(), stream.frames(), strict=True):
        assert (one.index, one.time_s, one.visit, one.view.pose) == (
            other.index,
            other.time_s,
            other.visit,
            other.view.pose,
        )
        assert truth == other_truth
        found, expected = one.view.detections, other.view.detections
        assert found.labels == expected.labels
        for name in ("masks", "confidences", "features"):
            assert np.array_equal(getattr(found, name), getattr(expected, name))
        is_near = other.view.depth_m < 65535 / read.file.depth_scale - 1e-3
        assert np.abs(one.view.depth_m[is_near] - other.view.depth_m[is_near]).max() < 1.1e-4
        assert np.isinf(one.view.depth_m[~is_near]).all()
        if layout == "tum":
            assert np.array_equal(one.view.rgb, other.view.rgb)


def test_the_truth_can_be_kept_from_others(stream, tmp_path):
    export_stream(stream, tmp_path / "public", oracle=tmp_path / "mine" / "truth.xz")
    ids = {body.id for _, truth in stream.frames() for body in truth.objects}
    text = "".join(path.read_text() for path in (tmp_path / "public").glob("*.*"))
    assert not [one for one in ids if one in text]
    blind = ExportedStream(tmp_path / "public")
    assert not blind.has_truth
    assert blind.changes == ()
    frame, truth = next(blind.frames())
    assert (truth.objects, truth.visible_px, truth.empty_px) == ((), {}, {})
    assert set(truth.detected_ids) <= {None}
    assert frame.view.depth_m.shape == (300, 300)
    seeing = ExportedStream(tmp_path / "public", oracle=tmp_path / "mine" / "truth.xz")
    assert tuple(seeing.changes) == tuple(stream.changes)


def test_a_recording_is_the_stream_without_its_truth(folders):
    recorded, exported = Recording(folders / "tum"), ExportedStream(folders / "tum")
    assert recorded.info.rate_hz == 2.0
    assert recorded.info.intrinsics.focal_px == pytest.approx(150.0)
    assert set(recorded.info.labels) <= set(exported.info.labels)
    for (one, truth), (other, _) in zip(recorded.frames(), exported.frames(), strict=True):
        assert (one.index, one.time_s, one.visit) == (other.index, other.time_s, other.visit)
        assert one.view.pose.position_m == pytest.approx(other.view.pose.position_m, abs=1e-6)
        assert one.view.pose.horizon_rad == pytest.approx(other.view.pose.horizon_rad, abs=1e-6)
        assert np.array_equal(one.view.depth_m, other.view.depth_m)
        assert np.array_equal(one.view.detections.masks, other.view.detections.masks)
        assert np.array_equal(one.view.rgb, other.view.rgb)
        assert one.view.detections.labels == other.view.detections.labels
        assert not truth.objects


@pytest.mark.parametrize("read", ["rendered", "exported", "recorded"])
def test_no_memory_can_write_into_a_frame(read, stream, folders):
    of = {"rendered": lambda: stream, "exported": lambda: ExportedStream(folders / "tum")}
    frame, _ = next(of.get(read, lambda: Recording(folders / "tum"))().frames())
    found = frame.view.detections
    for array in (frame.view.depth_m, frame.view.rgb, found.masks, found.confidences, found.features):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


def rewritten(source, folder, *, roll_rad=0.0, up="z", shift_px=0.0):
    """Write a recording of the same places with a rolled camera, in another world, with an off-centre camera."""
    shutil.copytree(source, folder)
    for name in ("frames.jsonl", "rgb.txt"):
        (folder / name).unlink()
    rows = []
    for line in (source / "groundtruth.txt").read_text().splitlines()[2:]:
        time, *values = line.split()
        numbers = [float(value) for value in values]
        change = EVONAV_FROM_WORLD[up] @ EVONAV_FROM_WORLD["z"]
        cos, sin = math.cos(roll_rad), math.sin(roll_rad)
        rotation = change @ rotation_of(numbers[3:]) @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        rows.append(" ".join(map(str, (time, *(change @ numbers[:3]), *quaternion_of(rotation)))))
    (folder / "groundtruth.txt").write_text("\n".join(rows))
    camera = json.loads((source / "cam_params.json").read_text())
    camera["camera"]["cx"] += shift_px
    (folder / "cam_params.json").write_text(json.dumps(camera))
    return folder


def test_a_recording_without_detections_has_depth_and_poses(folders, tmp_path):
    recorded = Recording(rewritten(folders / "tum", tmp_path / "bare"))
    frame, truth = next(recorded.frames())
    assert frame.view.rgb is None
    assert frame.view.detections.labels == ()
    assert truth.detected_ids == ()
    assert (recorded.info.labels, recorded.house, recorded.has_truth) == ((), "bare", False)
    assert recorded.name.startswith("recording/bare/")


@pytest.mark.parametrize("up", ["z", "y", "-y"])
def test_the_upward_axis_of_a_recording_can_be_named(up, folders, tmp_path):
    turned = Recording(rewritten(folders / "tum", tmp_path / "turned", up=up), up=up)
    for (one, _), (other, _) in zip(turned.frames(), Recording(folders / "tum").frames(), strict=True):
        assert one.view.pose.position_m == pytest.approx(other.view.pose.position_m, abs=1e-6)
        assert one.view.pose.yaw_rad == pytest.approx(other.view.pose.yaw_rad, abs=1e-6)
        assert np.array_equal(one.view.depth_m, other.view.depth_m)


@pytest.mark.parametrize(("roll_rad", "shift_px"), [(0.4, 0.0), (-0.4, 0.0), (0.0, 20.0)])
def test_cameras_are_made_level_and_central(roll_rad, shift_px, folders, tmp_path):
    """The image is the same, so a level camera sees the points where the rolled or shifted one saw them."""
    source = rewritten(folders / "tum", tmp_path / "rolled", roll_rad=roll_rad, shift_px=shift_px)
    camera = json.loads((source / "cam_params.json").read_text())["camera"]
    frame, _ = next(Recording(source).frames())
    matrix = trajectory(source, "tum")[0]
    pixels = np.asarray(Image.open(source / "depth/000000.png")) / camera["scale"]
    rows, cols = np.nonzero(pixels)
    depth_m = pixels[rows, cols]
    points = np.stack(
        [(cols - camera["cx"]) / camera["fx"] * depth_m, (rows - camera["cy"]) / camera["fy"] * depth_m, depth_m]
    )
    before = (matrix[:3, :3] @ points).T[:, [0, 2, 1]] + matrix[:3, 3][[0, 2, 1]]
    after = unproject(frame.view.depth_m, frame.view.pose, frame.view.intrinsics)
    after = after[np.isfinite(frame.view.depth_m)]
    assert len(after) > 0.7 * len(before)
    some = after[:: len(after) // 50]
    gaps_m = np.sqrt(((some[:, None, :] - before[None, :, :]) ** 2).sum(axis=2)).min(axis=1)
    assert np.median(gaps_m) < 0.01
    assert gaps_m.max() < 0.1


def test_the_cameras_centre_is_counted_from_the_first_pixels_centre(folders):
    camera = json.loads((folders / "replica" / "cam_params.json").read_text())["camera"]
    assert (camera["cx"], camera["cy"], camera["w"], camera["h"]) == (149.5, 149.5, 300, 300)
    assert camera["fx"] == camera["fy"] == pytest.approx(150.0)


def test_a_folder_with_files_is_not_overwritten(stream, folders):
    with pytest.raises(StoreError, match="not empty"):
        export_stream(stream, folders / "tum")
    with pytest.raises(InvalidArgumentError, match="layout = 'kitti'"):
        export_stream(stream, folders / "other", "kitti")


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("stream.json", "{}", r"stream.json: .*name"),
        ("frames.jsonl", "{}", r"frames.jsonl: .*depth"),
        ("frames.jsonl", "", r"frames.jsonl: 0 lines, expected 24"),
        ("oracle.jsonl.xz", "text", r"oracle.jsonl.xz: cannot be read"),
        ("depth/000000.png", "text", r"000000.png: cannot be read as an image"),
        ("masks/000000.png", "text", r"000000.png: cannot be read as an image"),
    ],
)
def test_a_damaged_export_names_the_file(name, text, message, folders, tmp_path):
    shutil.copytree(folders / "tum", tmp_path / "damaged")
    (tmp_path / "damaged" / name).write_text(text)
    with pytest.raises(StoreError, match=message):
        list(ExportedStream(tmp_path / "damaged").frames())


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("cam_params.json", "{}", r"cam_params.json: cannot be read, expected"),
        ("groundtruth.txt", "1.0 2.0", r"groundtruth.txt:1: `1.0 2.0`: expected a time and 7"),
        ("groundtruth.txt", "0.0 0 0 0 0 0 0 0", r"a quaternion that is not 0"),
        ("groundtruth.txt", "0.0 0 0 0 0 0 0 x", r"groundtruth.txt: could not convert"),
        ("groundtruth.txt", "99.0 0 0 0 0 0 0 1", r"no depth image has a pose within 0.02 s"),
        ("depth.txt", "nan depth/000000.png", r"depth.txt:1"),
    ],
)
def test_a_malformed_recording_names_the_file(name, text, message, folders, tmp_path):
    shutil.copytree(folders / "tum", tmp_path / "damaged")
    (tmp_path / "damaged" / name).write_text(text)
    with pytest.raises(StoreError, match=message):
        Recording(tmp_path / "damaged")
