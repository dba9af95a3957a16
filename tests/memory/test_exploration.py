"""Map, frontiers and entries on real houses: a walk to the nearest frontier learns the house."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from evonav.house import bundled_houses
from evonav.memory import ObjectMap, OccupancyMap
from evonav.perception.ground_truth import DETECTED_KINDS, GroundTruthPerception
from evonav.sensors.observation import MapFrame, View
from evonav.sensors.visibility import visible_occupancy
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import OccupancyGrid


def length_m(path: list[list[float]]) -> float:
    return sum(math.dist(a, b) for a, b in pairwise(path))


class Walker:
    """Looks around by 3D-Mem's schedule and goes to the nearest frontier, a metre a round."""

    def __init__(self, house_json: str) -> None:
        self.simulator = EmbeddedSimulator()
        self.pose = self.simulator.reset(house_json)
        self.grid: OccupancyGrid = self.simulator.occupancy()
        rows, cols = self.grid.cells.shape
        self.map = OccupancyMap(MapFrame(rows, cols, self.grid.cell_m, self.grid.corner_m))
        self.entries = ObjectMap()
        self.num_conflicts = 0

    def look(self, count: int, spacing_deg: float) -> None:
        for k in range(count):
            yaw_rad = self.pose.yaw_rad + math.radians((k - (count - 1) / 2) * spacing_deg)
            pose = replace(self.pose, yaw_rad=yaw_rad)
            frame = self.simulator.render(pose, rgb=False)
            seen = visible_occupancy(self.grid, pose, frame.intrinsics, 3.0)
            self.num_conflicts += len(self.map.integrate(seen, (pose.x_m, pose.z_m)))
            found = GroundTruthPerception().detect(frame, self.simulator.objects)
            self.entries.update(View(frame.pose, frame.intrinsics, frame.depth_m, found, seen))
        self.map.explore_around((self.pose.x_m, self.pose.z_m))

    def explore(self, max_rounds: int) -> None:
        self.look(7, 40.0)
        for _ in range(max_rounds):
            frontiers = self.map.update_frontiers((self.pose.x_m, self.pose.z_m))
            if not frontiers:
                return
            self.approach([(f.position_m, f.direction_rad) for f in frontiers])
            self.look(3, 60.0)

    def approach(self, places: list[tuple[tuple[float, float], float]]) -> None:
        def plan(place: tuple[float, float]) -> list[list[float]]:
            path = self.simulator.shortest_path(self.pose.position_m, (place[0], 0.0, place[1]))
            return path[:, [0, 2]].tolist()

        stay = ([[self.pose.x_m, self.pose.z_m]], self.pose.yaw_rad)
        plans = [(plan(place), yaw_rad) for place, yaw_rad in places]
        path, yaw_rad = min((p for p in plans if p[0]), default=stay, key=lambda p: length_m(p[0]))
        left_m, at = 1.0, path[0]
        for a, b in pairwise(path):
            step_m = math.dist(a, b)
            if step_m > left_m:
                at = [a[i] + (b[i] - a[i]) * left_m / step_m for i in (0, 1)]
                yaw_rad = math.atan2(b[0] - a[0], b[1] - a[1])
                break
            left_m, at = left_m - step_m, b
        self.pose = Pose(at[0], self.pose.y_m, at[1], yaw_rad, self.pose.horizon_rad)


@pytest.mark.parametrize("index", [3, 7])
def test_a_walk_to_the_nearest_frontier_learns_the_house(index: int) -> None:
    house = list(bundled_houses())[index]
    walker = Walker(house.to_json())
    walker.explore(100)
    assert walker.num_conflicts == 0, "the house did not change"
    reachable_m = walker.simulator.reachable_positions()[:, [0, 2]]
    cols, rows = np.floor((reachable_m - walker.grid.corner_m) / walker.grid.cell_m).astype(int).T
    assert (walker.map.cells[rows, cols] != 0).mean() > 0.9
    known = walker.map.cells
    assert (walker.grid.cells[known == 1] == 0).all()
    assert (walker.grid.cells[known == 2] == 1).all()
    objects = [body for body in walker.simulator.objects if body.kind in DETECTED_KINDS]

    def is_object(label: str, centre_m: tuple[float, float, float]) -> bool:
        return any(body.category == label and math.dist(body.centre_m, centre_m) < 0.8 for body in objects)

    entries = walker.entries.entries
    assert len(entries) > 0.4 * len(objects)
    assert np.mean([is_object(entry.label, entry.centre_m) for entry in entries]) > 0.9
