"""Find where to stand to look at a remembered object (3D-Mem's observation point)."""

import math

import numpy as np
from numpy.typing import NDArray

from evonav.agents.grid import numbered
from evonav.points import Point2
from evonav.sensors.observation import MapFrame


def observation_point(
    is_free: NDArray[np.bool_], frame: MapFrame, object_m: Point2, distance_m: float = 1.5
) -> Point2 | None:
    """Return a free place `distance_m` from an object, on the side where most free floor is.

    The free cells within `distance_m` of the object fall into 4-connected groups. The point lies in the direction of
    the largest group's mean, at `distance_m` exactly, moved to the nearest free cell.

    Args:
        is_free: `(R, C)`, cells known to be free.

    Returns:
        `(x, z)` of a cell's middle, or `None` if no cell within `distance_m` is known to be free.
    """
    window, offset = window_around(is_free, frame, object_m, distance_m + 2 * frame.cell_m)
    cells = np.argwhere(window)
    if len(cells) == 0:
        return None
    x_m, z_m = frame.centres_m(cells + offset).T
    is_near = np.hypot(x_m - object_m[0], z_m - object_m[1]) <= distance_m
    near = np.zeros_like(window)
    near[tuple(cells[is_near].T)] = True
    group = _largest_group(near)
    if group is None:
        return None
    mean_m = frame.centre_m(*(group.mean(axis=0) + offset).tolist())
    dx_m, dz_m = mean_m[0] - object_m[0], mean_m[1] - object_m[1]
    length_m = math.hypot(dx_m, dz_m)
    if length_m > 1e-9:
        wanted = (object_m[0] + dx_m / length_m * distance_m, object_m[1] + dz_m / length_m * distance_m)
    else:
        wanted = object_m
    best = int(np.hypot(x_m - wanted[0], z_m - wanted[1]).argmin())
    return (float(x_m[best]), float(z_m[best]))


def window_around(
    is_free: NDArray[np.bool_], frame: MapFrame, centre_m: Point2, reach_m: float
) -> tuple[NDArray[np.bool_], tuple[int, int]]:
    """Return the part of the map around a point, and the row and column where it begins."""
    ends = []
    for centre, corner, size in (
        (centre_m[1], frame.corner_m[1], frame.rows),
        (centre_m[0], frame.corner_m[0], frame.cols),
    ):
        low = math.floor((centre - reach_m - corner) / frame.cell_m)
        high = math.ceil((centre + reach_m - corner) / frame.cell_m)
        ends.append((min(max(low, 0), size), min(max(high, 0), size)))
    (row_low, row_high), (col_low, col_high) = ends
    return is_free[row_low:row_high, col_low:col_high], (row_low, col_low)


def _largest_group(cells: NDArray[np.bool_]) -> NDArray[np.int64] | None:
    """Return the `(N, 2)` cells of the largest 4-connected group, the first of equals; `None` without cells."""
    # Not by scipy.ndimage: importing it takes an agent's process longer than all else that it imports.
    groups = numbered(cells, min_cells=1)
    sizes = np.bincount(groups[cells])
    return np.argwhere(groups == sizes.argmax()) if len(sizes) else None


def widest_direction_rad(
    is_free: NDArray[np.bool_], frame: MapFrame, here_m: Point2, reach_m: float, num_directions: int = 72
) -> float | None:
    """Return the middle of the widest run of directions in which the floor is known to be free.

    Args:
        is_free: `(R, C)`, cells known to be free.
        reach_m: Distance over which the floor has to be free.
        num_directions: Number of directions to try, evenly spaced from +z clockwise.

    Returns:
        Radians clockwise from +z; of runs as wide, the first one's. `None` if no direction is free.
    """
    bearings_rad = np.arange(num_directions) * (math.tau / num_directions)
    steps_m = np.arange(1, math.ceil(reach_m / frame.cell_m) + 1) * frame.cell_m
    x_m = here_m[0] + np.sin(bearings_rad)[:, None] * np.minimum(steps_m, reach_m)
    z_m = here_m[1] + np.cos(bearings_rad)[:, None] * np.minimum(steps_m, reach_m)
    rows, cols = np.moveaxis(frame.cells_at(np.stack([x_m, z_m], axis=-1)), -1, 0)
    is_on_map = (rows >= 0) & (rows < frame.rows) & (cols >= 0) & (cols < frame.cols)
    is_open = (is_on_map & is_free[np.where(is_on_map, rows, 0), np.where(is_on_map, cols, 0)]).all(axis=1).tolist()
    if all(is_open):
        return 0.0
    best_start, best_length = 0, 0
    for start in range(num_directions):
        if is_open[start] and not is_open[start - 1]:
            length = next(k for k in range(num_directions) if not is_open[(start + k) % num_directions])
            if length > best_length:
                best_start, best_length = start, length
    if best_length == 0:
        return None
    return ((best_start + (best_length - 1) / 2) % num_directions) * (math.tau / num_directions)
