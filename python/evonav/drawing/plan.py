"""Describe a house from above: rooms, walls, openings and the exact outlines of objects.

Drawings take anything with these attributes: a house's own `HousePlan`, and the floor plans in the records of runs.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from evonav._core import House, Wall, object_outlines
from evonav._core import Opening as HouseOpening

Point2 = tuple[float, float]
"""`(x, z)` in metres."""
Point3 = tuple[float, float, float]
"""`(x, y, z)` in metres."""
OpeningKind = Literal["door", "window"]


class RoomPlan(Protocol):
    """A room's floor."""

    @property
    def room_type(self) -> str: ...  # noqa: D102
    @property
    def polygon_m(self) -> Sequence[Point2]: ...  # noqa: D102


class ObjectPlan(Protocol):
    """An object seen from above; `outlines_m`, if there are any, are drawn instead of `polygon_m`."""

    @property
    def object_id(self) -> str: ...  # noqa: D102
    @property
    def category(self) -> str: ...  # noqa: D102
    @property
    def centre_m(self) -> Point3: ...  # noqa: D102
    @property
    def size_m(self) -> Point3: ...  # noqa: D102
    @property
    def polygon_m(self) -> Sequence[Point2]: ...  # noqa: D102
    @property
    def outlines_m(self) -> Sequence[Sequence[Point2]]: ...  # noqa: D102


class OpeningPlan(Protocol):
    """A door or window from above."""

    @property
    def kind(self) -> OpeningKind: ...  # noqa: D102
    @property
    def from_m(self) -> Point2: ...  # noqa: D102
    @property
    def to_m(self) -> Point2: ...  # noqa: D102


class Plan(Protocol):
    """A house from above."""

    @property
    def rooms(self) -> Sequence[RoomPlan]: ...  # noqa: D102
    @property
    def walls(self) -> Sequence[tuple[Point2, Point2]]: ...  # noqa: D102
    @property
    def openings(self) -> Sequence[OpeningPlan]: ...  # noqa: D102
    @property
    def objects(self) -> Sequence[ObjectPlan]: ...  # noqa: D102


@dataclass(frozen=True, slots=True)
class HouseRoom:
    """A room's floor."""

    room_id: str
    room_type: str
    polygon_m: Sequence[Point2]


@dataclass(frozen=True, slots=True)
class HouseFootprint:
    """An object seen from above."""

    object_id: str
    category: str
    centre_m: Point3
    size_m: Point3
    """Size of the axis-aligned box."""
    polygon_m: Sequence[Point2]
    """Corners of the object's box, to the millimetre."""
    outlines_m: Sequence[Sequence[Point2]]
    """Convex outlines of its parts to the millimetre, each once, lower ones first."""


@dataclass(frozen=True, slots=True)
class HouseHole:
    """A door or window from above."""

    kind: OpeningKind
    from_m: Point2
    to_m: Point2


@dataclass(frozen=True, slots=True)
class HousePlan:
    """A house from above."""

    rooms: tuple[HouseRoom, ...]
    walls: tuple[tuple[Point2, Point2], ...]
    """Wall segments, each once; open-plan ones left out."""
    openings: tuple[HouseHole, ...]
    objects: tuple[HouseFootprint, ...]


def plan_of(house: House) -> HousePlan:
    """Return the floor plan of a house.

    Raises:
        HouseError: An object has neither a known asset nor a known category.
    """
    walls = {wall.id: wall for wall in house.walls}
    return HousePlan(
        rooms=tuple(HouseRoom(room.id, room.room_type, room.polygon_m) for room in house.rooms),
        # Every wall has two sides at the same place: one is enough for a picture.
        walls=tuple(sorted({(min(w.from_m, w.to_m), max(w.from_m, w.to_m)) for w in walls.values() if not w.is_empty})),
        openings=tuple(
            _hole(kind, hole, walls[hole.wall_ids[0]])
            for kind, holes in _openings(house)
            for hole in holes
            if hole.wall_ids[0] in walls
        ),
        objects=tuple(HouseFootprint(*values) for values in object_outlines(house)),
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


def _hole(kind: OpeningKind, hole: HouseOpening, wall: Wall) -> HouseHole:
    """Return the two sides of a door or window; its hole is in the wall's frame."""
    (x0, z0), (x1, z1) = wall.from_m, wall.to_m
    length_m = math.hypot(x1 - x0, z1 - z0) or 1.0
    near, far = (
        (x0 + (x1 - x0) * along_m / length_m, z0 + (z1 - z0) * along_m / length_m)
        for along_m in (hole.hole_min_m[0], hole.hole_max_m[0])
    )
    return HouseHole(kind, near, far)
