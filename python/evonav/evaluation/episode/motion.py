"""Carry out an agent's answer with planner waypoints and teleports, as in the paper (Sec. C.3)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from evonav.agents.agent import Move, NavigateTo
from evonav.points import Point2
from evonav.world.pose import Pose, moved, turned
from evonav.world.simulator import Action, OccupancyGrid, Simulator


@dataclass(frozen=True, slots=True)
class Motion:
    """The result of an action."""

    path_m: tuple[Point2, ...]
    """Points of the path, the start first."""
    is_success: bool
    has_arrived: bool = False

    @property
    def length_m(self) -> float:
        """Length on the ground plane."""
        return polyline_length_m(self.path_m)


def polyline_length_m(path_m: Sequence[Point2]) -> float:
    """Return the length of a polyline on the ground plane."""
    return math.fsum(map(math.dist, path_m, path_m[1:]))


def length_outside_m(path_m: Sequence[Point2], centre_m: Point2, radius_m: float) -> float:
    """Return the length of a polyline until it first comes within a radius; its whole length if it never does."""
    length_before_m = 0.0
    for (x0, z0), (x1, z1) in pairwise([*path_m, *path_m[-1:]]):
        dx, dz, ox, oz = x1 - x0, z1 - z0, x0 - centre_m[0], z0 - centre_m[1]
        if math.hypot(ox, oz) <= radius_m:
            return length_before_m
        length_m = math.hypot(dx, dz)
        # |o + t d| = r for the least t in 0..1.
        a, half_b = dx * dx + dz * dz, ox * dx + oz * dz
        discriminant = half_b * half_b - a * (ox * ox + oz * oz - radius_m * radius_m)
        if a > 0.0 and discriminant >= 0.0:
            share = (-half_b - math.sqrt(discriminant)) / a
            if 0.0 <= share <= 1.0:
                return length_before_m + share * length_m
        length_before_m += length_m
    return length_before_m


def waypoints(corners_m: Sequence[Point2], spacing_m: float, max_travel_m: float) -> tuple[list[Point2], bool]:
    """Return points along a path, every corner and at most `spacing_m` apart.

    Args:
        corners_m: The path; the agent stands at its first point.
        spacing_m: Longest distance between two points.
        max_travel_m: Path length after which to end.

    Returns:
        The points without the first, and whether the last is the path's end.
    """
    points: list[Point2] = []
    left_m = max_travel_m
    for (x0, z0), (x1, z1) in pairwise(corners_m):
        length_m = math.hypot(x1 - x0, z1 - z0)
        if length_m == 0.0:
            continue
        # A hair of slack, or a path of just the allowed length would take another round for a rounding error.
        is_whole = length_m <= left_m + 1e-9
        covered_m = length_m if is_whole else left_m
        num_hops = max(1, math.ceil(covered_m / spacing_m - 1e-9))
        for hop in range(1, num_hops + 1):
            share = covered_m * hop / num_hops / length_m
            points.append(
                (x1, z1) if is_whole and hop == num_hops else (x0 + (x1 - x0) * share, z0 + (z1 - z0) * share)
            )
        left_m -= covered_m
        if not is_whole:
            return points, False
        if left_m <= 1e-9:
            return points, points[-1] == tuple(corners_m[-1])
    return points, True


def legs(corners_m: Sequence[Point2], travel_m: float) -> list[tuple[Point2, ...]]:
    """Cut a path into pieces of `travel_m`, the last one shorter; each begins where the one before ends.

    Args:
        travel_m: Length of a piece along the path.

    Returns:
        Points of each piece, corners included; none for a path without length.
    """
    pieces: list[tuple[Point2, ...]] = []
    left = [corners_m[0], *(b for a, b in pairwise(corners_m) if a != b)]
    while len(left) > 1:
        ahead, _ = waypoints(left, math.inf, travel_m)
        pieces.append((left[0], *ahead))
        # Where it ended within a segment, the rest of that segment is left.
        num_corners = len(ahead) - (ahead[-1] != left[len(ahead)])
        left = [ahead[-1], *left[1 + num_corners :]]
    return pieces


FULL_REACH_M = 1.5
"""Every target of a task has a free place this near that can be reached."""
MAX_TRIES = 16
"""Free cells that are tried for an agent that no path leads from."""


class Rooms(Protocol):
    """Knows a house's rooms: `House`, and the core's simulator of one."""

    def room_of(self, x_m: float, z_m: float) -> str | None:
        """Return the id of the room whose floor contains the point."""
        ...


class Planner:
    """The simulator's shortest paths, to the nearest reachable place where a point itself is cut off.

    The free point nearest to an object may lie in a pocket behind furniture; the paper's reading is the nearest
    *reachable* one (docs/parity.md), of the grid that the agent's own steps reach. Off the house's grid, those may end
    at a gap that a path leads through: where they reach nothing near, the occupancy's free cells are tried.
    """

    def __init__(self, simulator: Simulator) -> None:
        """Create a planner for the present house of the simulator."""
        self._simulator = simulator
        self._reachable_m: NDArray[np.float64] | None = None

    def path_m(self, target_m: Point2) -> list[Point2]:
        """Return corners from the agent to a target; empty if there is no path to any place near it."""
        pose = self._simulator.pose
        corners = self._simulator.shortest_path(pose.position_m, (target_m[0], pose.y_m, target_m[1]))
        if len(corners) == 0:
            corners = self._path_near(target_m)
        return [(x_m, z_m) for x_m, _, z_m in corners.tolist()]

    def into_room_m(self, path_m: list[Point2], target_m: Point2, house: Rooms, room_id: str) -> list[Point2]:
        """Return corners to the free point of a target's room that is nearest to the target.

        Args:
            path_m: Path to the nearest free point of the house, which may lie behind a wall. It is returned if it ends
                in the room, or if no path leads there.
        """
        if not path_m or house.room_of(*path_m[-1]) == room_id:
            return path_m
        pose = self._simulator.pose
        free_m, _ = _by_distance(_free_cells_m(self._simulator.occupancy()), target_m)
        in_room = ((x_m, z_m) for x_m, z_m in free_m.tolist() if house.room_of(x_m, z_m) == room_id)
        for x_m, z_m in islice(in_room, MAX_TRIES):
            corners = self._simulator.shortest_path(pose.position_m, (x_m, pose.y_m, z_m))
            if len(corners) and house.room_of(float(corners[-1][0]), float(corners[-1][2])) == room_id:
                return [(x_m, z_m) for x_m, _, z_m in corners.tolist()]
        return path_m

    def _path_near(self, target_m: Point2) -> NDArray[np.float64]:
        """Return `(M, 3)` corners to the nearest place that can be reached; `(0, 3)` when there is none."""
        pose = self._simulator.pose
        if self._reachable_m is None:
            self._reachable_m = self._simulator.reachable_positions()[:, [0, 2]]
        places_m, gaps_m = _by_distance(self._reachable_m, target_m)
        if not len(gaps_m) or gaps_m[0] > FULL_REACH_M:
            free_m, free_gaps_m = _by_distance(_free_cells_m(self._simulator.occupancy()), target_m)
            is_nearer = free_gaps_m[:MAX_TRIES] < (gaps_m[0] if len(gaps_m) else np.inf)
            for x_m, z_m in free_m[:MAX_TRIES][is_nearer].tolist():
                corners = self._simulator.shortest_path(pose.position_m, (x_m, pose.y_m, z_m))
                if len(corners):
                    return corners
        if not len(places_m):
            return np.empty((0, 3))
        x_m, z_m = places_m[0].tolist()
        return self._simulator.shortest_path(pose.position_m, (x_m, pose.y_m, z_m))


def _by_distance(places_m: NDArray[np.float64], target_m: Point2) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sort places by their distance to a point, and return the distances."""
    gaps_m = np.hypot(*(places_m - np.array(target_m)).T)
    order = gaps_m.argsort(kind="stable")
    return places_m[order], gaps_m[order]


def _free_cells_m(grid: OccupancyGrid) -> NDArray[np.float64]:
    """Return the `(N, 2)` middles of the cells that the agent's body reaches from the house's start."""
    rows, cols = np.nonzero(grid.cells == 0)
    corner_m = np.array(grid.corner_m, dtype=np.float64)
    return np.column_stack((cols, rows)) * float(grid.cell_m) + grid.cell_m / 2 + corner_m


def navigate(
    simulator: Simulator, planner: Planner, action: NavigateTo, *, spacing_m: float, max_travel_m: float
) -> Motion:
    """Follow the planner towards a point; the heading is that of travel, on arrival towards `face_m`."""
    start = simulator.pose
    here = (start.x_m, start.z_m)
    corners = planner.path_m(action.position_m)
    if not corners:
        return Motion((here,), is_success=False)
    points, is_end = waypoints([here, *corners], spacing_m, max_travel_m)
    passed = [here]
    for point in points:
        x0, z0 = passed[-1]
        yaw_rad = math.atan2(point[0] - x0, point[1] - z0)
        if not simulator.teleport(moved(simulator.pose, *point, yaw_rad)):
            return Motion(tuple(passed), is_success=False)
        passed.append(point)
    if is_end and action.face_m is not None:
        face(simulator, action.face_m)
    return Motion(tuple(passed), is_success=True, has_arrived=is_end)


def walk(simulator: Simulator, leg_m: Sequence[Point2], yaw_rad: float | None = None) -> Motion:
    """Move the agent along a piece of a path that is known to be free.

    Args:
        leg_m: Points, the agent's own first.
        yaw_rad: Heading at the end; default: that of travel.
    """
    (x0, z0), (x1, z1) = leg_m[-2], leg_m[-1]
    heading_rad = math.atan2(x1 - x0, z1 - z0) if yaw_rad is None else yaw_rad
    is_success = simulator.teleport(moved(simulator.pose, x1, z1, heading_rad))
    return Motion(tuple(leg_m), is_success=is_success)


def face(simulator: Simulator, point_m: Point2) -> None:
    """Turn on the spot towards a point; do nothing at the point itself."""
    pose = simulator.pose
    dx_m, dz_m = point_m[0] - pose.x_m, point_m[1] - pose.z_m
    if math.hypot(dx_m, dz_m) > 1e-6:
        simulator.teleport(turned(pose, math.atan2(dx_m, dz_m)))


def stay(simulator: Simulator) -> Motion:
    """Stand still."""
    pose = simulator.pose
    return Motion(((pose.x_m, pose.z_m),), is_success=True)


def move(simulator: Simulator, action: Move) -> Motion:
    """Carry out one discrete action."""
    start = simulator.pose
    is_success = action.action is Action.STOP or simulator.step(action.action)
    end: Pose = simulator.pose
    here, there = (start.x_m, start.z_m), (end.x_m, end.z_m)
    return Motion((here,) if here == there else (here, there), is_success=is_success)
