"""UniGoal's map through its Python interface."""

import math

import numpy as np
import pytest
from cup_views import a_view
from numpy.typing import NDArray

from evonav.agents.unigoal.bev import BevConfig, BevMap
from evonav.errors import InvalidArgumentError
from evonav.memory.occupancy import BLOCKED, FREE, UNKNOWN
from evonav.sensors.observation import View
from evonav.world.camera import unproject
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics

INTRINSICS = Intrinsics(300, 300, math.pi / 2)
CAMERA_M = 1.575


def floor_and_box(yaw_rad: float, horizon_rad: float, box: tuple[float, float, float, float] | None) -> View:
    """A look from the origin over an endless floor, perhaps at a box from the floor to 1 m.

    Args:
        yaw_rad: Of the camera.
        horizon_rad: Of the camera.
        box: Smallest and largest x, smallest and largest z.
    """
    camera = Pose(0.0, CAMERA_M, 0.0, yaw_rad, horizon_rad)
    rays = unproject(np.ones((300, 300), np.float32), camera, INTRINSICS) - (0.0, CAMERA_M, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(rays[..., 1] < -1e-6, -CAMERA_M / rays[..., 1], np.inf)
        if box is not None:
            low, high = np.array([box[0], 0.0, box[2]]), np.array([box[1], 1.0, box[3]])
            ends = np.stack([(low - (0.0, CAMERA_M, 0.0)) / rays, (high - (0.0, CAMERA_M, 0.0)) / rays])
            enter, leave = ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)
            depth = np.where((enter < leave) & (enter > 0), np.minimum(depth, enter), depth)
    return a_view(depth, pose=camera, intrinsics=INTRINSICS)


def where(cells: NDArray[np.bool_], bev: BevMap) -> NDArray[np.float64]:
    """`(N, 2)` x and z of cells."""
    return np.array([bev.map_frame.centre_m(int(row), int(col)) for row, col in np.argwhere(cells)]).reshape(-1, 2)


@pytest.mark.parametrize("horizon_deg", [0.0, 30.0])
@pytest.mark.parametrize("yaw_deg", [0.0, 45.0, 120.0])
def test_a_table_is_an_obstacle_where_it_stands(yaw_deg: float, horizon_deg: float) -> None:
    bev = BevMap((0.0, 0.0), 0)
    yaw_rad = math.radians(yaw_deg)
    x_m, z_m = 2.0 * math.sin(yaw_rad), 2.0 * math.cos(yaw_rad)
    box = (x_m - 0.4, x_m + 0.4, z_m - 0.4, z_m + 0.4)
    bev.integrate(floor_and_box(yaw_rad, math.radians(horizon_deg), box))
    obstacles = where(bev.core.obstacles, bev)
    assert len(obstacles) > 15
    assert np.abs(obstacles - (x_m, z_m)).max() < 0.4 + 0.05
    # Its near side is there from end to end; the floor before it is free, where the camera sees any.
    near = obstacles[np.hypot(*obstacles.T) < math.hypot(x_m, z_m)]
    assert np.ptp(near @ (math.cos(yaw_rad), -math.sin(yaw_rad))) > 0.7
    free = bev.cell_of((0.55 * x_m, 0.55 * z_m))
    assert free is not None
    assert bev.cells[free] == (FREE if horizon_deg else UNKNOWN)
    assert bev.cells[0, 0] == UNKNOWN
    assert bev.cells[tuple(np.argwhere(bev.core.obstacles)[0])] == BLOCKED


def test_categories_count_points_among_the_obstacles_and_keep_their_maximum() -> None:
    bev = BevMap((0.0, 0.0), 3)
    view = floor_and_box(0.0, 0.5, (-0.4, 0.4, 1.6, 2.4))
    heights = unproject(view.depth_m, Pose(0.0, CAMERA_M, 0.0, 0.0, 0.5), INTRINSICS)[..., 1]
    categories = np.full((300, 300), -1, np.int32)
    categories[heights > 0.1] = 2
    categories[np.abs(heights) < 0.05] = 0
    bev.integrate(view, categories)
    table = bev.core.category(2)
    assert table.max() == 1.0
    assert ((table > 0) <= bev.core.obstacles).all()
    # Floor is below the obstacles: it counts for no category.
    assert not bev.core.category(0).any()
    assert not bev.core.category(1).any()
    bev.integrate(view)
    assert np.array_equal(bev.core.category(2), table)


def test_the_cells_of_a_mask_are_where_its_pixels_lie() -> None:
    bev = BevMap((0.0, 0.0), 0)
    view = floor_and_box(0.0, 0.5, (-0.4, 0.4, 1.6, 2.4))
    heights = unproject(view.depth_m, Pose(0.0, CAMERA_M, 0.0, 0.0, 0.5), INTRINSICS)[..., 1]
    cells = bev.core.cells_of(view, heights > 0.5)
    assert len(cells) > 100
    points = np.array([bev.map_frame.centre_m(int(row), int(col)) for row, col in cells])
    assert np.abs(points - (0.0, 2.0)).max() < 0.43
    assert len(bev.core.cells_of(view, np.zeros((300, 300), np.bool_))) == 0
    grown = bev.core.grown(cells[:1], 3)
    assert len(grown) == 29  # the disk of radius 3
    assert np.hypot(*(grown - cells[0]).T).max() == 3.0


def test_places_and_cells() -> None:
    bev = BevMap((1.0, -2.0), 0, BevConfig(size_m=10.0))
    assert bev.map_frame.rows == bev.map_frame.cols == 200
    assert bev.cell_of((1.01, -1.99)) == (100, 100)
    assert bev.map_frame.centre_m(100, 100) == pytest.approx((1.025, -1.975))
    assert bev.cell_of((6.01, 0.0)) is None
    assert bev.cell_of((-4.01, 0.0)) is None


def test_bad_images_are_refused_by_name() -> None:
    bev = BevMap((0.0, 0.0), 2)
    view = floor_and_box(0.0, 0.5, None)
    with pytest.raises(InvalidArgumentError, match="categories"):
        bev.integrate(view, np.zeros((299, 300), np.int32))
    with pytest.raises(InvalidArgumentError, match="categories"):
        bev.integrate(view, np.full((300, 300), 2, np.int32))
    with pytest.raises(InvalidArgumentError, match="mask"):
        bev.core.cells_of(view, np.zeros((3, 3), np.bool_))
    with pytest.raises(InvalidArgumentError, match="stride_px"):
        BevMap((0.0, 0.0), 2, BevConfig(stride_px=0))
    assert not bev.core.explored.any()
