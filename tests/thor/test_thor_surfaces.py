"""Rays and boxes among triangles against slow, plain twins."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from evonav.thor.objects import rotation_of
from evonav.thor.surfaces import Surfaces

seeds = st.integers(0, 2**32 - 1)


def triangles(rng: np.random.Generator, count: int) -> np.ndarray:
    return rng.uniform(-1.0, 1.0, (count, 1, 3)) + rng.uniform(-0.6, 0.6, (count, 3, 3))


def points_on(triangle: np.ndarray, side: int) -> np.ndarray:
    """A grid of points of a triangle, its corners among them."""
    u, v = (grid.ravel() / side for grid in np.meshgrid(np.arange(side + 1), np.arange(side + 1)))
    u, v = u[u + v <= 1], v[u + v <= 1]
    return triangle[0] + u[:, None] * (triangle[1] - triangle[0]) + v[:, None] * (triangle[2] - triangle[0])


@given(seeds)
def test_a_box_holds_bodies_that_have_points_in_it(seed: int) -> None:
    """Bracketed: what has a point inside is found, what is found has a point inside the box grown by a grid step."""
    rng = np.random.default_rng(seed)
    corners_m = triangles(rng, 12)
    surfaces = Surfaces(corners_m, np.arange(12, dtype=np.int32))
    centre_m, half_m = rng.uniform(-0.7, 0.7, 3), rng.uniform(0.05, 0.6, 3)
    axes = rotation_of({axis: float(rng.uniform(0, 360)) for axis in "xyz"})
    found = set(surfaces.bodies_in_box(centre_m, half_m, axes))
    for body, triangle in enumerate(corners_m):
        own_m = np.abs((points_on(triangle, 60) - centre_m) @ axes)
        step_m = max(float(np.linalg.norm(triangle[i] - triangle[i - 1])) for i in range(3)) / 60
        if (own_m < half_m).all(axis=1).any():
            assert body in found
        if body in found:
            assert (own_m <= half_m + step_m).all(axis=1).any()


@given(seeds)
def test_a_ray_ends_at_the_nearest_front(seed: int) -> None:
    """Against the triple products of Moeller and Trumbore, a triangle at a time."""
    rng = np.random.default_rng(seed)
    corners_m = triangles(rng, 20)
    surfaces = Surfaces(corners_m, np.arange(20, dtype=np.int32))
    origin_m, direction = rng.uniform(-2, 2, 3), rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    nearest = (math.inf, -1)
    for body, (a, b, c) in enumerate(corners_m):
        volume = float(np.dot(np.cross(direction, c - a), b - a))
        u = float(np.dot(np.cross(direction, c - a), origin_m - a)) / volume
        v = float(np.dot(np.cross(origin_m - a, b - a), direction)) / volume
        range_m = float(np.dot(np.cross(origin_m - a, b - a), c - a)) / volume
        is_front = float(np.dot(np.cross(b - a, c - a), direction)) < 0
        if is_front and u >= 0 and v >= 0 and u + v <= 1 and range_m > 0:
            nearest = min(nearest, (range_m, body))
    hit = surfaces.cast(tuple(origin_m.tolist()), tuple(direction.tolist()))
    assert (hit is None) == (nearest[1] < 0)
    if hit is not None:
        assert hit.body == nearest[1]
        assert math.isclose(hit.distance_m, nearest[0], abs_tol=1e-9)


@given(seeds)
def test_the_height_under_a_point_is_where_a_ray_from_there_ends(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners_m = triangles(rng, 20) + np.array([0.0, 2.0, 0.0])
    surfaces = Surfaces(corners_m, np.arange(20, dtype=np.int32))
    x_m, z_m = rng.uniform(-0.8, 0.8, 2).tolist()
    top_m = float(rng.uniform(0.5, 4.0))
    hit = surfaces.cast((x_m, top_m, z_m), (0.0, -1.0, 0.0))
    height_m = surfaces.height_under_m(np.array([[x_m, z_m]]), top_m)
    assert math.isclose(height_m, max(hit.point_m[1], 0.0) if hit else 0.0, abs_tol=1e-9)
    if hit is not None:
        lower_m = surfaces.height_under_m(np.array([[x_m, z_m]]), top_m, ignored=hit.body)
        assert lower_m <= height_m
        assert math.isclose(lower_m, surfaces.without({hit.body}).height_under_m(np.array([[x_m, z_m]]), top_m))
