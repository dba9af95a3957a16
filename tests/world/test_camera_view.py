"""Cameras of one's own: the agent's camera reproduced to the byte, maps from above, clip planes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from evonav.errors import InvalidArgumentError
from evonav.house import bundled_houses
from evonav.world.camera import CameraView
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import SimulatorConfig

HOUSE_JSON = next(bundled_houses(1)).to_json()


@pytest.fixture
def simulator() -> EmbeddedSimulator:
    simulator = EmbeddedSimulator(SimulatorConfig(width_px=80, height_px=60))
    simulator.reset(HOUSE_JSON)
    return simulator


def test_a_view_from_the_agents_camera_is_the_agents_image(simulator: EmbeddedSimulator) -> None:
    frame = simulator.render()
    view = CameraView(frame.pose, 80, 60, math.radians(simulator.config.vertical_fov_deg))
    images = simulator.render_camera(view)
    np.testing.assert_array_equal(images.depth_m, frame.depth_m)
    assert images.rgb is not None
    assert frame.rgb is not None
    np.testing.assert_array_equal(images.rgb, frame.rgb)
    np.testing.assert_array_equal(images.instances, frame.instances)
    bare = simulator.render_camera(view, rgb=False, instances=False)
    assert bare.rgb is None
    assert bare.instances is None
    # Half a turn about the optical axis turns the image.
    turned = simulator.render_camera(replace(view, roll_rad=math.pi))
    assert np.mean(np.isclose(turned.depth_m, images.depth_m[::-1, ::-1], atol=1e-3)) > 0.99


def test_an_orthographic_map_from_above_shows_floors_and_objects_where_they_are(simulator: EmbeddedSimulator) -> None:
    floors = [body for body in simulator.objects if body.kind == "floor"]
    low_m = np.min([np.subtract(b.centre_m, np.divide(b.size_m, 2)) for b in floors], axis=0)
    high_m = np.max([np.add(b.centre_m, np.divide(b.size_m, 2)) for b in floors], axis=0)
    x_m, _, z_m = ((low_m + high_m) / 2).tolist()
    half_m = float(max(high_m - low_m)) / 2
    camera = Pose(x_m, 10.0, z_m, yaw_rad=0.0, horizon_rad=math.pi / 2)
    view = CameraView(camera, 200, 200, orthographic_half_height_m=half_m)
    depth_m, _, instances = simulator.render_camera(view)
    assert instances is not None
    rows, cols = np.nonzero(instances)
    seen = instances[rows, cols] - 1
    kinds = np.array([body.kind for body in simulator.objects])
    assert set(kinds[seen]) >= {"floor", "object"}
    assert "ceiling" not in kinds[seen]
    # Up in the image is +z, right is +x; depth counts down from the camera.
    points_m = np.stack(
        [
            x_m + (cols + 0.5 - 100) * half_m / 100,
            10.0 - depth_m[rows, cols],
            z_m - (rows + 0.5 - 100) * half_m / 100,
        ],
        axis=1,
    )
    centres_m = np.array([body.centre_m for body in simulator.objects])[seen]
    reach_m = np.array([body.size_m for body in simulator.objects])[seen] / 2 + 1e-3
    assert (np.abs(points_m - centres_m) <= reach_m).all()
    floor_share = np.mean(kinds[seen] == "floor")
    assert floor_share > 0.3


def test_nothing_is_rendered_beyond_the_clip_planes() -> None:
    near = EmbeddedSimulator(SimulatorConfig(width_px=80, height_px=60, near_m=1.0, far_m=2.0))
    start = near.reset(HOUSE_JSON)
    usual = EmbeddedSimulator(SimulatorConfig(width_px=80, height_px=60))
    usual.reset(HOUSE_JSON, start)
    num_cut = 0
    for yaw_rad in np.arange(0.0, 6.0, 0.5).tolist():
        pose = replace(start, yaw_rad=yaw_rad)
        clipped, whole = near.render(pose), usual.render(pose)
        is_kept = (whole.depth_m > 1.0) & (whole.depth_m < 2.0)
        np.testing.assert_allclose(clipped.depth_m[is_kept], whole.depth_m[is_kept], rtol=1e-5)
        is_far = whole.depth_m > 2.0
        assert np.isinf(clipped.depth_m[is_far]).all()
        assert clipped.instances is not None
        assert ((clipped.instances == 0) == np.isinf(clipped.depth_m)).all()
        num_cut += int(is_far.sum())
    assert num_cut > 0


def test_views_that_cannot_be_drawn_are_refused(simulator: EmbeddedSimulator) -> None:
    view = CameraView(simulator.pose)
    for broken, message in (
        (replace(view, near_m=0.0), "near_m"),
        (replace(view, far_m=0.05), "near_m"),
        (replace(view, far_m=math.inf), "far_m"),
        (replace(view, roll_rad=math.nan), "roll_rad"),
        (replace(view, orthographic_half_height_m=-1.0), "half_height_m"),
        (replace(view, width_px=0), "width_px"),
        (replace(view, pose=replace(view.pose, horizon_rad=math.inf)), "horizon_rad"),
    ):
        with pytest.raises(InvalidArgumentError, match=message):
            simulator.render_camera(broken)
    with pytest.raises(InvalidArgumentError, match="near_m"):
        EmbeddedSimulator(SimulatorConfig(near_m=5.0, far_m=1.0)).reset(HOUSE_JSON)
    with pytest.raises(InvalidArgumentError, match="max_distance_m"):
        simulator.visible_objects(view, max_distance_m=math.nan)
