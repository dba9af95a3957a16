"""The memory at the size of one observation, against NumPy, OpenCV, SciPy, and Open3D with faiss."""

import math
from collections.abc import Callable

import cv2
import faiss
import numpy as np
import open3d as o3d
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from evonav.memory import ObjectMap, ObjectMapConfig, OccupancyMap
from evonav.memory.presence import DepthEvidence
from evonav.memory_benchmark.open3d_faiss import Cloud, associate, detect, merged
from evonav.sensors.observation import Detections, MapFrame, View, VisibleOccupancy
from evonav.sensors.visibility import visible_occupancy
from evonav.speed_benchmark.timing import Row, compare
from evonav.world.camera import camera_axes
from evonav.world.pose import Pose
from evonav.world.simulator import Intrinsics, OccupancyGrid

NOTES = """\
Made-up inputs; the peers' results are checked to be evonav's (distances: within 10%). Object memory: one 300x300
frame with 20 masks, 100 entries of about 7,000 points, voxels of 0.01 m.
"""

MADE = "made"
"""The house of all inputs: they are made up, and have no interval by house."""
SIDE_PX = 300
BOX_M = 0.4
_Call = Callable[[int], object]
_INTRINSICS = Intrinsics(SIDE_PX, SIDE_PX, math.pi / 2)


def run() -> list[Row]:
    """Times visibility, frontiers, one frame of object memory and its comparison with depth."""
    return [*_visibility(), *_frontiers(), *_distances(), *_object_frame(), *_depth_evidence()]


# Occupancy


WALK = [(5.9 + 0.45 * (i % 40), 5.9 + 4.0 * (i // 20), turn * math.pi / 2) for i in range(60) for turn in range(4)]
"""`(x, z)` and headings of an agent that sees a part of the floor."""
AGENT_M, AGENT_CELL = (14.0, 9.9), (99, 140)


def floor() -> OccupancyGrid:
    """Rooms of 40 x 40 cells with a door in every wall and something in the way."""
    row, col = np.mgrid[:400, :400] % 40
    is_door = ((row >= 15) & (row < 23)) | ((col >= 15) & (col < 23))
    furniture = (row >= 25) & (row < 33) & (col >= 8) & (col < 13)
    return OccupancyGrid((((row < 2) | (col < 2)) & ~is_door | furniture).astype(np.uint8), 0.1, (0.0, 0.0))


def _place(x_m: float, z_m: float, yaw_rad: float) -> Pose:
    return Pose(x_m, 0.0, z_m, yaw_rad)


def _visibility() -> list[Row]:
    grid, rng = floor(), np.random.default_rng(0)
    poses = [_place(*rng.uniform(8, 30, 2), yaw) for yaw in rng.uniform(0, 6, 200)]
    bearings, ranges_m = np.linspace(-math.pi / 4, math.pi / 4, 300)[:, None], np.arange(0, 3, 0.05)[None]

    def sampled(number: int) -> object:
        pose = poses[number]
        heading = pose.yaw_rad + bearings
        col = ((pose.x_m + np.sin(heading) * ranges_m) / grid.cell_m).astype(np.int32)
        row = ((pose.z_m + np.cos(heading) * ranges_m) / grid.cell_m).astype(np.int32)
        is_hit = grid.cells[row, col] != 0
        is_reached = np.cumsum(is_hit, axis=1) - is_hit == 0
        seen = np.zeros(grid.cells.shape, np.bool_)
        seen[row[is_reached], col[is_reached]] = True
        return np.argwhere(seen & (grid.cells == 0)), np.argwhere(seen & (grid.cells != 0))

    def ours(number: int) -> VisibleOccupancy:
        return visible_occupancy(grid, poses[number], _INTRINSICS, 3.0)

    return compare("visible cells of a view", ours, {"NumPy, 300 sampled rays": sampled}, [MADE] * len(poses), calls=20)


def explored_floor() -> OccupancyMap:
    """A part of the floor as an agent that walked through it knows it."""
    grid = floor()
    seen = OccupancyMap(MapFrame(400, 400, grid.cell_m, grid.corner_m))
    for x_m, z_m, yaw_rad in WALK:
        seen.integrate(visible_occupancy(grid, _place(x_m, z_m, yaw_rad), _INTRINSICS, 3.0), (x_m, z_m))
    return seen


def _frontiers() -> list[Row]:
    seen = explored_floor()
    free, unexplored = (seen.cells == 1).astype(np.uint8), (~seen.explored).astype(np.uint8)

    def ours(_: int) -> object:
        seen.clear_frontiers()
        return seen.update_frontiers(AGENT_M)

    def peer(_: int) -> list[frozenset[tuple[int, int]]]:
        return frontiers_opencv(free, unexplored, AGENT_CELL)

    regions = frontiers_opencv(free, unexplored, AGENT_CELL, cells=True)
    found = {tuple(cell) for frontier in seen.update_frontiers(AGENT_M) for cell in frontier.cells.tolist()}
    if {cell for region in regions for cell in region} != found:
        raise AssertionError("the peer found other frontiers")
    return compare("frontiers, 400x400", ours, {"OpenCV, regions only": peer}, [MADE] * 200)


_NEIGHBOURS = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], np.float32)


def frontiers_opencv(
    free: NDArray[np.uint8], unexplored: NDArray[np.uint8], agent: tuple[int, int], *, cells: bool = False
) -> list[frozenset[tuple[int, int]]]:
    """The regions' cells; none where `cells` is false, which leaves their lists out of the time."""
    _, labels = cv2.connectedComponents(free, connectivity=4)
    island = labels == labels[agent]
    num_unexplored = cv2.filter2D(unexplored, cv2.CV_8U, _NEIGHBOURS, borderType=cv2.BORDER_CONSTANT)
    inner = (island & (num_unexplored == 8)).astype(np.uint8)
    edges = island & (num_unexplored >= 4) & (num_unexplored <= 6)
    count, regions, statistics, _ = cv2.connectedComponentsWithStats(inner, connectivity=4)
    large = [i for i in range(1, count) if statistics[i, cv2.CC_STAT_AREA] >= 20] if edges.any() else []
    return [frozenset(map(tuple, np.argwhere(regions == i).tolist())) for i in large] if cells else []


def _distances() -> list[Row]:
    seen = explored_floor()
    targets_m = np.array([frontier.position_m for frontier in seen.update_frontiers(AGENT_M)])
    is_free, cell_m = seen.cells == 1, seen.map_frame.cell_m
    cells = np.floor(targets_m / cell_m).astype(np.int64)[:, ::-1]

    def ours(_: int) -> NDArray[np.float64]:
        return seen.distances_m(AGENT_M, targets_m)

    def peer(_: int) -> NDArray[np.float64]:
        return _distances_scipy(is_free, AGENT_CELL, cells) * cell_m

    if len(targets_m) < 5 or not np.allclose(ours(0), peer(0), rtol=0.1):
        raise AssertionError("the peer found other distances")
    return compare("distances to frontiers, 400x400", ours, {"SciPy, Dijkstra on 8-connected cells": peer}, [MADE] * 40)


def _distances_scipy(
    is_free: NDArray[np.bool_], start: tuple[int, int], ends: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Distances in cells."""
    number = np.full(is_free.shape, -1, np.int32)
    number[is_free] = np.arange(is_free.sum())
    sides, others, lengths = [], [], []
    for d_row, d_col in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = number[: number.shape[0] - d_row, max(0, -d_col) : number.shape[1] - max(0, d_col)]
        there = number[d_row:, max(0, d_col) : number.shape[1] + min(0, d_col)]
        is_edge = (here >= 0) & (there >= 0)
        sides.append(here[is_edge])
        others.append(there[is_edge])
        lengths.append(np.full(is_edge.sum(), math.hypot(d_row, d_col)))
    edges = (np.concatenate(lengths), (np.concatenate(sides), np.concatenate(others)))
    graph = csr_matrix(edges, shape=(is_free.sum(), is_free.sum()))
    return dijkstra(graph, directed=False, indices=number[start])[number[ends[:, 0], ends[:, 1]]]


# Objects


def _boxes() -> NDArray[np.float64]:
    """`(100, 3)` middles of boxes on a floor, ten a row."""
    i = np.arange(100)
    return np.stack([i % 10 * 0.8, 0.2 + 0.05 * (i % 7), i // 10 * 0.8], axis=1)


def _image_axes(pose: Pose) -> NDArray[np.float64]:
    """Rows: right, down, forward."""
    return camera_axes(pose) * [[1.0], [-1.0], [1.0]]


def _look(boxes: NDArray[np.float64], x_m: float, height_m: float, z_m: float, yaw_rad: float, tilt_rad: float) -> View:
    """Depth and masks of boxes, ray by ray; masks count in their order."""
    pose = Pose(x_m, height_m, z_m, yaw_rad, tilt_rad)
    uv = (np.arange(SIDE_PX) + 0.5 - SIDE_PX / 2) / _INTRINSICS.focal_px
    local = np.stack([*np.meshgrid(uv, uv), np.ones((SIDE_PX, SIDE_PX))], axis=-1)
    rays = local @ _image_axes(pose)
    depth_m = np.full((SIDE_PX, SIDE_PX), np.inf, np.float32)
    masks = np.full((SIDE_PX, SIDE_PX), -1, np.int32)
    for index, box in enumerate(boxes):
        middle = box - (x_m, height_m, z_m)
        sides = np.stack([(middle - BOX_M / 2) / rays, (middle + BOX_M / 2) / rays])
        enter, leave = sides.min(0).max(-1), sides.max(0).min(-1)
        is_hit = (enter < leave) & (enter > 0) & (enter < depth_m)
        depth_m[is_hit], masks[is_hit] = enter[is_hit], index
    return _view(pose, depth_m, masks, len(boxes))


def _view(pose: Pose, depth_m: NDArray[np.float32], masks: NDArray[np.int32], num: int) -> View:
    nothing = np.zeros((0, 2), np.int32)
    found = Detections(masks, ("Box",) * num, np.ones(num, np.float32))
    occupancy = VisibleOccupancy(nothing, nothing)
    return View(pose, _INTRINSICS, depth_m, found, occupancy)


def looks_at_boxes() -> list[View]:
    """Every box from four sides and above."""
    looks = []
    for box in _boxes():
        x, y, z = box.tolist()
        for turn, (dx, dz) in enumerate([(0, -0.9), (-0.9, 0), (0, 0.9), (0.9, 0)]):
            looks.append(_look(box[None], x + dx, y + 0.7, z + dz, turn * math.pi / 2, 0.7))
    return looks


def full_map(looks: list[View]) -> ObjectMap:
    """A map of these."""
    entries = ObjectMap(ObjectMapConfig(max_distance_m=10.0, views_per_cleanup=0))
    for look in looks:
        entries.update(look)
    return entries


def frame() -> View:
    """The twenty boxes that show most of themselves."""
    view = _look(_boxes(), 3.4, 1.9, 1.2, 0.2, 0.6)
    areas = np.bincount(view.detections.masks[view.detections.masks >= 0], minlength=100)
    number_of = np.full(101, -1, np.int32)
    number_of[np.argsort(-areas, kind="stable")[:20]] = np.arange(20)
    return _view(view.pose, view.depth_m, number_of[view.detections.masks], 20)


def clouds_of(entries: ObjectMap) -> list[Cloud]:
    """The entries of a map as the peer keeps them."""
    stored = []
    for entry in entries.entries:
        points = entries.points_m(entry.id)
        assert points is not None
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(np.float64)))
        stored.append(Cloud(cloud, entry.label, box=cloud.get_oriented_bounding_box(robust=True)))
    return stored


def associate_open3d(stored: list[Cloud], view: View, config: ObjectMapConfig) -> list[int | None]:
    """Entry of each detection, `None` for a new one; entries are not changed, merged ones are made and dropped."""
    found = detect(view, config)
    matches = associate(stored, found, config)
    for match, detection in zip(matches, found, strict=True):
        if match is not None and detection is not None:
            merged(stored[match], detection, config)
    return matches


def _object_frame() -> list[Row]:
    view, looks, num = frame(), looks_at_boxes(), 7
    maps = [full_map(looks) for _ in range(num)]
    first, config = maps[0], maps[0].config
    stored = clouds_of(first)
    theirs = [None if i is None else first.entries[i].id for i in associate_open3d(stored, view, config)]
    if list(full_map(looks).update(view).entry_ids) != theirs or len(first) != 100:
        raise AssertionError("the peer associates otherwise")

    def ours(number: int) -> object:
        return maps[number].update(view)

    def peer(_: int) -> object:
        return associate_open3d(stored, view, config)

    faiss.omp_set_num_threads(1)
    return compare("object memory, 20 masks, 100 entries", ours, {"Open3D + faiss": peer}, [MADE] * num)


def _depth_evidence() -> list[Row]:
    view, entries = frame(), full_map(looks_at_boxes())
    ids = [entry.id for entry in entries.entries]
    clouds = [cloud for entry_id in ids if (cloud := entries.points_m(entry_id)) is not None]

    def ours(_: int) -> list[DepthEvidence]:
        return entries.depth_evidence(ids, view)

    def peer(_: int) -> NDArray[np.int64]:
        return _depth_evidence_numpy(clouds, view)

    found = [[e.num_see_through, e.num_supported, e.num_occluded, e.num_out_of_view] for e in ours(0)]
    if found != peer(0).tolist():
        raise AssertionError("the peer counts otherwise")
    return compare("depth evidence, 100 entries", ours, {"NumPy, all points at once": peer}, [MADE] * 100, calls=5)


def _depth_evidence_numpy(clouds: list[NDArray[np.float32]], view: View) -> NDArray[np.int64]:
    """`(E, 4)` counts for 256 points of each cloud: seen through, supported, occluded, out of view."""
    points = np.stack([cloud[np.arange(256) * len(cloud) // 256] for cloud in clouds])
    x, y, z = np.moveaxis((points.astype(np.float64) - view.pose.position_m) @ _image_axes(view.pose).T, -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = (SIDE_PX / 2 + _INTRINSICS.focal_px / z * offset for offset in (x, y))
    is_inside = (z > 0) & (u >= 0) & (u < SIDE_PX) & (v >= 0) & (v < SIDE_PX)
    row, col = (np.where(is_inside, at, 0).astype(np.int64) for at in (v, u))
    depth_m = view.depth_m[row, col].astype(np.float64)
    is_known = is_inside & (depth_m > 0) & np.isfinite(depth_m)
    band_m = np.maximum(0.1, 0.02 * z)
    is_through, is_occluded = is_known & (depth_m > z + band_m), is_known & (depth_m < z - band_m)
    kinds = (is_through, is_known & ~is_through & ~is_occluded, is_occluded, ~is_known)
    return np.stack([kind.sum(axis=1) for kind in kinds], axis=1)
