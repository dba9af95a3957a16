"""Draw up floor plans: rooms, walls, openings and exact footprints of a house, as records that maps are drawn from."""

import math
from base64 import b64encode
from collections.abc import Iterator, Sequence
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evonav.evaluation.records.schema import FloorPlan, ObjectFootprint, Opening, OpeningKind, Point2, RoomFootprint
from evonav.house import House, Wall
from evonav.house import Opening as HouseOpening

DIGITS = 3
"""Decimals of the outlines' coordinates: millimetres."""


def floor_plan_of(house: House, *, task_id: str, stage: int, reference_image: str | None) -> FloorPlan:
    """Return the floor plan of a house.

    Args:
        house: A house as it is in the stage.
        task_id: The task, for the record.
        stage: The stage, for the record.
        reference_image: The image that the agent was shown, as a `data:` URI.

    Raises:
        HouseError: An object has neither a known asset nor a known category.
    """
    walls = {wall.id: wall for wall in house.walls}
    return FloorPlan(
        task_id=task_id,
        house=house.name,
        stage=stage,
        rooms=tuple(
            RoomFootprint(room_id=room.id, room_type=room.room_type, polygon_m=tuple(room.polygon_m))
            for room in house.rooms
        ),
        # Every wall has two sides at the same place: one is enough for a picture.
        walls=tuple(sorted({(min(w.from_m, w.to_m), max(w.from_m, w.to_m)) for w in walls.values() if not w.is_empty})),
        openings=tuple(
            _opening(kind, hole, walls[hole.wall_ids[0]])
            for kind, holes in _openings(house)
            for hole in holes
            if hole.wall_ids[0] in walls
        ),
        objects=tuple(
            _footprint(object_id, category, parts)
            for object_id, category, parts in house.footprints(allow_unknown_assets=True)
            if parts
        ),
        reference_image=reference_image,
    )


def door_ends(house: House) -> dict[str, tuple[Point2, Point2]]:
    """Return both sides of every door, by its id."""
    walls = {wall.id: wall for wall in house.walls}
    doors = [door for door in house.doors if door.wall_ids[0] in walls]
    ends = {door.id: _opening("door", door, walls[door.wall_ids[0]]) for door in doors}
    return {name: (door.from_m, door.to_m) for name, door in ends.items()}


def image_uri(image: NDArray[np.uint8], side_px: int) -> str:
    """Return an RGB image, resized to a square of `side_px`, as a `data:` URI."""
    buffer = BytesIO()
    Image.fromarray(image).resize((side_px, side_px)).save(buffer, "WEBP", quality=70, method=0)
    return f"data:image/webp;base64,{b64encode(buffer.getvalue()).decode()}"


def _openings(house: House) -> Iterator[tuple[OpeningKind, list[HouseOpening]]]:
    yield "door", house.doors
    yield "window", house.windows


def _opening(kind: OpeningKind, hole: HouseOpening, wall: Wall) -> Opening:
    """Return the two sides of a door or window; its hole is in the wall's frame."""
    (x0, z0), (x1, z1) = wall.from_m, wall.to_m
    length_m = math.hypot(x1 - x0, z1 - z0) or 1.0
    near, far = (
        (x0 + (x1 - x0) * along_m / length_m, z0 + (z1 - z0) * along_m / length_m)
        for along_m in (hole.hole_min_m[0], hole.hole_max_m[0])
    )
    return Opening(kind=kind, from_m=near, to_m=far)


def _footprint(
    object_id: str, category: str, parts: Sequence[tuple[Sequence[Point2], float, float]]
) -> ObjectFootprint:
    """Return the outlines of an object's convex parts, each once, and their common box."""
    points = [point for outline, _, _ in parts for point in outline]
    x0, y0, z0 = (min(x for x, _ in points), min(low_m for _, low_m, _ in parts), min(z for _, z in points))
    x1, y1, z1 = (max(x for x, _ in points), max(high_m for _, _, high_m in parts), max(z for _, z in points))
    lower_first = sorted(parts, key=lambda part: part[2])
    return ObjectFootprint(
        object_id=object_id,
        category=category,
        centre_m=((x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2),
        size_m=(x1 - x0, y1 - y0, z1 - z0),
        polygon_m=_rounded([(x0, z0), (x1, z0), (x1, z1), (x0, z1)]),
        outlines_m=tuple(dict.fromkeys(_rounded(outline) for outline, _, _ in lower_first)),
    )


def _rounded(outline_m: Sequence[Point2]) -> tuple[Point2, ...]:
    return tuple((round(x, DIGITS), round(z, DIGITS)) for x, z in outline_m)
