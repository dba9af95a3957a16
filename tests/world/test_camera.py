"""The camera model against images recorded from the real simulator."""

import itertools
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from recorded_data import data_path, needs_data

from evonav.errors import InvalidArgumentError
from evonav.world.camera import project, unproject, unproject_pixels
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics, SimulatorConfig

FRAMES = "cs-gavin-procthor10k-train10-frames"
RECORDED = data_path(FRAMES)
LEVELS_PER_M = 51.0
"""The recorded depth is `floor(51 * metres)` in 8 bits, clipped at 5 m: a level is 19.6 mm."""


def _recorded_depth_m(frame: dict[str, Any]) -> NDArray[np.float32]:
    levels = np.asarray(Image.open(RECORDED / frame["depth"]))
    levels = levels if levels.ndim == 2 else levels[..., 0]
    depth_m = (levels.astype(np.float32) + 0.5) / LEVELS_PER_M
    depth_m[(levels == 0) | (levels >= 5 * LEVELS_PER_M)] = np.inf
    return depth_m


def _pose(frame: dict[str, Any]) -> Pose:
    """Where the agent was recorded to be; height and field of view are ours, not fitted ones."""
    height_m = SimulatorConfig().camera_height_m
    return Pose(frame["agent_x"], height_m, frame["agent_z"], math.radians(frame["yaw_deg"]), math.radians(30.0))


@needs_data(FRAMES)
def test_recorded_frames_reproject_onto_each_other() -> None:
    """Median 0.8 mm over 72 pairs of consecutive frames, a quarter of them with a turn in between."""
    frames = json.loads((RECORDED / "poses.json").read_text(encoding="utf-8"))["frames"]
    intrinsics = Intrinsics(640, 640, math.radians(SimulatorConfig().vertical_fov_deg))
    errors_m = []
    for first, second in itertools.pairwise(frames):
        if Path(first["depth"]).parent != Path(second["depth"]).parent:
            continue  # another walk
        points_m = unproject(_recorded_depth_m(first), _pose(first), intrinsics)[::4, ::4].reshape(-1, 3)
        points_m = points_m[np.isfinite(points_m).all(axis=1)]
        seen = project(points_m, _pose(second), intrinsics)
        seen = seen[((seen[:, :2] >= 0) & (seen[:, :2] < 640)).all(axis=1)]
        cols, rows = np.floor(seen[:, :2]).astype(int).T
        recorded_m = _recorded_depth_m(second)[rows, cols]
        is_recorded = np.isfinite(recorded_m)
        if is_recorded.sum() > 200:  # after a turn of 180 degrees nothing is seen twice
            errors_m.append(np.abs(recorded_m - seen[:, 2])[is_recorded])
    assert len(errors_m) > 50
    assert np.median(np.concatenate(errors_m)) < 0.005
    assert np.median([np.median(pair_m) for pair_m in errors_m]) < 0.005


@pytest.mark.parametrize(("vertical_fov_deg", "height_m", "horizon_deg"), [(60.0, 1.575, 30.0), (90.0, 1.4, 30.0)])
@needs_data(FRAMES)
def test_recorded_floors_are_level_with_our_camera_only(
    vertical_fov_deg: float, height_m: float, horizon_deg: float
) -> None:
    """With AI2-THOR's defaults the lowest points of a frame are the floor; with others they are not."""
    frames = json.loads((RECORDED / "poses.json").read_text(encoding="utf-8"))["frames"][::20]
    off_m = {True: [], False: []}
    for frame in frames:
        depth_m, ours = _recorded_depth_m(frame), _pose(frame)
        other = Pose(ours.x_m, height_m, ours.z_m, ours.yaw_rad, math.radians(horizon_deg))
        for is_ours, pose, fov_deg in ((True, ours, 90.0), (False, other, vertical_fov_deg)):
            points_m = unproject(depth_m, pose, Intrinsics(640, 640, math.radians(fov_deg)))
            off_m[is_ours].append(abs(float(np.median(points_m[-100:, :, 1]))))
    assert np.median(off_m[True]) < 0.01
    assert np.median(off_m[False]) > 0.05


def test_projection_inverts_unprojection() -> None:
    pose, intrinsics = Pose(1.0, 1.575, -2.0, 0.7, 0.4), Intrinsics(30, 20, 1.2)
    depth_m = np.linspace(0.5, 9.0, 600, dtype=np.float32).reshape(20, 30)
    points_m = unproject(depth_m, pose, intrinsics)
    seen = project(points_m.reshape(-1, 3), pose, intrinsics).reshape(20, 30, 3)
    rows, cols = np.indices((20, 30)) + 0.5
    np.testing.assert_allclose(seen, np.stack([cols, rows, depth_m], axis=-1), atol=1e-9)


def test_single_pixels_are_unprojected_as_the_whole_image() -> None:
    pose, intrinsics = Pose(1.0, 1.575, -2.0, 0.7, 0.4), Intrinsics(30, 20, 1.2)
    depth_m = np.linspace(0.5, 9.0, 600, dtype=np.float32).reshape(20, 30)
    rows, cols = np.array([0, 19, 7, 7]), np.array([29, 0, 14, 3])
    few_m = unproject_pixels(rows, cols, depth_m, pose, intrinsics)
    np.testing.assert_allclose(few_m, unproject(depth_m, pose, intrinsics)[rows, cols], rtol=1e-5)


def test_points_behind_the_camera_are_nan() -> None:
    behind_m = np.array([[0.0, 1.0, -1.0]])
    assert np.isnan(project(behind_m, Pose(0.0, 1.0, 0.0, 0.0, 0.0), Intrinsics(30, 20, 1.2))).all()


def test_arrays_of_another_layout_are_refused() -> None:
    pose, intrinsics = Pose(0.0, 1.0, 0.0, 0.0, 0.0), Intrinsics(30, 20, 1.2)
    with pytest.raises(InvalidArgumentError, match="C-contiguous"):
        unproject(np.ones((30, 20), np.float32).T, pose, intrinsics)
    with pytest.raises(InvalidArgumentError, match="points_m"):
        project(np.ones((5, 2)), pose, intrinsics)
