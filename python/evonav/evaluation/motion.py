"""How an agent's answer is carried out: planner waypoints and teleports, as in the paper (Sec. C.3)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from evonav.agents.agent import Move, NavigateTo
from evonav.world.pose import Pose
from evonav.world.simulator import Action, Simulator

Point2 = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Motion:
    """What came of an action."""

    path_m: tuple[Point2, ...]
    """Points passed, the start first."""
    is_success: bool
    has_arrived: bool = False

    @property
    def length_m(self) -> float:
        """Length on the ground plane."""
        return polyline_length_m(self.path_m)


def polyline_length_m(path_m: Sequence[Point2]) -> float:
    """Length of a polyline on the ground plane."""
    return math.fsum(math.dist(a, b) for a, b in pairwise(path_m))


def waypoints(corners_m: Sequence[Point2], spacing_m: float, max_travel_m: float) -> tuple[list[Point2], bool]:
    """Points along a path, every corner and at most `spacing_m` apart.

    Args:
        corners_m: The path; the agent stands at its first point.
        spacing_m: Longest hop.
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


def navigate(simulator: Simulator, action: NavigateTo, *, spacing_m: float, max_travel_m: float) -> Motion:
    """Follows the planner towards a point; the heading is that of travel, on arrival towards `face_m`."""
    start = simulator.pose
    here = (start.x_m, start.z_m)
    target_x_m, target_z_m = action.position_m
    corners = simulator.shortest_path(start.position_m, (target_x_m, start.y_m, target_z_m))
    if len(corners) == 0:
        return Motion((here,), is_success=False)
    path = [here, *((float(x), float(z)) for x, _, z in corners)]
    points, is_end = waypoints(path, spacing_m, max_travel_m)
    passed = [here]
    for point in points:
        x0, z0 = passed[-1]
        yaw_rad = math.atan2(point[0] - x0, point[1] - z0)
        if not simulator.teleport(replace(simulator.pose, x_m=point[0], z_m=point[1], yaw_rad=yaw_rad)):
            return Motion(tuple(passed), is_success=False)
        passed.append(point)
    if is_end and action.face_m is not None:
        face(simulator, action.face_m)
    return Motion(tuple(passed), is_success=True, has_arrived=is_end)


def face(simulator: Simulator, point_m: Point2) -> None:
    """Turns on the spot towards a point; stays as it is when already on it."""
    pose = simulator.pose
    dx_m, dz_m = point_m[0] - pose.x_m, point_m[1] - pose.z_m
    if math.hypot(dx_m, dz_m) > 1e-6:
        simulator.teleport(replace(pose, yaw_rad=math.atan2(dx_m, dz_m)))


def move(simulator: Simulator, action: Move) -> Motion:
    """One discrete action."""
    start = simulator.pose
    is_success = action.action is Action.STOP or simulator.step(action.action)
    end: Pose = simulator.pose
    here, there = (start.x_m, start.z_m), (end.x_m, end.z_m)
    return Motion((here,) if here == there else (here, there), is_success=is_success)
