"""A task's houses from above, and its oracle's part of them, as records: what runs keep and pictures show."""

import math
from base64 import b64encode
from collections.abc import Iterator, Sequence
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evonav.evaluation.records.schema import (
    FloorPlan,
    ObjectFootprint,
    Opening,
    OpeningKind,
    Point2,
    Relocation,
    RoomFootprint,
    TargetRecord,
    TransitionRecord,
)
from evonav.house import House, Wall
from evonav.house import Opening as HouseOpening
from evonav.tasks import Task
from evonav.tasks.oracle import OracleStage


def house_map(
    house: House, *, task_id: str, stage: int, objects: Sequence[ObjectFootprint], reference_image: str | None
) -> FloorPlan:
    """A house from above.

    Args:
        house: Its rooms, walls and openings are taken.
        task_id: Recorded.
        stage: Recorded.
        objects: What stands in it.
        reference_image: As a `data:` URI.
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
        objects=tuple(objects),
        reference_image=reference_image,
    )


def true_footprints(house: House) -> tuple[ObjectFootprint, ...]:
    """Objects in their true shapes, part by part; of an unknown asset, those of its category.

    Raises:
        HouseError: An object has neither a known asset nor a known category.
    """
    return tuple(
        _true_footprint(object_id, category, parts)
        for object_id, category, parts in house.footprints(allow_unknown_assets=True)
        if parts
    )


def door_ends(house: House) -> dict[str, tuple[Point2, Point2]]:
    """Both sides of every door, by its id."""
    walls = {wall.id: wall for wall in house.walls}
    doors = [door for door in house.doors if door.wall_ids[0] in walls]
    ends = {door.id: _opening("door", door, walls[door.wall_ids[0]]) for door in doors}
    return {name: (door.from_m, door.to_m) for name, door in ends.items()}


def image_uri(image: NDArray[np.uint8], side_px: int) -> str:
    """An RGB image, made `side_px` high and wide, as a `data:` URI."""
    buffer = BytesIO()
    Image.fromarray(image).resize((side_px, side_px)).save(buffer, "WEBP", quality=70, method=0)
    return f"data:image/webp;base64,{b64encode(buffer.getvalue()).decode()}"


def target_record(task: Task, stage: int) -> TargetRecord:
    """The target of a stage."""
    target = task.oracle(stage).target
    first_move = next(
        (
            change.from_position_m
            for k in range(2, stage + 1)
            for change in task.oracle(k).evolution.changes
            if change.id == target.id and change.is_relocated
        ),
        None,
    )
    return TargetRecord(
        object_id=target.id,
        category=target.category,
        position_m=target.position_m,
        room_id=target.room_id,
        is_relocated=target.is_relocated_ever,
        is_relocated_now=target.is_relocated_now,
        first_position_m=first_move,
    )


def transition_record(oracle: OracleStage) -> TransitionRecord:
    """The change before a stage."""
    evolution = oracle.evolution
    is_evolved = evolution.outcome == "evolved"
    return TransitionRecord(
        mode=evolution.mode if is_evolved else None,
        room_id=evolution.room_id if is_evolved else None,
        num_added=len(evolution.additions),
        num_removed=len(evolution.removals),
        num_states=len(evolution.states),
        relocations=tuple(
            Relocation(
                object_id=change.id,
                category=change.category,
                from_m=change.from_position_m,
                to_m=change.to_position_m,
            )
            for change in evolution.changes
            if change.is_relocated
        ),
    )


def _openings(house: House) -> Iterator[tuple[OpeningKind, list[HouseOpening]]]:
    yield "door", house.doors
    yield "window", house.windows


def _opening(kind: OpeningKind, hole: HouseOpening, wall: Wall) -> Opening:
    """The two sides of a door or window; its hole is in the wall's frame."""
    (x0, z0), (x1, z1) = wall.from_m, wall.to_m
    length_m = math.hypot(x1 - x0, z1 - z0) or 1.0
    near, far = (
        (x0 + (x1 - x0) * along_m / length_m, z0 + (z1 - z0) * along_m / length_m)
        for along_m in (hole.hole_min_m[0], hole.hole_max_m[0])
    )
    return Opening(kind=kind, from_m=near, to_m=far)


def _true_footprint(
    object_id: str, category: str, parts: Sequence[tuple[Sequence[Point2], float, float]]
) -> ObjectFootprint:
    points = [point for outline, _, _ in parts for point in outline]
    low = (min(x for x, _ in points), min(low_m for _, low_m, _ in parts), min(z for _, z in points))
    high = (max(x for x, _ in points), max(high_m for _, _, high_m in parts), max(z for _, z in points))
    x0, y0, z0 = low
    x1, y1, z1 = high
    return ObjectFootprint(
        object_id=object_id,
        category=category,
        centre_m=((x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2),
        size_m=(x1 - x0, y1 - y0, z1 - z0),
        polygon_m=((x0, z0), (x1, z0), (x1, z1), (x0, z1)),
        outlines_m=tuple(tuple(outline) for outline, _, _ in sorted(parts, key=lambda part: part[2])),
    )
