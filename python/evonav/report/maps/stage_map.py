"""Draw maps of stages: alone, or side by side with captions and the legend."""

from collections.abc import Mapping, Sequence

from evonav.drawing.floor_plan import PlanFrame, frame_of, ground, item_labels, labels
from evonav.drawing.style import map_file
from evonav.drawing.svg import escape, join, slug, text_lines
from evonav.evaluation.metrics.scoring import SUCCESS_RADIUS_M
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import StageRecord
from evonav.report.maps.legend import legend_row
from evonav.report.maps.text import describe_outcome
from evonav.report.maps.trajectory import change, course
from evonav.report.tables.causes import sentence

STAGE_WIDTH_PX = 900
VIEW_DIR = "view"
"""Folder of a run with the pages of `evonav view`."""


def stage_svg(
    record: StageRecord,
    maps: Mapping[int, FloorPlan],
    *,
    success_radius_m: float = SUCCESS_RADIUS_M,
) -> str:
    """Return one stage as an SVG document; a stage without a map is drawn without its house."""
    frame = task_frame(maps, [record])
    height_px = round(STAGE_WIDTH_PX * frame.height / frame.width)
    drawing = stage_drawing(record, maps, frame, success_radius_m, has_item_names=True)
    name = f"{record.task_id}, stage {record.stage}, {record.agent}"
    said = f"{record.goal.instruction} {sentence(record)}"
    return map_file(name, (STAGE_WIDTH_PX, height_px), drawing, view_box=frame.view_box, description=said)


def map_name(record: StageRecord) -> str:
    """Return the file name of a stage's map."""
    return f"{slug(record.task_id)}_{slug(record.agent)}_stage{record.stage}.svg"


def page_name(task_id: str, agent: str, stage: int | None = None) -> str:
    """Return the file name of a viewer's page of an episode, or of one stage of it."""
    return f"{slug(task_id)}_{slug(agent)}{'' if stage is None else f'_stage{stage}'}.html"


def task_frame(maps: Mapping[int, FloorPlan], records: Sequence[StageRecord]) -> PlanFrame:
    """Return the frame that a task's pictures share: the house, or the path where no house was recorded."""
    if any(floor_plan.rooms or floor_plan.walls for floor_plan in maps.values()):
        return frame_of(maps.values())
    points = [point for record in records for entry in record.trace for point in entry.path_m]
    points += [(record.target.position_m[0], record.target.position_m[2]) for record in records]
    return PlanFrame.around(points)


def success_radius_of(config: Mapping[str, object]) -> float:
    """Return the success radius of a run from its header."""
    protocol = config.get("protocol")
    radius_m = protocol.get("success_radius_m") if isinstance(protocol, dict) else None
    return float(radius_m) if isinstance(radius_m, int | float) else SUCCESS_RADIUS_M


def stage_drawing(
    record: StageRecord,
    maps: Mapping[int, FloorPlan],
    frame: PlanFrame,
    success_radius_m: float,
    *,
    has_item_names: bool,
) -> str:
    """Return a stage's house and what happened in it, as the content of an `svg` element."""
    floor_plan = maps.get(record.stage)
    names = item_labels(floor_plan.objects, frame) if has_item_names and floor_plan is not None else ""
    return house_drawing(record, maps, frame, names) + course(record, frame, success_radius_m)


def house_drawing(
    record: StageRecord, maps: Mapping[int, FloorPlan], frame: PlanFrame, item_names: str = "", *, on_it: str = ""
) -> str:
    """Return the house of a stage, with what moved before it, `on_it`, and the names of its rooms on top."""
    floor_plan, changed = maps.get(record.stage), change(record, maps, frame)
    if floor_plan is None:
        return changed + on_it
    return ground(floor_plan, frame) + changed + item_names + on_it + labels(floor_plan, frame)


def sheet(title: str, content: str, width_px: int, top_px: int, margin_px: int, *, foot: str = "", foot_px: int) -> str:
    """Return a picture as an SVG document: its content, the legend of maps from `top_px` on, and a foot below it."""
    legend, legend_px = legend_row(width_px - 2 * margin_px)
    height_px = top_px + legend_px + foot_px
    below = f'<g transform="translate({margin_px} {top_px + legend_px})">{foot}</g>' if foot else ""
    page = f'<rect class="page" width="100%" height="100%" rx="10"/>{content}'
    key = f'<g transform="translate({margin_px} {top_px})">{legend}</g>'
    return map_file(title, (width_px, height_px), page + key + below)


def panel(
    record: StageRecord,
    drawing: str,
    frame: PlanFrame,
    place_px: tuple[int, int],
    width_px: int,
    heading: tuple[str, str],
    captions: Sequence[tuple[str, int, str]],
) -> str:
    """Draw a stage's map with its outcome and captions below it.

    `heading` is the name before the outcome, and the CSS class of the outcome. `captions` are CSS class, distance of
    the base line from the map, and text.
    """
    height_px = panel_height_px(frame, width_px)
    name, css = heading
    lines = join(f'<text class="{css}" y="{height_px + y}">{escape(text)}</text>' for css, y, text in captions)
    return (
        f'<g transform="translate({place_px[0]} {place_px[1]})"><svg width="{width_px}" height="{height_px}" '
        f'viewBox="{frame.view_box}">{drawing}</svg>'
        f'<text class="verdict" y="{height_px + 18}"><tspan class="ink">{escape(name)}</tspan> '
        f'<tspan class="{css}">{escape(describe_outcome(record))}</tspan></text>{lines}</g>'
    )


def panel_height_px(frame: PlanFrame, width_px: int) -> int:
    """Return the height of a map of some width."""
    return round(width_px * frame.height / frame.width)


def instruction_lines(text: str, width: int, max_lines: int, place: str = "") -> str:
    """Draw an instruction in lines of at most `width` letters; `place` holds further attributes of the lines."""
    return join(
        f'<text class="instruction"{place} y="{48 + 17 * i}">{escape(line)}</text>'
        for i, line in enumerate(text_lines(text, width, max_lines))
    )


def reference_image(floor_plan: FloorPlan | None, right_px: int, top_px: int, size_px: int) -> str:
    """Draw the reference image of a stage, where it has one."""
    if floor_plan is None or floor_plan.reference_image is None:
        return ""
    box = f'x="{right_px - size_px}" y="{top_px}" width="{size_px}" height="{size_px}"'
    return f'<image href="{escape(floor_plan.reference_image)}" {box}/>'
