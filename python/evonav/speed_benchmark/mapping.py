"""Updates of a map, frame by frame on a walk: agents' occupancy beside volumes of OctoMap."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evonav.component import optional_module
from evonav.house import bundled_houses
from evonav.memory import OccupancyMap
from evonav.sensors.observation import MapFrame
from evonav.sensors.visibility import visible_occupancy
from evonav.speed_benchmark.records import Row
from evonav.speed_benchmark.timing import INSTALL, Sampling, compare
from evonav.world.camera import unproject
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics, OccupancyGrid

NAME, TITLE = "mapping", "Mapping"
NOTES = """Bundled houses, 36 views in each: at three reachable places, a turn in steps of 30 degrees; 300x300, range
3 m. Every map begins empty in each house. Maps differ in what they are: evonav's agents know cells on the ground,
cast on the oracle occupancy as in the paper; OctoMap makes a volume of the depth image, with voxels as
wide as evonav's cells. So the ratio says what one sort of map costs beside the other, not which code is faster. Points
are prepared beforehand and not timed.
"""
NUM_HOUSES = 4
PLACES_PER_HOUSE, VIEWS_PER_PLACE = 3, 12
RANGE_M = 3.0
PEERS = ("octomap",)


@dataclass(frozen=True)
class MapView:
    """A view to integrate."""

    house: str
    is_first: bool
    """Whether the maps begin anew."""
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

    peers = {Octree.TITLE: Octree(views)} if chosen else {}

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

    def __init__(self, views: list[MapView]) -> None:
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


def _views(num_houses: int) -> list[MapView]:
    random = np.random.default_rng(0)
    views: list[MapView] = []
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
                    MapView(name, is_first, frame.pose, frame.depth_m, frame.intrinsics, simulator.occupancy())
                )
    return views
