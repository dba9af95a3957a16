"""Draw what happened in a stage over its house: change, path in time, beliefs, start, end and target."""

import itertools
import math
from collections.abc import Mapping, Sequence

from evonav.drawing.floor_plan import PlanFrame, distance_m, furniture
from evonav.drawing.plan import ObjectFootprint
from evonav.drawing.svg import Point, arrow_head, cm, cross, join, polyline, simplified, star, title
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import EndState, EntryRecord, Relocation, RoundRecord, StageRecord, TargetRecord
from evonav.report.maps.text import describe_choice
from evonav.tasks.language import noun_of

NUM_TIMES = 10
"""Colours of the path, from the first round to the last: classes `t0` to `t9`."""
ARROW_EVERY = 16.0
"""Units of a frame between direction arrows."""
MANY_ROUNDS = 100
"""Rounds of a stage from which on those of the same choice are drawn as one."""
LARGE_M2 = 0.3
"""Footprint from which on a relocated object has a thick arrow."""
CARRIED_GAP_M = 0.05
"""Largest distance between a moved object's footprint and an object that it carries."""


def course(record: StageRecord, frame: PlanFrame, success_radius_m: float) -> str:
    """Draw what one agent did in a stage: path, beliefs, start and end, and where the target was."""
    return (
        ring(record, frame, success_radius_m)
        + _path(record, frame)
        + _stale_entries(record, frame)
        + target_mark(record.target, frame)
        + _ends(record, frame)
    )


def change(record: StageRecord, maps: Mapping[int, FloorPlan], frame: PlanFrame) -> str:
    """Draw relocated objects: where they stood (dashed), where they stand (stressed), and an arrow between.

    The same for all agents. What was carried along on a moved piece of furniture is stressed, but has no arrow.
    Objects of a stage without a map are left out.
    """
    relocations = record.transition.relocations
    if not relocations:
        return ""
    floor_plan, previous_map = maps.get(record.stage), maps.get(record.stage - 1)
    names = {relocation.object_id for relocation in relocations}
    now = _by_id(floor_plan)
    before = _by_id(previous_map)
    ghosts = furniture([before[name] for name in sorted(names) if name in before], frame, "items ghost")
    stressed = furniture([now[name] for name in sorted(names) if name in now], frame, "items moved")
    arrows = relocation_arrows(relocations, frame, floor_plan=floor_plan, previous_map=previous_map)
    return f'<g class="change">{ghosts}{stressed}{arrows}</g>'


def relocation_arrows(
    relocations: Sequence[Relocation], frame: PlanFrame, *, floor_plan: FloorPlan | None, previous_map: FloorPlan | None
) -> str:
    """Draw an arrow for each object that was not carried along by a larger one."""
    now, before = _by_id(floor_plan), _by_id(previous_map)
    return join(
        _relocation_arrow(relocation, frame, is_large=_area_m2(now.get(relocation.object_id)) >= LARGE_M2)
        for relocation in relocations
        if not _is_carried(relocation, relocations, before, now)
    )


def rounds(trace: Sequence[RoundRecord]) -> list[str]:
    """Describe decision rounds, runs of the same choice together: `frontier 3 x4`."""
    runs = [(choice, len(list(same))) for choice, same in itertools.groupby(map(_choice, trace))]
    return [choice if count == 1 else f"{choice} ×{count}" for choice, count in runs]


def _by_id(floor_plan: FloorPlan | None) -> Mapping[str, ObjectFootprint]:
    return {} if floor_plan is None else {item.object_id: item for item in floor_plan.objects}


def _is_carried(
    relocation: Relocation,
    relocations: Sequence[Relocation],
    before: Mapping[str, ObjectFootprint],
    now: Mapping[str, ObjectFootprint],
) -> bool:
    """Return whether an object lay on (or in) a larger moved object and still does."""
    area_m2 = _area_m2(now.get(relocation.object_id))
    moved = [(before.get(other.object_id), now.get(other.object_id)) for other in relocations]
    return any(
        _area_m2(new) > area_m2 and _is_over(relocation.from_m, old) and _is_over(relocation.to_m, new)
        for old, new in moved
        if old is not None and new is not None
    )


def _is_over(point_m: Sequence[float], item: ObjectFootprint) -> bool:
    return (
        abs(point_m[0] - item.centre_m[0]) <= item.size_m[0] / 2 + CARRIED_GAP_M
        and abs(point_m[2] - item.centre_m[2]) <= item.size_m[2] / 2 + CARRIED_GAP_M
    )


def _area_m2(item: ObjectFootprint | None) -> float:
    return 0.0 if item is None else item.size_m[0] * item.size_m[2]


def _relocation_arrow(relocation: Relocation, frame: PlanFrame, *, is_large: bool) -> str:
    start, end = cm(_ground(relocation.from_m)), cm(_ground(relocation.to_m))
    u = frame.unit * (1.0 if is_large else 0.65)
    width = f'stroke-width="{0.55 * u:.1f}"'
    dx, dy = end[0] - start[0], end[1] - start[1]
    length = math.hypot(dx, dy)
    text = f"{noun_of(relocation.category)}: moved {distance_m(relocation.from_m, relocation.to_m):.1f} m"
    hint = title(text)
    if length < 3 * u:
        return f'<circle class="arrow" {width} cx="{end[0]}" cy="{end[1]}" r="{1.4 * u:.0f}">{hint}</circle>'
    # A curve, so that arrows to and fro do not hide each other.
    bend = 0.14
    middle = (start[0] + dx / 2 - dy * bend, start[1] + dy / 2 + dx * bend)
    direction = (end[0] - middle[0], end[1] - middle[1])
    scale = 1.8 * u / math.hypot(*direction)
    neck = (end[0] - direction[0] * scale, end[1] - direction[1] * scale)
    curve = f"M{start[0]} {start[1]}Q{middle[0]:.0f} {middle[1]:.0f} {neck[0]:.0f} {neck[1]:.0f}"
    return (
        f'<g class="arrow{"" if is_large else " fine"}" {width}>{hint}<path d="{curve}"/>'
        f'<circle cx="{start[0]}" cy="{start[1]}" r="{0.7 * u:.0f}"/>'
        f'<path class="head" d="{arrow_head(end, direction, 2.4 * u)}"/></g>'
    )


def ring(record: StageRecord, frame: PlanFrame, success_radius_m: float) -> str:
    """Draw the circle around the target within which a stage is a success."""
    x, y = cm(_ground(record.target.position_m))
    radius_cm = round(100 * success_radius_m)
    hint = title(f"success within {success_radius_m:g} m of the target")
    width = f"{0.4 * frame.unit:.1f}"
    return f'<circle class="ring" cx="{x}" cy="{y}" r="{radius_cm}" stroke-width="{width}">{hint}</circle>'


def target_mark(target: TargetRecord, frame: PlanFrame) -> str:
    """Draw a star where the target is, and an empty one where it stood in stage 1."""
    u = frame.unit
    centre = cm(_ground(target.position_m))
    first = ""
    if target.first_position_m is not None and distance_m(target.first_position_m, target.position_m) > 0.1:
        old = cm(_ground(target.first_position_m))
        hint = title(f"the target, {noun_of(target.category)}, stood here in stage 1")
        first = f'<path class="star old" stroke-width="{0.35 * u:.1f}" d="{star(old, 2.4 * u)}">{hint}</path>'
    hint = title(f"target: {noun_of(target.category)}")
    return f'{first}<path class="star" stroke-width="{0.4 * u:.1f}" d="{star(centre, 2.9 * u)}">{hint}</path>'


def _path(record: StageRecord, frame: PlanFrame) -> str:
    if not record.trace:
        return ""
    u = frame.unit
    legs = _legs(record.trace)
    pieces = [simplified([cm(point) for entry in leg for point in entry.path_m]) for leg in legs]
    whole = [point for piece in pieces for point in piece]
    last = max(1, len(record.trace) - 1)
    gone = 0.0
    drawn = []
    for leg, piece in zip(legs, pieces, strict=True):
        entry = leg[0]
        arrow, gone = _direction_arrow(piece, gone, frame)
        time = _time(entry, last)
        yaw_deg = round(math.degrees(entry.pose.yaw_rad)) % 360
        x, y = cm((entry.pose.x_m, entry.pose.z_m))
        which = f"round {entry.round + 1}" if len(leg) == 1 else f"rounds {entry.round + 1} to {leg[-1].round + 1}"
        hint = title(f"{which}: {_choice(leg[-1])}")
        head = f'<path class="head" d="{arrow}"/>' if arrow else ""
        drawn.append(f'<g class="r t{time}" data-p="{x},{y},{yaw_deg}">{hint}<path d="{polyline(piece)}"/>{head}</g>')
    return (
        f'<path class="casing" stroke-width="{1.9 * u:.1f}" d="{polyline(whole)}"/>'
        f'<g class="path" stroke-width="{0.95 * u:.1f}">{join(drawn)}</g>'
    )


def _time(entry: RoundRecord, last: int) -> int:
    """Return the number of the path's colour in a round."""
    return min(NUM_TIMES - 1, NUM_TIMES * entry.round // (last + 1))


def _legs(trace: Sequence[RoundRecord]) -> list[list[RoundRecord]]:
    """Group rounds that are drawn as one: those of the same choice, of an agent whose rounds are single actions."""
    if len(trace) <= MANY_ROUNDS:
        return [[entry] for entry in trace]
    runs = itertools.groupby(trace, lambda entry: (_choice(entry), _time(entry, len(trace) - 1)))
    return [list(same) for _, same in runs]


def _direction_arrow(piece: Sequence[tuple[int, int]], gone: float, frame: PlanFrame) -> tuple[str, float]:
    """Return an arrow if the path reaches the place of the next one here, and the way since the last arrow."""
    every = ARROW_EVERY * frame.unit
    for a, b in itertools.pairwise(piece):
        length = math.dist(a, b)
        if gone + length >= every and length > 0.0:
            t = max(0.0, every - gone) / length
            size = 2.3 * frame.unit
            direction = ((b[0] - a[0]) / length, (b[1] - a[1]) / length)
            tip = (
                a[0] + t * (b[0] - a[0]) + direction[0] * size / 2,
                a[1] + t * (b[1] - a[1]) + direction[1] * size / 2,
            )
            rest = math.dist(b, piece[-1])
            return arrow_head(tip, direction, size), (1 - t) * length + rest
        gone += length
    return "", gone


def start_mark(at: tuple[int, int], frame: PlanFrame, text: str) -> str:
    """Draw a ring where a way begins."""
    size = f'r="{1.5 * frame.unit:.0f}" stroke-width="{0.7 * frame.unit:.1f}"'
    return f'<circle class="start" cx="{at[0]}" cy="{at[1]}" {size}>{title(text)}</circle>'


def _ends(record: StageRecord, frame: PlanFrame) -> str:
    u = frame.unit
    marks = []
    if (start := record.effective_start) is not None:
        text = "start, moved here since the carried pose was no longer free" if record.is_snapped else "start"
        marks.append(start_mark(cm((start.x_m, start.z_m)), frame, text))
    if (end := record.terminal) is not None:
        marks.append(end_mark(cm((end.x_m, end.z_m)), record.state is EndState.SUCCESS, u))
    elif record.state is EndState.ERRORED and record.trace:
        last = record.trace[-1].path_m or ((record.trace[-1].pose.x_m, record.trace[-1].pose.z_m),)
        marks.append(end_mark(cm(last[-1]), is_success=False, unit=u))
    return join(marks)


def end_mark(at: tuple[int, int], is_success: bool, unit: float) -> str:
    """Draw where a stage ended."""
    x, y = at
    r = 1.9 * unit
    d = 0.8 * unit
    if is_success:
        sign = f"M{x - d:.0f} {y + 0.1 * d:.0f}L{x - 0.2 * d:.0f} {y + 0.8 * d:.0f}L{x + d:.0f} {y - 0.7 * d:.0f}"
    else:
        sign = cross((x, y), 0.75 * d)
    css = "end ok" if is_success else "end bad"
    hint = title("ended here: success" if is_success else "ended here: no success")
    return (
        f'<g class="{css}" stroke-width="{0.55 * unit:.1f}">{hint}<circle cx="{x}" cy="{y}" r="{r:.0f}"/>'
        f'<path d="{sign}"/></g>'
    )


def _stale_entries(record: StageRecord, frame: PlanFrame) -> str:
    """Draw stale entries of the memory at the end; those of the goal's category and those gone to are stressed."""
    visited: dict[int, EntryRecord] = {}
    for decision in record.trace:
        if decision.chosen_entry is not None and decision.chosen_entry.is_stale:
            visited[decision.chosen_entry.entry_id] = decision.chosen_entry
    believed = {entry.entry_id: entry for entry in record.entries if entry.is_stale}
    marks = []
    for name, entry in sorted({**believed, **visited}.items()):
        is_stressed = name in visited or entry.label == record.target.category
        marks.append(_stale_mark(entry, frame, is_stressed=is_stressed, is_visited=name in visited))
    return f'<g class="stale" stroke-width="{0.5 * frame.unit:.1f}">{join(marks)}</g>' if marks else ""


def _stale_mark(entry: EntryRecord, frame: PlanFrame, *, is_stressed: bool, is_visited: bool) -> str:
    x, y = cm(_ground(entry.centre_m))
    u = frame.unit
    least = (3.2 if is_stressed else 1.5) * u
    width, height = (min(300.0, max(least, 100 * size)) for size in (entry.size_m[0], entry.size_m[2]))
    text = f"stale entry: {noun_of(entry.label)} (no longer here), seen {entry.num_detections} times"
    if is_visited:
        text += ", gone to by the agent"
    css = "visited" if is_visited else "goal" if is_stressed else "weak"
    box = f'x="{x - width / 2:.0f}" y="{y - height / 2:.0f}" width="{width:.0f}" height="{height:.0f}"'
    mark = f'<path d="{cross((x, y), 0.9 * u)}"/>' if is_stressed else ""
    return f'<g class="{css}">{title(text)}<rect {box}/>{mark}</g>'


def _choice(entry: RoundRecord) -> str:
    return describe_choice(entry, has_truth=True)


def _ground(point_m: Sequence[float]) -> Point:
    return (point_m[0], point_m[2])
