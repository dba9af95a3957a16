"""Updates of a map, frame by frame on a walk: agents' occupancy compared with volumes of OctoMap and Open3D."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav.component import optional_module
from evonav.house import bundled_houses
from evonav.memory import OccupancyMap
from evonav.sensors.observation import MapFrame
from evonav.sensors.visibility import visible_occupancy
from evonav.speed_benchmark.timing import INSTALL, Row, Sampling, compare
from evonav.world.camera import camera_axes, unproject
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics, OccupancyGrid

NAME, TITLE = "mapping", "Mapping"
NOTES = """\
Bundled houses, 36 views of 300x300 in each, range 3 m. evonav's agents keep cells on the ground; OctoMap and Open3D
keep volumes with voxels as wide.
"""
NUM_HOUSES = 4
PLACES_PER_HOUSE, VIEWS_PER_PLACE = 3, 12
RANGE_M = 3.0
PEERS = ("octomap", "open3d")


@dataclass(frozen=True)
class MappedView:
    """A view to integrate."""

    house: str
    is_first: bool
    """Whether the maps begin again."""
    pose: Pose
    depth_m: NDArray[np.float32]
    intrinsics: Intrinsics
    grid: OccupancyGrid


def measure(sampling: Sampling) -> Iterator[Row]:
    """Yield the time of one update of a map.

    Raises:
        StoreError: A named peer is not installed.
    """
    chosen = sampling.chosen(PEERS)
    views = _views(sampling.limit or NUM_HOUSES)
    maps: dict[str, OccupancyMap] = {}

    def ours(number: int) -> object:
        view = views[number]
        seen = visible_occupancy(view.grid, view.pose, view.intrinsics, RANGE_M)
        return maps[view.house].integrate(seen, (view.pose.x_m, view.pose.z_m))

    peers = {_VOLUMES[name].TITLE: _VOLUMES[name](views) for name in chosen}

    def prepare(number: int) -> None:
        view = views[number]
        if view.is_first:
            grid = view.grid
            rows, cols = grid.cells.shape
            maps[view.house] = OccupancyMap(MapFrame(rows, cols, grid.cell_m, grid.corner_m))
        for peer in peers.values():
            peer.prepare(number)

    operation = f"occupancy of one view, cells of {views[0].grid.cell_m:g} m"
    yield from compare(operation, ours, peers, [view.house for view in views], sampling=sampling, prepare=prepare)


class Octree:
    """OctoMap's octree: the points of the depth image, with free space along their rays."""

    TITLE = "OctoMap, volume"

    def __init__(self, views: list[MappedView]) -> None:
        """Begin without a tree.

        Raises:
            StoreError: OctoMap is not installed.
        """
        self._library = optional_module("octomap", "the peer octomap needs its library", INSTALL)
        self._views = views

    def prepare(self, number: int) -> None:
        """Unproject the depth image, and begin a tree in a new house."""
        view = self._views[number]
        if view.is_first:
            self._tree = self._library.OcTree(view.grid.cell_m)
        points_m = unproject(view.depth_m, view.pose, view.intrinsics)
        self._points_m = np.ascontiguousarray(points_m[np.isfinite(view.depth_m)], np.float64)
        self._origin_m = np.array(view.pose.position_m, np.float64)

    def __call__(self, _number: int) -> object:
        """Insert the points."""
        return self._tree.insertPointCloud(self._points_m, self._origin_m, RANGE_M)


class Tsdf:
    """Open3D's truncated signed distances and weights, in blocks near surfaces."""

    TITLE = "Open3D, TSDF"

    def __init__(self, views: list[MappedView]) -> None:
        """Begin without a volume.

        Raises:
            StoreError: Open3D is not installed.
        """
        self._library = optional_module("open3d", "the peer open3d needs its library", INSTALL)
        self._views = views

    def prepare(self, number: int) -> None:
        """Convert the depth image and the camera, and begin a volume in a new house."""
        view, tensor = self._views[number], self._library.core.Tensor
        if view.is_first:
            float32 = self._library.core.float32
            self._grid = self._library.t.geometry.VoxelBlockGrid(
                ("tsdf", "weight"), (float32, float32), ((1), (1)), view.grid.cell_m, block_resolution=8
            )
        right, up, forward = camera_axes(view.pose)
        camera_from_world = np.eye(4)
        camera_from_world[:3, :3] = right, -up, forward
        camera_from_world[:3, 3] = -camera_from_world[:3, :3] @ np.array(view.pose.position_m)
        # Open3D has pixel centres at whole numbers.
        focal_px, (height_px, width_px) = view.intrinsics.focal_px, view.depth_m.shape
        pinhole = [[focal_px, 0.0, (width_px - 1) / 2], [0.0, focal_px, (height_px - 1) / 2], [0.0, 0.0, 1.0]]
        self._depth = self._library.t.geometry.Image(tensor(np.where(np.isfinite(view.depth_m), view.depth_m, 0.0)))
        self._camera = tensor(np.array(pinhole)), tensor(camera_from_world)

    def __call__(self, _number: int) -> object:
        """Find the blocks near the surfaces, and integrate the image into them."""
        scale_and_range = 1.0, RANGE_M
        blocks = self._grid.compute_unique_block_coordinates(self._depth, *self._camera, *scale_and_range)
        return self._grid.integrate(blocks, self._depth, *self._camera, *scale_and_range)


_VOLUMES: dict[str, type[Octree | Tsdf]] = {"octomap": Octree, "open3d": Tsdf}


def _views(num_houses: int) -> list[MappedView]:
    random = np.random.default_rng(0)
    views: list[MappedView] = []
    for number, house in enumerate(bundled_houses(num_houses)):
        simulator = EmbeddedSimulator()
        simulator.reset(house.to_json(), name=house.name)
        reachable_m = simulator.reachable_positions()
        for x_m, y_m, z_m in reachable_m[random.choice(len(reachable_m), PLACES_PER_HOUSE)].tolist():
            for turn in range(VIEWS_PER_PLACE):
                frame = simulator.render(Pose(x_m, y_m, z_m, 2.0 * np.pi * turn / VIEWS_PER_PLACE), rgb=False)
                name = house.name or str(number)
                is_first = not views or views[-1].house != name
                views.append(
                    MappedView(name, is_first, frame.pose, frame.depth_m, frame.intrinsics, simulator.occupancy())
                )
    return views
