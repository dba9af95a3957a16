"""Draw what an agent believed and did in one round, as SVG over the map of its house."""

import math
from collections.abc import Mapping

from evonav.drawing.floor_plan import PlanFrame
from evonav.drawing.layers import cells_layer, sector
from evonav.drawing.svg import cm, cross, escape, join, polyline
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import StageRecord
from evonav.replay.types import ReplayedEntry, ReplayedRound, ReplayedStage
from evonav.report.maps.stage_map import house_drawing
from evonav.report.maps.trajectory import ring, start_mark, target_mark
from evonav.tasks.language import noun_of

MAX_ENTRY_CM = 600.0
UNKNOWN_COLOUR = "#d0d4da"
"""The colour of unknown cells, which also lies beyond the agent's map."""
HEAT_COLOUR = "#b3261e"
"""The colour of likely places of the target, as in the viewer on a light page."""
_TAG_UNITS = 2.6
"""Height of the names of entries, in units of a frame."""


def house_layer(record: StageRecord, maps: Mapping[int, FloorPlan], frame: PlanFrame, success_radius_m: float) -> str:
    """Return what stays the same in a stage: the house, what moved before, and the target in its radius."""
    target = ring(record, frame, success_radius_m) + target_mark(record.target, frame)
    return house_drawing(record, maps, frame) + target


def belief_layer(stage: ReplayedStage, step: ReplayedRound, frame: PlanFrame) -> str:
    """Return an agent's map, entries and frontiers in one round, and its way so far."""
    if step.map is None:
        return way_layer(stage, step, frame)
    chosen = None if step.record is None else step.record.chosen_entry
    entries = [
        _entry(
            entry,
            frame,
            is_candidate=entry.record.entry_id in step.candidate_ids,
            is_chosen=chosen is not None and entry.record.entry_id == chosen.entry_id,
            is_goal=entry.record.label == stage.record.goal.category,
        )
        for entry in sorted(step.entries, key=lambda entry: entry.record.entry_id in step.candidate_ids)
    ]
    r = 1.3 * frame.unit
    diamonds = (
        f'<path class="frontier" stroke-width="{0.2 * frame.unit:.1f}" d="M{x} {y - r:.0f}l{r:.0f} {r:.0f}l{-r:.0f} '
        f'{r:.0f}l{-r:.0f} {-r:.0f}z"/>'
        for x, y in (cm(frontier.position_m) for frontier in step.frontiers)
    )
    return (
        cells_layer(step.map.cells, step.map.cell_m, step.map.corner_m)
        + heat_layer(step)
        + join(entries)
        + join(diamonds)
        + way_layer(stage, step, frame)
    )


def heat_layer(step: ReplayedRound) -> str:
    """Return where the agent believes the target to be: the more opaque, the likelier; nothing if it does not tell."""
    places = step.places
    most = 0.0 if places is None else max(places.probabilities, default=0.0)
    if places is None or most <= 0.0:
        return ""
    edge = 100.0 * places.cell_m
    squares = (
        f'<rect x="{x - edge / 2:.0f}" y="{y - edge / 2:.0f}" width="{edge:.0f}" height="{edge:.0f}" '
        f'fill="{HEAT_COLOUR}" fill-opacity="{0.75 * math.sqrt(p / most):.2f}"/>'
        for (x, y), p in zip(map(cm, places.centres_m), places.probabilities, strict=True)
        if p >= most / 100.0
    )
    return join(squares)


def truth_layer(stage: ReplayedStage, step: ReplayedRound, frame: PlanFrame) -> str:
    """Return where the memory wrongly holds the target, and the agent's way so far."""
    wrong = []
    for entry in step.entries:
        belief, truth = entry.record, entry.truth
        is_target = truth is not None and truth.object_id == stage.record.target.object_id
        if belief.is_stale and truth is not None and truth.now_m is not None and is_target:
            ends = [cm((point[0], point[2])) for point in (belief.centre_m, truth.now_m)]
            u = frame.unit
            width = f'stroke-width="{0.45 * u:.1f}"'
            line = f'<path stroke-dasharray="{u:.0f}" d="{polyline(ends)}"/>'
            wrong.append(f'<g class="target-moved" {width}>{line}<path d="{cross(ends[0], 1.4 * u)}"/></g>')
    return join(wrong) + way_layer(stage, step, frame)


def way_layer(stage: ReplayedStage, step: ReplayedRound, frame: PlanFrame) -> str:
    """Return the start, the way of all rounds so far, where the agent goes, where it stands and what it looks at."""
    u = frame.unit
    at = cm((step.pose.x_m, step.pose.z_m))
    sights = [(view.pose.yaw_rad, 9 * u, "sight side") for view in step.views[:-1]]
    sights.append((step.pose.yaw_rad, 12 * u, "sight"))
    start = stage.record.effective_start
    return (
        ("" if start is None else start_mark(cm((start.x_m, start.z_m)), frame, "start"))
        + _trail(stage, step, u)
        + join(sector(at, yaw_rad, stage.fov_rad, reach_cm, css) for yaw_rad, reach_cm, css in sights)
        + f'<circle class="agent" cx="{at[0]}" cy="{at[1]}" r="{1.5 * u:.1f}" stroke-width="{0.5 * u:.1f}"/>'
    )


def _trail(stage: ReplayedStage, step: ReplayedRound, unit: float) -> str:
    pieces = []
    for one in stage.rounds:
        if one.record is not None:
            css, width = ("step", 1.0) if one is step else ("trail", 0.9)
            path = polyline([cm(point) for point in one.record.path_m])
            pieces.append(f'<path class="{css}" stroke-width="{width * unit:.1f}" d="{path}"/>')
        if one is step:
            break
    if step.record is None or step.record.action.kind != "navigate_to":
        return join(pieces)
    places = step.record.path_m or ((step.pose.x_m, step.pose.z_m),)
    goal = cm(step.record.action.position_m)
    line = f'<path stroke-dasharray="{unit:.0f}" d="{polyline([cm(places[-1]), goal])}"/>'
    mark = f'<circle cx="{goal[0]}" cy="{goal[1]}" r="{0.8 * unit:.1f}"/>'
    return join(pieces) + f'<g class="goto" stroke-width="{0.4 * unit:.1f}">{line}{mark}</g>'


def _entry(entry: ReplayedEntry, frame: PlanFrame, *, is_candidate: bool, is_chosen: bool, is_goal: bool) -> str:
    belief, u = entry.record, frame.unit
    x, y = cm((belief.centre_m[0], belief.centre_m[2]))
    width, depth = (
        min(MAX_ENTRY_CM, max(1.4 * u, 100 * abs(edge))) if math.isfinite(edge) else 1.4 * u
        for edge in (belief.size_m[0], belief.size_m[2])
    )
    states = {"candidate": is_candidate, "chosen": is_chosen, "stale": belief.is_stale}
    css = " ".join(name for name, holds in states.items() if holds)
    box = f'x="{x - width / 2:.0f}" y="{y - depth / 2:.0f}" width="{width:.0f}" height="{depth:.0f}"'
    mark = f'<path d="{cross((x, y), min(0.9 * u, width / 2))}"/>' if belief.is_stale else ""
    tag = ""
    if is_chosen or is_goal:
        size = f'font-size="{_TAG_UNITS * u:.0f}" stroke-width="{0.5 * u:.1f}"'
        name = f"{noun_of(belief.label)} #{belief.entry_id}"
        half = 0.3 * _TAG_UNITS * u * len(name)  # a name stays inside of the picture
        middle = min(max(x, frame.left + half), frame.left + frame.width - half)
        place = f'x="{middle:.0f}" y="{y - depth / 2 - 0.8 * u:.0f}"'
        tag = f'<text class="tag {css}" {size} {place}>{escape(name)}</text>'
    line = f'stroke-width="{(0.75 if is_chosen else 0.35) * u:.1f}"'
    return f'<g class="entry {css}" {line}><rect {box}/>{mark}</g>{tag}'
