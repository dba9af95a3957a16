"""Where MSGNav stands to see its target."""

import numpy as np
import pytest
from cup_views import a_view

from evonav.agents.msgnav.viewpoint import visible_viewpoint
from evonav.memory import ObjectMap
from evonav.sensors.observation import MapFrame
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics


def test_the_viewpoint_is_on_the_side_that_shows_the_target():
    frame = MapFrame(60, 60, 0.1, (-3.0, -3.0))
    is_free = np.ones((60, 60), bool)
    target = plate((0.0, 0.8, 0.0), 0.15)
    objects = ObjectMap()
    objects.update(view_of(plate((0.0, 1.0, 0.35), 0.6)))
    assert len(objects) == 1
    found = visible_viewpoint(objects, target, is_free, frame, (0.0, 2.0))
    assert found.found == "circle"
    assert found.share > 0.9
    assert found.position_m[1] < 0.2
    assert np.hypot(*found.position_m) == pytest.approx(0.75, abs=0.01)
    # No free floor on the circle: the nearest free cells.
    is_free[:] = False
    is_free[5:10, 30] = True  # z = -2.5 .. -2.1 m
    snapped = visible_viewpoint(objects, target, is_free, frame, (0.0, 2.0))
    assert snapped.found == "snapped"
    assert snapped.position_m == pytest.approx((0.05, -2.05))
    # Nothing shows it: the bottom edge of its box that is nearest to the agent.
    is_free[:] = False
    hidden = visible_viewpoint(objects, target, is_free, frame, (0.0, 2.0))
    assert (hidden.found, hidden.share) == ("box", 0.0)
    assert hidden.position_m == pytest.approx((0.0, 0.0), abs=0.02)
    assert visible_viewpoint(objects, target, is_free, frame, (-2.0, 0.0)).position_m[0] == pytest.approx(
        -0.14, abs=0.02
    )


def plate(centre, half_m):
    """Points 2 cm apart on a square that faces z."""
    steps = np.arange(-half_m, half_m, 0.02)
    x, y = np.meshgrid(centre[0] + steps, centre[1] + steps)
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, centre[2])], axis=1).astype(np.float32)


def view_of(points_m):
    """A view from z = 2 m, looking along -z, that shows a plate of points as one detection."""
    depth_m = np.full((200, 200), np.inf, np.float32)
    masks = np.full((200, 200), -1, np.int32)
    distance_m = 2.0 - float(points_m[0, 2])
    cols = np.floor(100.0 - points_m[:, 0] / distance_m * 100.0).astype(int)
    rows = np.floor(100.0 - (points_m[:, 1] - 1.0) / distance_m * 100.0).astype(int)
    depth_m[rows.min() : rows.max(), cols.min() : cols.max()] = distance_m
    masks[rows.min() : rows.max(), cols.min() : cols.max()] = 0
    pose, intrinsics = Pose(0.0, 1.0, 2.0, np.pi, 0.0), Intrinsics(200, 200, np.pi / 2)
    return a_view(depth_m, masks, ("Screen",), pose=pose, intrinsics=intrinsics)
