"""Lay out maps side by side as one picture, with captions and the legend."""

from collections.abc import Sequence

from evonav.drawing.floor_plan import Frame
from evonav.drawing.style import map_file
from evonav.drawing.svg import escape, join, text_lines
from evonav.evaluation.records.floor_plans import FloorPlan
from evonav.evaluation.records.schema import StageRecord
from evonav.report.maps.legend import legend_row
from evonav.report.maps.text import describe_outcome


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
    frame: Frame,
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


def panel_height_px(frame: Frame, width_px: int) -> int:
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
