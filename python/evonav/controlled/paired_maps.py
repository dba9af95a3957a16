"""Draw one agent in a house as it was, beside the same agent in the house after it changed."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from evonav.controlled.analysis import SPLITS, Analysis, Key, has_moved_far, split_of
from evonav.controlled.layout import run_of
from evonav.drawing.files import check_picture, write_picture
from evonav.drawing.floor_plan import PlanFrame
from evonav.drawing.svg import arrow_head, cm, escape, join, polyline, simplified, text_lines, title
from evonav.errors import InvalidArgumentError
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import EndState, StageRecord
from evonav.evaluation.records.store import RunStore
from evonav.report.maps.stage_map import (
    house_drawing,
    instruction_lines,
    panel,
    panel_height_px,
    reference_image,
    sheet,
    success_radius_of,
    task_frame,
)
from evonav.report.maps.text import describe_change
from evonav.report.maps.trajectory import course
from evonav.report.tables.causes import sentence

MARKER_SCALE = 0.75
"""Size of markers and letters beside that of other maps: pairs are drawn larger."""
PANEL_PX, GAP_PX, HEAD_PX, FOOT_PX, IMAGE_PX = 560, 20, 96, 58, 84
ARM_WORDS = {"fixed": "Fixed", "evolved": "Not Fixed"}
REASONS = {
    "misled": "led to where the target was, and lost it",
    "recovered": "led to where the target was, and found it after all",
    "unharmed": "the target moved, and it was found without a detour to its old place",
}


@dataclass(frozen=True, slots=True)
class Rollout:
    """One agent's evaluated stage in one arm, and the walk before it."""

    arm: str
    record: StageRecord
    walks: tuple[StageRecord, ...]
    """Stages of the same episode in which it looked on."""
    maps: Mapping[int, FloorPlan]
    success_radius_m: float


def load_pair(analysis: Analysis, agent: str, key: Key) -> list[Rollout]:
    """Read a pair with its traces, one run per arm.

    Raises:
        InvalidArgumentError: There is no such pair.
        StoreError: A run cannot be read.
    """
    task_id, stage = key
    found = []
    for arm in analysis.arms:
        with RunStore(run_of(analysis.directory, arm)) as store:
            records = {one.stage: one for one in store.records(agent, task_id)}
            maps = {one.stage: one for one in store.floor_plans(task_id)}
            radius_m = success_radius_of(store.meta("config") or {})
        if stage not in records:
            raise InvalidArgumentError(f"{analysis.directory}: no task {task_id!r} by agent {agent!r} in arm {arm}")
        walks = tuple(one for _, one in sorted(records.items()) if one.state is EndState.GUIDED)
        found.append(Rollout(arm, records[stage], walks, maps, radius_m))
    return found


def highlighted_pairs(analysis: Analysis, agent: str, per_reason: int = 1) -> list[tuple[str, Key]]:
    """Return pairs that show what a moved target does to an agent, each with its reason, a key of `REASONS`.

    Of targets that moved by more than the success radius: nearer ones are found at their old places, too. Where it was
    misled, those on whose stale entries it walked farthest come first; else the shortest ways.
    """
    fixed, evolved = analysis.arms
    ranked: dict[str, list[tuple[float, Key]]] = {reason: [] for reason in REASONS}
    for key in analysis.keys(agent):
        before, after = (analysis.outcomes[arm, agent][key] for arm in (fixed, evolved))
        if not before.row.success or not has_moved_far(after):
            continue
        if after.row.num_stale_visits and not after.row.success:
            ranked["misled"].append((-after.row.stale_path_m, key))
        elif after.row.num_stale_visits:
            ranked["recovered"].append((-after.row.stale_path_m, key))
        elif after.row.success:
            ranked["unharmed"].append((after.row.path_length_m or 0.0, key))
    return [(reason, key) for reason, found in ranked.items() for _, key in sorted(found)[:per_reason]]


def write_pair(analysis: Analysis, agent: str, key: Key, path: Path) -> Path:
    """Draw a pair into a `.svg`, `.png` or `.pdf` file.

    Raises:
        InvalidArgumentError: There is no such pair, or the file's suffix is of no format.
        StoreError: A run cannot be read, or the file not written, or not without an extra.
    """
    check_picture(path)
    return write_picture(pair_svg(load_pair(analysis, agent, key)), path)


def pair_svg(pair: Sequence[Rollout]) -> str:
    """Draw Fixed on the left, Not Fixed on the right, the goal above and the legend below."""
    frame = pair_frame(pair)
    first = pair[0].record
    width_px = GAP_PX + len(pair) * (PANEL_PX + GAP_PX)
    head = f'<text class="stage" x="{GAP_PX}" y="27">{escape(first.agent)}: {escape(first.goal.category)}</text>'
    lines = instruction_lines(first.goal.instruction, 140, 2, f' x="{GAP_PX}"')
    image = reference_image(pair[0].maps.get(first.stage), width_px - GAP_PX, 6, IMAGE_PX)
    panels = join(_panel(one, frame, GAP_PX + i * (PANEL_PX + GAP_PX)) for i, one in enumerate(pair))
    dotted = (
        '<path class="walk" d="M0 8h40" stroke-width="3"/>'
        '<text class="quiet" x="48" y="12">reference trajectory along which the agent was guided before</text>'
    )
    name, top_px = f"{first.task_id}: {first.agent}", HEAD_PX + panel_height_px(frame, PANEL_PX) + FOOT_PX
    return sheet(name, head + lines + image + panels, width_px, top_px, GAP_PX, foot=dotted, foot_px=28)


def pair_frame(pair: Sequence[Rollout]) -> PlanFrame:
    """Return the frame that all arms of a pair share."""
    maps = {i: floor_plan for i, one in enumerate(pair) for floor_plan in one.maps.values()}
    return replace(task_frame(maps, [one.record for one in pair]), marker_scale=MARKER_SCALE)


def _panel(rollout: Rollout, frame: PlanFrame, left_px: int) -> str:
    record = rollout.record
    verdict = "ok" if record.state is EndState.SUCCESS else "bad"
    css = "quiet" if record.transition.kind == "static" else "change-words"
    captions = [
        ("quiet", 34, text_lines(sentence(record), 90, 1)[0]),
        (css, 50, text_lines(change_sentence(rollout), 90, 1)[0]),
    ]
    drawing = house_drawing(record, rollout.maps, frame, on_it=walk_and_course(rollout, frame))
    return panel(record, drawing, frame, (left_px, HEAD_PX), PANEL_PX, (arm_title(rollout.arm), verdict), captions)


def arm_title(arm: str) -> str:
    """Return `Fixed`, `Not Fixed`, or the name of another arm."""
    return ARM_WORDS.get(arm, arm)


def change_sentence(rollout: Rollout) -> str:
    """Describe what had changed since the guided stages."""
    text = describe_change(rollout.record, rollout.maps)
    return f"{text}, the target among them" if rollout.record.target.is_relocated_now else text


def describe_split(analysis: Analysis, agent: str, key: Key) -> str:
    """Describe what the pair's change touched."""
    return SPLITS[split_of(analysis.outcomes[analysis.arms[-1], agent][key])]


def walk_and_course(rollout: Rollout, frame: PlanFrame) -> str:
    """Draw the way that the agent was guided, and what it then did itself."""
    points = [cm(point) for walk in rollout.walks for taken in walk.trace for point in taken.path_m]
    drawn = ""
    if len(points) > 1:
        hint = title("reference trajectory along which the agent was guided before")
        width = f"{0.7 * frame.unit:.1f}"
        drawn = f'<path class="walk" stroke-width="{width}" d="{polyline(simplified(points))}">{hint}</path>'
    return drawn + target_move(rollout.record, frame) + course(rollout.record, frame, rollout.success_radius_m)


def target_move(record: StageRecord, frame: PlanFrame) -> str:
    """Draw an arrow from where the target stood to where it is, if it moved."""
    target = record.target
    if target.first_position_m is None or not target.is_relocated_now:
        return ""
    start, end = (cm((point[0], point[2])) for point in (target.first_position_m, target.position_m))
    length = math.dist(start, end)
    if length < 4 * frame.unit:
        return ""
    direction = ((end[0] - start[0]) / length, (end[1] - start[1]) / length)
    tip = (end[0] - 2.4 * frame.unit * direction[0], end[1] - 2.4 * frame.unit * direction[1])
    head = arrow_head(tip, direction, 2.6 * frame.unit)
    hint = title(f"the target moved {length / 100:.1f} m")
    return (
        f'<g class="target-move" stroke-width="{0.9 * frame.unit:.1f}">{hint}'
        f'<path d="{polyline([start, (round(tip[0]), round(tip[1]))])}"/><path class="head" d="{head}"/></g>'
    )
