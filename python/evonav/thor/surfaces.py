"""Cast rays and test boxes against a scene, for actions that do so rarely."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evonav.thor.geometry import Vec3
from evonav.thor.scene import Scene

_F64 = NDArray[np.float64]


class Hit(NamedTuple):
    """The end of a ray."""

    point_m: Vec3
    distance_m: float
    body: int
    """Index of the hit body in `simulator.objects`."""


class Surfaces:
    """All triangles of a scene. Plain NumPy tests all of them, in some tenths of a millisecond for a ray."""

    def __init__(self, corners_m: _F64, bodies: NDArray[np.int32]) -> None:
        """Take `(N, 3, 3)` corners, clockwise seen from outside, and `(N,)` indices of bodies."""
        self.corners_m, self.bodies = corners_m, bodies
        self._edges_m = corners_m[:, 1:] - corners_m[:, :1]
        self._normals = np.cross(self._edges_m[:, 0], self._edges_m[:, 1])

    def cast(self, origin_m: Vec3, direction: Vec3) -> Hit | None:
        """Return what a ray hits first. It hits surfaces from outside only, as Unity's rays do.

        Args:
            origin_m: Start of the ray.
            direction: Direction of the ray, of any length except zero.
        """
        origin, towards = np.array(origin_m), np.array(direction) / np.linalg.norm(direction)
        facing = np.flatnonzero(self._normals @ towards < 0)
        starts_m, normals = self.corners_m[facing, 0], self._normals[facing]
        ranges_m = np.einsum("ij,ij->i", normals, starts_m - origin) / (normals @ towards)
        points_m = origin + ranges_m[:, None] * towards
        is_hit = (ranges_m > 0) & self._contains(facing, points_m)
        if not is_hit.any():
            return None
        first = int(np.argmin(np.where(is_hit, ranges_m, np.inf)))
        x_m, y_m, z_m = points_m[first].tolist()
        return Hit((x_m, y_m, z_m), float(ranges_m[first]), int(self.bodies[facing[first]]))

    def height_under_m(self, points_m: _F64, top_m: float, ignored: int | None = None) -> float:
        """Return the height of the highest surface at or below a height, over some points of the ground plane.

        Args:
            points_m: `(K, 2)` points, `(x, z)`.
            top_m: Surfaces above this height do not count.
            ignored: Index of a body that does not count.

        Returns:
            Metres; 0, the floor's height, where no surface is below.
        """
        low, high = points_m.min(axis=0), points_m.max(axis=0)
        flat = self.corners_m[:, :, (0, 2)]
        near = (flat.max(axis=1) >= low).all(axis=1) & (flat.min(axis=1) <= high).all(axis=1)
        near &= (self._normals[:, 1] > 0) & (self.corners_m[:, :, 1].min(axis=1) <= top_m)
        if ignored is not None:
            near &= self.bodies != ignored
        indices = np.flatnonzero(near)
        highest_m = 0.0
        for x_m, z_m in points_m.tolist():
            normals, starts_m = self._normals[indices], self.corners_m[indices, 0]
            rises_m = normals[:, 0] * (x_m - starts_m[:, 0]) + normals[:, 2] * (z_m - starts_m[:, 2])
            heights_m = starts_m[:, 1] - rises_m / normals[:, 1]
            points = np.column_stack([np.full_like(heights_m, x_m), heights_m, np.full_like(heights_m, z_m)])
            heights_m = heights_m[(heights_m <= top_m) & self._contains(indices, points)]
            highest_m = max(highest_m, float(heights_m.max(initial=0.0)))
        return highest_m

    def bodies_in_box(self, centre_m: _F64, half_m: _F64, axes: _F64) -> list[int]:
        """Return the indices of the bodies that have some surface in a box.

        Args:
            axes: The box's own axes as columns, `(3, 3)`.
        """
        reach_m = np.abs(axes) @ half_m
        low, high = self.corners_m.min(axis=1), self.corners_m.max(axis=1)
        near = np.flatnonzero(((high > centre_m - reach_m) & (low < centre_m + reach_m)).all(axis=1))
        own_m = (self.corners_m[near] - centre_m) @ axes
        edges_m = np.roll(own_m, -1, axis=1) - own_m
        # Separating axes: the box's own, the triangle's normal, and the cross products of all edges of both.
        crossed = np.cross(edges_m[:, :, None, :], np.eye(3)[None, None]).reshape(len(near), 9, 3)
        normals = np.cross(edges_m[:, 0], edges_m[:, 1])[:, None]
        tried = np.concatenate([np.broadcast_to(np.eye(3), (len(near), 3, 3)), normals, crossed], axis=1)
        spans = np.einsum("nak,nck->nac", tried, own_m)
        radii = np.abs(tried) @ half_m
        is_apart = (spans.min(axis=2) >= radii) | (spans.max(axis=2) <= -radii)
        # A triangle's edge along an axis of the box gives no direction: everything projects to 0.
        is_apart &= np.abs(tried).sum(axis=2) > 1e-12
        return sorted(set(self.bodies[near[~is_apart.any(axis=1)]].tolist()))

    def without(self, bodies: set[int]) -> "Surfaces":
        """Return all surfaces except those of some bodies."""
        remaining = ~np.isin(self.bodies, sorted(bodies))
        return Surfaces(self.corners_m[remaining], self.bodies[remaining])

    def lift(self, body: int, rise_m: float) -> None:
        """Move a body up, in these surfaces only."""
        self.corners_m[self.bodies == body, :, 1] += rise_m

    def _contains(self, indices: NDArray[np.int64], points_m: _F64) -> NDArray[np.bool_]:
        """Return which triangles contain a point of their planes, one point each."""
        first, second = self._edges_m[indices, 0], self._edges_m[indices, 1]
        offset = points_m - self.corners_m[indices, 0]
        dots = [np.einsum("ij,ij->i", a, b) for a, b in ((first, first), (first, second), (second, second))]
        along, across = (np.einsum("ij,ij->i", offset, edge) for edge in (first, second))
        area = dots[0] * dots[2] - dots[1] ** 2
        with np.errstate(divide="ignore", invalid="ignore"):
            u = (dots[2] * along - dots[1] * across) / area
            v = (dots[0] * across - dots[1] * along) / area
            inside: NDArray[np.bool_] = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
        return inside


def surfaces_of(scene: Scene) -> Surfaces:
    """Return the surfaces of a scene in its present version. They are shared: do not `lift` in them."""
    return scene.derived(fresh_surfaces)


def fresh_surfaces(scene: Scene) -> Surfaces:
    """Return the surfaces of a scene, for the caller alone."""
    corners_m, bodies, _ = scene.simulator.triangles()
    return Surfaces(np.array(corners_m, dtype=np.float64), bodies)
