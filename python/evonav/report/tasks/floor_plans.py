"""Draw a task's stages: the house before and after the hidden change, the reference course, and the target."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from evonav.drawing.floor_plan import (
    FLAT_CATEGORIES,
    PlanFrame,
    floors,
    frame_of,
    furniture,
    item_labels,
    labels,
    moving_ids,
    outline,
    structure,
)
from evonav.drawing.plan import ObjectFootprint, RoomFootprint, door_ends
from evonav.drawing.svg import Point, cm, join, polyline, title
from evonav.evaluation.records.floor_plans import FloorPlan, floor_plan_of, image_uri
from evonav.evaluation.records.oracle import target_record, transition_record
from evonav.house import House
from evonav.report.maps.trajectory import relocation_arrows, start_mark, target_mark
from evonav.tasks import Task
from evonav.tasks.language import noun_of
from evonav.tasks.oracle import Evolution, OracleStage

IMAGE_PX = 240
CLOSE_LABEL_MIN_M2 = 0.06
"""Footprint from which furniture is named in a close-up."""
CLOSE_LETTERS = 2.3
THUMBNAIL_MIN_M = 0.5
"""Edge from which furniture is drawn in a gallery."""
MAX_SPREAD = 4.0
"""Area over its members' up to which a group is drawn as one: a shuffle tears groups apart."""
VIEW_M = 1.1
"""Length of the drawn view cone of the reference pose."""
HALF_VIEW_RAD = math.pi / 4
"""Half of the reference image's field of view."""
_MEMBER = re.compile(r"(?:^|\|)(\d+)\|(\d+)\|\d+$")


@dataclass(frozen=True, slots=True)
class TaskDrawing:
    """Data that the pictures of a task share."""

    task: Task
    prefix: str
    """Prefix of the ids of shared groups, different for every task of a page."""
    frame: PlanFrame
    maps: Mapping[int, FloorPlan]
    """Floor plans by stage."""
    doors: Mapping[str, tuple[Point, Point]]
    """Ends of doors on the floor plan, by id."""
    moving: frozenset[str]
    """Ids of what does not stand in the same place in all stages."""


def task_drawing(task: Task, prefix: str = "p") -> TaskDrawing:
    """Read a task's houses."""
    maps = {}
    for stage in range(1, task.num_stages + 1):
        house = House(task.house_json(stage), name=f"{task.task_id}/houses/stage_{stage}.json.gz")
        image = image_uri(task.reference_images[stage - 1], IMAGE_PX)
        at_end = None if task.oracle(stage).during is None else House(task.house_json_at_end(stage))
        maps[stage] = floor_plan_of(house, task_id=task.task_id, stage=stage, reference_image=image, at_end=at_end)
    moving = moving_ids([plan for start in maps.values() for plan in (start, start.at_end)])
    return TaskDrawing(task, prefix, frame_of(maps.values()), maps, door_ends(house), moving)


def definitions(drawing: TaskDrawing) -> str:
    """Return the parts that all of a task's pictures share, as groups that they refer to."""
    first, frame = drawing.maps[1], drawing.frame
    fixed = [item for item in first.objects if item.object_id not in drawing.moving]
    shared = {
        "floors": floors(first),
        "fixed": furniture(fixed, frame),
        "walls": structure(first, frame),
    }
    return join(f'<g class="map" id="{drawing.prefix}-{name}">{content}</g>' for name, content in shared.items())


def before_svg(drawing: TaskDrawing, stage: int, frame: PlanFrame) -> str:
    """Draw the house of the stage before; what is about to move, go or open is stressed: content of an `svg`."""
    evolution = drawing.task.oracle(stage).evolution
    removed = {record.id for record in evolution.removals}
    leaving = {change.id for change in evolution.changes} - removed
    plan = drawing.maps[stage - 1].at_end
    return _plan(drawing, plan, evolution, frame, {"moved": leaving, "gone": removed})


def after_svg(drawing: TaskDrawing, stage: int, frame: PlanFrame) -> str:
    """Draw the house of a stage with what was changed, and from where: content of an `svg` element."""
    oracle, previous = drawing.task.oracle(stage), _before(drawing, stage)
    evolution = oracle.evolution
    moved = {change.id for change in evolution.changes}
    added = {record.id for record in evolution.additions}
    old = [] if previous is None else [item for item in previous.objects if item.object_id in moved]
    ghosts = furniture(old, frame, "items ghost")
    plan = _plan(drawing, drawing.maps[stage], evolution, frame, {"moved": moved - added, "new": added}, ghosts)
    arrows = relocation_arrows(
        transition_record(oracle.evolution).relocations, frame, floor_plan=drawing.maps[stage], previous_map=previous
    )
    return f'{plan}<g class="change">{arrows}</g>{target_mark(target_record(drawing.task, stage), frame)}'


def course_svg(drawing: TaskDrawing, stage: int) -> str:
    """Draw the whole house of a stage, with the reference course and the target: content of an `svg` element."""
    oracle, frame = drawing.task.oracle(stage), drawing.frame
    evolution = oracle.evolution
    stressed = {"moved": {change.id for change in evolution.changes}}
    plan = _plan(drawing, drawing.maps[stage], evolution, frame, stressed)
    between = join(
        f'<path class="between" stroke-width="{0.6 * frame.unit:.1f}" d="{outline(room.polygon_m)}">'
        f"{title('transition room')}</path>"
        for room in drawing.maps[stage].rooms
        if room.room_id == oracle.state.transition_room_id
    )
    return plan + between + _course(oracle, frame) + target_mark(target_record(drawing.task, stage), frame)


def change_frame(drawing: TaskDrawing, stage: int) -> PlanFrame:
    """Return the part of the house in which a stage's change happened."""
    evolution = drawing.task.oracle(stage).evolution
    changed = {change.id for change in evolution.changes}
    changed |= {record.id for record in (*evolution.additions, *evolution.removals)}
    changed |= {state.id for state in evolution.states}
    points: list[Point] = []
    for floor_plan in (drawing.maps[stage - 1].at_end, drawing.maps[stage]):
        points += [p for room in floor_plan.rooms if room.room_id == evolution.room_id for p in room.polygon_m]
        points += [p for item in floor_plan.objects if item.object_id in changed for p in item.polygon_m]
        points += [p for name, ends in drawing.doors.items() if name in changed for p in ends]
    return PlanFrame.around(points)


def thumbnail_svg(drawing: TaskDrawing, stage: int) -> str:
    """Draw a stage's house with nothing but large furniture and what moved: content of an `svg` element."""
    oracle, frame, floor_plan = drawing.task.oracle(stage), drawing.frame, drawing.maps[stage]
    moved = {change.id for change in oracle.evolution.changes}
    large = [item for item in floor_plan.objects if max(item.size_m[0], item.size_m[2]) >= THUMBNAIL_MIN_M]
    arrows = relocation_arrows(
        transition_record(oracle.evolution).relocations,
        frame,
        floor_plan=floor_plan,
        previous_map=_before(drawing, stage),
    )
    return join(
        [
            floors(floor_plan),
            furniture([item for item in large if item.object_id not in moved], frame, has_parts=False),
            furniture([item for item in large if item.object_id in moved], frame, "items moved", has_parts=False),
            structure(floor_plan, frame),
            f'<g class="change">{arrows}</g>',
        ]
    )


def _before(drawing: TaskDrawing, stage: int) -> FloorPlan | None:
    """Return the house as the stage before left it; `None` for stage 1."""
    return drawing.maps[stage - 1].at_end if stage > 1 else None


def _plan(
    drawing: TaskDrawing,
    floor_plan: FloorPlan,
    evolution: Evolution,
    frame: PlanFrame,
    stressed: Mapping[str, set[str]],
    ghosts: str = "",
) -> str:
    """Draw a house of a stage; `stressed` has the ids that are drawn in a CSS class of their own."""

    def use(name: str) -> str:
        return f'<use href="#{drawing.prefix}-{name}"/>'

    movable = [item for item in floor_plan.objects if item.object_id in drawing.moving]
    css_of = {name: css for css, names in stressed.items() for name in names}
    plain = furniture([item for item in movable if item.object_id not in css_of], frame)
    coloured = join(
        furniture([item for item in movable if css_of.get(item.object_id) == css], frame, f"items {css}")
        for css in stressed
    )
    unmoved = [item for item in floor_plan.objects if item.object_id in evolution.unmoved_ids]
    states = {state.id for state in evolution.states}
    opened = [item for item in floor_plan.objects if item.object_id in states]
    is_whole = frame == drawing.frame
    return join(
        [
            use("floors"),
            join(_tint(room, frame) for room in floor_plan.rooms if room.room_id == evolution.room_id),
            _groups(floor_plan.objects, frame),
            ghosts,
            use("fixed"),
            plain,
            coloured,
            furniture(unmoved, frame, "items unmoved"),
            furniture(opened, frame, "items opened"),
            use("walls"),
            _opened_doors(drawing, states, frame),
            item_labels(floor_plan.objects, frame, *(() if is_whole else (CLOSE_LABEL_MIN_M2, CLOSE_LETTERS))),
            labels(floor_plan, frame) if is_whole else "",
        ]
    )


def _opened_doors(drawing: TaskDrawing, states: set[str], frame: PlanFrame) -> str:
    found = [ends for name, ends in sorted(drawing.doors.items()) if name in states]
    lines = join(f'<path d="{polyline([cm(a), cm(b)])}"/>' for a, b in found)
    return f'<g class="opened-doors" stroke-width="{1.2 * frame.unit:.1f}">{lines}</g>' if found else ""


def _tint(room: RoomFootprint, frame: PlanFrame) -> str:
    hint = title(f"{noun_of(room.room_type)}: the room that changed")
    return f'<path class="tint" stroke-width="{2.2 * frame.unit:.0f}" d="{outline(room.polygon_m)}">{hint}</path>'


def _groups(objects: Iterable[ObjectFootprint], frame: PlanFrame) -> str:
    """Draw a soft shape around the members of every asset group, which ProcTHOR's ids number `room|group|member`."""
    members: dict[tuple[str, str], list[ObjectFootprint]] = {}
    for item in objects:
        if (match := _MEMBER.search(item.object_id)) and item.category not in FLAT_CATEGORIES:
            members.setdefault((match[1], match[2]), []).append(item)
    hulls = [(items, _hull(items)) for items in members.values() if len(items) > 1]
    shapes = join(
        f'<path d="{outline(hull)}">{title("group: " + ", ".join(noun_of(item.category) for item in items))}</path>'
        for items, hull in hulls
        if _area_m2(hull) <= MAX_SPREAD * sum(item.size_m[0] * item.size_m[2] for item in items)
    )
    return f'<g class="groups" stroke-width="{2.4 * frame.unit:.0f}">{shapes}</g>' if shapes else ""


def _area_m2(polygon_m: Sequence[Point]) -> float:
    """Return the area of a polygon (shoelace formula)."""
    ahead = zip(polygon_m, (*polygon_m[1:], *polygon_m[:1]), strict=True)
    return abs(sum(x0 * z1 - x1 * z0 for (x0, z0), (x1, z1) in ahead)) / 2


def _hull(items: Sequence[ObjectFootprint]) -> list[Point]:
    """Convex hull of footprints (Andrew's monotone chain)."""
    points = sorted({point for item in items for part in item.outlines_m or (item.polygon_m,) for point in part})
    hull: list[Point] = []
    for chain in (points, points[::-1]):
        floor = len(hull)
        for point in chain:
            while len(hull) - floor >= 2 and _turn(hull[-2], hull[-1], point) <= 0.0:
                hull.pop()
            hull.append(point)
        hull.pop()
    return hull


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _course(oracle: OracleStage, frame: PlanFrame) -> str:
    """Draw the reference trajectory, the start, and the reference pose with what it sees."""
    u = frame.unit
    path = polyline([cm(point) for point in oracle.reference_path_m])
    start_m, pose = oracle.start_pose.position_m, oracle.reference_pose
    x, y = cm((pose.position_m[0], pose.position_m[2]))
    reach_cm = 100 * VIEW_M
    rays = [
        (x + reach_cm * math.sin(yaw_rad), y - reach_cm * math.cos(yaw_rad))
        for yaw_rad in (math.radians(pose.yaw_deg) + side * HALF_VIEW_RAD for side in (-1, 1))
    ]
    (ax, ay), (bx, by) = rays
    cone = f"M{x} {y}L{ax:.0f} {ay:.0f}A{reach_cm:.0f} {reach_cm:.0f} 0 0 1 {bx:.0f} {by:.0f}Z"
    hint = title(f"reference pose, {oracle.reference_path_length_m:.1f} m from the start")
    return (
        f'<path class="cone" stroke-width="{0.25 * u:.1f}" d="{cone}"/>'
        f'<path class="casing" stroke-width="{1.5 * u:.1f}" d="{path}"/>'
        f'<path class="trajectory" stroke-width="{0.75 * u:.1f}" d="{path}"/>'
        f"{start_mark(cm((start_m[0], start_m[2])), frame, 'start')}"
        f'<circle class="eye" cx="{x}" cy="{y}" r="{1.1 * u:.0f}" stroke-width="{0.4 * u:.1f}">{hint}</circle>'
    )
