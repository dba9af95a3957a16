"""Describe a house from above: rooms, walls, openings and the exact outlines of objects.

Drawings take a house's own `HousePlan`, and the floor plans in the records of runs, which are `HousePlan`s, too.
"""

import math
from collections.abc import Iterator
from typing import Literal

from evonav._core import House, Wall, object_outlines
from evonav._core import Opening as HouseOpening
from evonav.points import Point2, Point3
from evonav.records import Record

OpeningKind = Literal["door", "window"]


class RoomFootprint(Record, strict=False):
    """A room's floor."""

    room_id: str
    room_type: str
    polygon_m: tuple[Point2, ...]


class ObjectFootprint(Record, strict=False):
    """An object seen from above."""

    object_id: str
    category: str
    centre_m: Point3
    size_m: Point3
    """Size of the axis-aligned box."""
    polygon_m: tuple[Point2, ...]
    """Corners of the object's box, to the millimetre."""
    outlines_m: tuple[tuple[Point2, ...], ...] = ()
    """Convex outlines of its parts to the millimetre, each once, lower ones first; drawn instead of `polygon_m`."""


class OpeningFootprint(Record):
    """A door, doorway or window from above."""

    kind: OpeningKind
    from_m: Point2
    to_m: Point2


class HousePlan(Record):
    """A house from above."""

    rooms: tuple[RoomFootprint, ...]
    walls: tuple[tuple[Point2, Point2], ...]
    """Wall segments, each once; open-plan ones left out."""
    openings: tuple[OpeningFootprint, ...]
    objects: tuple[ObjectFootprint, ...]


def plan_of(house: House) -> HousePlan:
    """Return the floor plan of a house.

    Raises:
        HouseError: An object has neither a known asset nor a known category.
    """
    walls = {wall.id: wall for wall in house.walls}
    return HousePlan(
        rooms=tuple(
            RoomFootprint(room_id=room.id, room_type=room.room_type, polygon_m=tuple(room.polygon_m))
            for room in house.rooms
        ),
        # Every wall has two sides at the same place: one is enough for a picture.
        walls=tuple(sorted({(min(w.from_m, w.to_m), max(w.from_m, w.to_m)) for w in walls.values() if not w.is_empty})),
        openings=tuple(
            _hole(kind, hole, walls[hole.wall_ids[0]])
            for kind, holes in _openings(house)
            for hole in holes
            if hole.wall_ids[0] in walls
        ),
        # The core's values need no check, which would take twice as long as all else.
        objects=tuple(
            ObjectFootprint.model_construct(
                object_id=object_id,
                category=category,
                centre_m=centre_m,
                size_m=size_m,
                polygon_m=tuple(polygon_m),
                outlines_m=tuple(map(tuple, outlines_m)),
            )
            for object_id, category, centre_m, size_m, polygon_m, outlines_m in object_outlines(house)
        ),
    )


def door_ends(house: House) -> dict[str, tuple[Point2, Point2]]:
    """Return both sides of every door, by its id."""
    walls = {wall.id: wall for wall in house.walls}
    doors = [door for door in house.doors if door.wall_ids[0] in walls]
    ends = {door.id: _hole("door", door, walls[door.wall_ids[0]]) for door in doors}
    return {name: (door.from_m, door.to_m) for name, door in ends.items()}


def _openings(house: House) -> Iterator[tuple[OpeningKind, list[HouseOpening]]]:
    yield "door", house.doors
    yield "window", house.windows


def _hole(kind: OpeningKind, hole: HouseOpening, wall: Wall) -> OpeningFootprint:
    """Return the two sides of a door or window; its hole is in the wall's frame."""
    (x0, z0), (x1, z1) = wall.from_m, wall.to_m
    length_m = math.hypot(x1 - x0, z1 - z0) or 1.0
    near, far = (
        (x0 + (x1 - x0) * along_m / length_m, z0 + (z1 - z0) * along_m / length_m)
        for along_m in (hole.hole_min_m[0], hole.hole_max_m[0])
    )
    return OpeningFootprint(kind=kind, from_m=near, to_m=far)
