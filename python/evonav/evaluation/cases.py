"""From a task on disk to what the evaluator runs and records."""

import math
from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evonav.evaluation.protocol import EpisodeCase, StageCase
from evonav.evaluation.records import (
    ObjectFootprint,
    Opening,
    OpeningKind,
    Point2,
    Relocation,
    RoomFootprint,
    StageMap,
    TargetRecord,
    TransitionRecord,
)
from evonav.house import House, Wall
from evonav.house import Opening as HouseOpening
from evonav.tasks import Task
from evonav.tasks.oracle import OracleStage
from evonav.world.simulator import SceneObject

THUMBNAIL_PX = 160


def episode_case(task: Task) -> EpisodeCase:
    """A task as the evaluator runs it.

    Raises:
        TaskError: A stage house is malformed.
    """
    numbers = range(1, task.num_stages + 1)
    return EpisodeCase(
        task_id=task.task_id,
        house=task.header.house.name,
        start=task.start_pose,
        stages=tuple(
            StageCase(
                public=task.public(k),
                house_json=task.house_json(k),
                target=_target(task, k),
                transition=_transition(task.oracle(k)),
            )
            for k in numbers
        ),
    )


def _target(task: Task, stage: int) -> TargetRecord:
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


def _transition(oracle: OracleStage) -> TransitionRecord:
    evolution = oracle.evolution
    if evolution.outcome != "evolved":
        return TransitionRecord()
    return TransitionRecord(
        mode=evolution.mode,
        room_id=evolution.room_id,
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


def stage_map(case: EpisodeCase, stage: int, objects: Sequence[SceneObject]) -> StageMap:
    """A stage's house from above.

    Args:
        case: The task.
        stage: 1-based.
        objects: The simulator's bodies, for sizes.

    Raises:
        HouseError: The house is malformed.
    """
    house = House(case.stages[stage - 1].house_json, name=case.house)
    walls = {wall.id: wall for wall in house.walls}
    return StageMap(
        task_id=case.task_id,
        house=case.house,
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
        objects=_footprints({entry.id: math.radians(entry.rotation_deg[1]) for entry in house.objects}, objects),
        reference_image=_thumbnail(case.stages[stage - 1].public.reference_image),
    )


def room_at(plan: StageMap, point_m: Point2) -> str | None:
    """The id of the room over a point (even-odd rule), or `None` outside all of them."""
    return next((room.room_id for room in plan.rooms if _is_inside(room.polygon_m, point_m)), None)


def _thumbnail(image: NDArray[np.uint8]) -> str:
    """An RGB image as a small `data:` URI."""
    buffer = BytesIO()
    Image.fromarray(image).resize((THUMBNAIL_PX, THUMBNAIL_PX)).save(buffer, "WEBP", quality=70, method=0)
    return f"data:image/webp;base64,{b64encode(buffer.getvalue()).decode()}"


def _is_inside(polygon_m: Sequence[Point2], point_m: Point2) -> bool:
    x, z = point_m
    is_inside = False
    for (x0, z0), (x1, z1) in zip(polygon_m, (*polygon_m[1:], polygon_m[0]), strict=True):
        if (z0 > z) != (z1 > z) and x < x0 + (z - z0) / (z1 - z0) * (x1 - x0):
            is_inside = not is_inside
    return is_inside


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


def _footprints(yaws_rad: Mapping[str, float], objects: Sequence[SceneObject]) -> tuple[ObjectFootprint, ...]:
    footprints = []
    for body in objects:
        if body.kind != "object":
            continue
        x, _, z = body.centre_m
        corners = _turned_corners(body.size_m[0], body.size_m[2], yaws_rad.get(body.id, 0.0))
        footprints.append(
            ObjectFootprint(
                object_id=body.id,
                category=body.category,
                centre_m=body.centre_m,
                size_m=body.size_m,
                polygon_m=tuple((x + dx, z + dz) for dx, dz in corners),
            )
        )
    return tuple(footprints)


def _turned_corners(box_x_m: float, box_z_m: float, yaw_rad: float) -> list[Point2]:
    """Corners of the rectangle at `yaw_rad` whose axis-aligned box is `box_x_m` by `box_z_m`, about its centre.

    Near 45 degrees many rectangles share a box; there the box itself is drawn.
    """
    c, s = abs(math.cos(yaw_rad)), abs(math.sin(yaw_rad))
    determinant = c * c - s * s
    if abs(determinant) > 0.1:
        width_m = (c * box_x_m - s * box_z_m) / determinant
        depth_m = (c * box_z_m - s * box_x_m) / determinant
        if width_m > 0.0 and depth_m > 0.0:
            sin, cos = math.sin(yaw_rad), math.cos(yaw_rad)
            corners = [(-width_m, -depth_m), (width_m, -depth_m), (width_m, depth_m), (-width_m, depth_m)]
            # Yaw is clockwise seen from above: +z turns towards +x.
            return [((x * cos + z * sin) / 2, (-x * sin + z * cos) / 2) for x, z in corners]
    half_x_m, half_z_m = box_x_m / 2, box_z_m / 2
    return [(-half_x_m, -half_z_m), (half_x_m, -half_z_m), (half_x_m, half_z_m), (-half_x_m, half_z_m)]
