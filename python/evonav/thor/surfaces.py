"""What rays hit and what boxes overlap in a scene, for actions that ask now and then."""

from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from evonav.thor.scene import Scene

_F64 = NDArray[np.float64]
_Vec3 = tuple[float, float, float]


class Hit(NamedTuple):
    """Where a ray ends."""

    point_m: _Vec3
    distance_m: float
    body: int
    """Index of what it hit in `simulator.objects`."""


class Surfaces:
    """All triangles of a scene; plain NumPy over all of them, some tenths of a millisecond a ray."""

    def __init__(self, corners_m: _F64, bodies: NDArray[np.int32]) -> None:
        """Takes `(N, 3, 3)` corners, clockwise seen from outside, and `(N,)` indices of bodies."""
        self.corners_m, self.bodies = corners_m, bodies
        self._edges_m = corners_m[:, 1:] - corners_m[:, :1]
        self._normals = np.cross(self._edges_m[:, 0], self._edges_m[:, 1])

    def cast(self, origin_m: _Vec3, direction: _Vec3) -> Hit | None:
        """What a ray hits first, from outside, as Unity's rays do.

        Args:
            origin_m: Where it starts.
            direction: Where it goes; of any length but zero.
        """
        origin, towards = np.array(origin_m), np.array(direction) / np.linalg.norm(direction)
        facing = np.flatnonzero(self._normals @ towards < 0)
        starts_m, normals = self.corners_m[facing, 0], self._normals[facing]
        ranges_m = np.einsum("ij,ij->i", normals, starts_m - origin) / (normals @ towards)
        points_m = origin + ranges_m[:, None] * towards
        is_hit = (ranges_m > 0) & self._holds(facing, points_m)
        if not is_hit.any():
            return None
        first = int(np.argmin(np.where(is_hit, ranges_m, np.inf)))
        x_m, y_m, z_m = points_m[first].tolist()
        return Hit((x_m, y_m, z_m), float(ranges_m[first]), int(self.bodies[facing[first]]))

    def height_under_m(self, points_m: _F64, top_m: float, ignored: int | None = None) -> float:
        """Height of the highest surface at or below a height, over some points of the ground plane.

        Args:
            points_m: `(K, 2)`, `(x, z)`.
            top_m: What is higher does not count.
            ignored: Index of a body that does not count.

        Returns:
            Metres; 0, the floor's, where nothing is under.
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
            heights_m = heights_m[(heights_m <= top_m) & self._holds(indices, points)]
            highest_m = max(highest_m, float(heights_m.max(initial=0.0)))
        return highest_m

    def bodies_in_box(self, centre_m: _F64, half_m: _F64, axes: _F64) -> list[int]:
        """Indices of bodies of which some surface is in a box.

        Args:
            centre_m: Of the box.
            half_m: Half its edges.
            axes: `(3, 3)`, its own axes as columns.
        """
        reach_m = np.abs(axes) @ half_m
        low, high = self.corners_m.min(axis=1), self.corners_m.max(axis=1)
        near = np.flatnonzero(((high > centre_m - reach_m) & (low < centre_m + reach_m)).all(axis=1))
        own_m = (self.corners_m[near] - centre_m) @ axes
        edges_m = np.roll(own_m, -1, axis=1) - own_m
        # Separating axes: the box's own, the triangle's normal, and the cross products of all their edges.
        crossed = np.cross(edges_m[:, :, None, :], np.eye(3)[None, None]).reshape(len(near), 9, 3)
        normals = np.cross(edges_m[:, 0], edges_m[:, 1])[:, None]
        tried = np.concatenate([np.broadcast_to(np.eye(3), (len(near), 3, 3)), normals, crossed], axis=1)
        spans = np.einsum("nak,nck->nac", tried, own_m)
        radii = np.abs(tried) @ half_m
        is_apart = (spans.min(axis=2) >= radii) | (spans.max(axis=2) <= -radii)
        # An edge along an axis of the box gives no direction: everything projects to 0.
        is_apart &= np.abs(tried).sum(axis=2) > 1e-12
        return sorted(set(self.bodies[near[~is_apart.any(axis=1)]].tolist()))

    def without(self, bodies: set[int]) -> "Surfaces":
        """All surfaces but those of some bodies."""
        kept = ~np.isin(self.bodies, sorted(bodies))
        return Surfaces(self.corners_m[kept], self.bodies[kept])

    def lift(self, body: int, rise_m: float) -> None:
        """Moves a body up, here only."""
        self.corners_m[self.bodies == body, :, 1] += rise_m

    def _holds(self, indices: NDArray[np.int64], points_m: _F64) -> NDArray[np.bool_]:
        """Whether the triangles hold points of their planes, one each."""
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


_kept: WeakKeyDictionary[Scene, tuple[int, Surfaces]] = WeakKeyDictionary()


def surfaces_of(scene: Scene) -> Surfaces:
    """The surfaces of a scene as it now is; do not `lift` in these."""
    kept = _kept.get(scene)
    if kept is None or kept[0] != scene.version:
        kept = _kept[scene] = (scene.version, fresh_surfaces(scene))
    return kept[1]


def fresh_surfaces(scene: Scene) -> Surfaces:
    """The surfaces of a scene, for the caller alone."""
    corners_m, bodies, _ = scene.simulator.triangles()
    return Surfaces(np.array(corners_m, dtype=np.float64), bodies)
