"""Views of bundled houses that renderers are compared on."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evonav.errors import SimulationError
from evonav.house import bundled_houses
from evonav.world.camera import CameraView
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import SimulatorConfig

POSES_PER_HOUSE = 20

Images = tuple[NDArray[np.float32], NDArray[np.int32]]
"""Depth and instances."""
Renderer = Callable[[int], Images]
"""Draws the view of a number."""


@dataclass(frozen=True)
class RenderedView:
    """One image to make."""

    house: int
    """Number of the house's simulator."""
    name: str
    """Name of the house."""
    camera: CameraView
    camera_from_world: NDArray[np.float64]
    """`(3, 3)`: right, down, forward."""
    position_m: NDArray[np.float64]


def views_of_houses(config: SimulatorConfig, num_houses: int) -> tuple[list[EmbeddedSimulator], list[RenderedView]]:
    """Return a simulator a house, and 20 views in each from reachable positions, always the same."""
    random = np.random.default_rng(0)
    simulators, views = [], []
    for number, house in enumerate(bundled_houses(num_houses)):
        simulator = EmbeddedSimulator(config)
        simulator.reset(house.to_json(), name=house.name)
        simulators.append(simulator)
        reachable_m = simulator.reachable_positions()
        for index in random.choice(len(reachable_m), POSES_PER_HOUSE):
            x_m, y_m, z_m = reachable_m[index].tolist()
            pose = Pose(x_m, y_m, z_m, yaw_rad=float(random.uniform(0, 2 * np.pi)))
            sin_y, cos_y = np.sin(pose.yaw_rad), np.cos(pose.yaw_rad)
            sin_p, cos_p = np.sin(pose.horizon_rad), np.cos(pose.horizon_rad)
            axes = np.array(
                [
                    [cos_y, 0, -sin_y],
                    [-sin_y * sin_p, -cos_p, -cos_y * sin_p],
                    [sin_y * cos_p, -sin_p, cos_y * cos_p],
                ]
            )
            camera = CameraView(
                replace(pose, y_m=config.camera_height_m),
                config.width_px,
                config.height_px,
                config.intrinsics.vertical_fov_rad,
                config.near_m,
                config.far_m,
            )
            position_m = np.array(camera.pose.position_m)
            views.append(RenderedView(number, house.name or str(number), camera, axes, position_m))
    return simulators, views


def our_renderer(simulators: Sequence[EmbeddedSimulator], views: Sequence[RenderedView], *, rgb: bool) -> Renderer:
    """Return what draws a view with evonav's rasteriser."""

    def call(number: int) -> Images:
        view = views[number]
        images = simulators[view.house].render_camera(view.camera, rgb=rgb)
        if images.instances is None:
            raise SimulationError("no instances in images that were asked for them")
        return images.depth_m, images.instances

    return call
