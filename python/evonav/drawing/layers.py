"""Draw what lies over a floor plan: cells of a map, boxes of object entries, paths and poses."""

import base64
import math
from collections.abc import Iterable, Sequence
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evonav.drawing.floor_plan import PlanFrame
from evonav.drawing.svg import Point, cm, escape, polyline, star, title
from evonav.tasks.language import noun_of

CELL_COLOURS = ((208, 212, 218), (228, 235, 248), (121, 127, 139), (196, 224, 249))
"""RGB of unknown, free, blocked and explored cells, as in the viewer on a light page."""
LETTERS = 1.7
"""Height of the names of entries, in units of a frame."""
SIGHT_UNITS = 12.0
"""Length of the sector in which a camera looks, in units of a frame."""

Box = tuple[str, Sequence[float], Sequence[float]]
"""A label, and the centre and the size of its box, `(x, y, z)` in metres."""


def cells_layer(cells: NDArray[np.uint8], cell_m: float, corner_m: Point) -> str:
    """Draw a map's cells as an image.

    Args:
        cells: `(R, C)`: 0 unknown, 1 free, 2 blocked, 3 explored.
        corner_m: `(x, z)` of the smallest corner of cell (0, 0).
    """
    rows, cols = cells.shape
    picture = Image.fromarray(np.ascontiguousarray(cells[::-1]))
    picture.putpalette([value for colour in CELL_COLOURS for value in colour])
    buffer = BytesIO()
    picture.save(buffer, "PNG", compress_level=1)
    cell_cm = 100 * cell_m
    x, y = cm(corner_m)
    box = f'x="{x}" y="{y - rows * cell_cm:.0f}" width="{cols * cell_cm:.0f}" height="{rows * cell_cm:.0f}"'
    look = 'preserveAspectRatio="none" image-rendering="optimizeSpeed"'
    uri = f"data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}"
    return f'<image {box} {look} href="{uri}"/>'


def boxes_layer(boxes: Iterable[Box], frame: PlanFrame) -> str:
    """Draw labelled boxes from above, larger ones first; a name that would lie on another is left to the tooltip."""
    u = frame.unit
    letters_cm = LETTERS * u
    drawn: list[str] = []
    names: list[str] = []
    taken: list[tuple[float, float, float]] = []
    for label, centre_m, size_m in sorted(boxes, key=lambda box: -box[2][0] * box[2][2]):
        x, y = cm((centre_m[0], centre_m[2]))
        width, depth = (max(0.8 * u, 100 * edge_m) for edge_m in (size_m[0], size_m[2]))
        name = noun_of(label)
        place = f'x="{x - width / 2:.0f}" y="{y - depth / 2:.0f}" width="{width:.0f}" height="{depth:.0f}"'
        drawn.append(f"<rect {place}>{title(name)}</rect>")
        foot, half = y - depth / 2 - 0.4 * u, 0.28 * letters_cm * len(name)
        if all(abs(foot - other[1]) >= letters_cm or abs(x - other[0]) >= half + other[2] for other in taken):
            taken.append((x, foot, half))
            names.append(f'<text x="{x}" y="{foot:.0f}">{escape(name)}</text>')
    return (
        f'<g class="entry" stroke-width="{0.35 * u:.1f}">{"".join(drawn)}</g>'
        f'<g class="tag" font-size="{letters_cm:.0f}" stroke-width="{0.5 * u:.1f}">{"".join(names)}</g>'
    )


def points_layer(points: Iterable[tuple[str, Point]], frame: PlanFrame) -> str:
    """Draw named points as diamonds."""
    r = 1.3 * frame.unit
    line = f'class="frontier" stroke-width="{0.2 * frame.unit:.1f}"'
    return "".join(
        f'<path {line} d="M{x} {y - r:.0f}l{r:.0f} {r:.0f}l{-r:.0f} {r:.0f}l{-r:.0f} {-r:.0f}z">{title(name)}</path>'
        for name, (x, y) in ((name, cm(point)) for name, point in points)
    )


def path_layer(points_m: Sequence[Point], frame: PlanFrame) -> str:
    """Draw a path with a star at its end; nothing if it has no points."""
    if not len(points_m):
        return ""
    u = frame.unit
    line = polyline([cm(point) for point in points_m])
    end = star(cm(points_m[-1]), 2.4 * u)
    return (
        f'<path class="trajectory" stroke-width="{0.9 * u:.1f}" d="{line}"/>'
        f'<path class="star" stroke-width="{0.35 * u:.1f}" d="{end}"/>'
    )


def pose_layer(point_m: Point, yaw_rad: float, fov_rad: float, frame: PlanFrame) -> str:
    """Draw where an agent stands, and the sector in which it looks."""
    u = frame.unit
    x, y = cm(point_m)
    eye = f'<circle class="eye" cx="{x}" cy="{y}" r="{1.5 * u:.1f}" stroke-width="{0.5 * u:.1f}"/>'
    return sector((x, y), yaw_rad, fov_rad, SIGHT_UNITS * u, "cone") + eye


def sector(at: tuple[int, int], yaw_rad: float, fov_rad: float, reach_cm: float, css: str) -> str:
    """Draw the sector in which a camera at `at` (page coordinates) looks."""
    (ax, ay), (bx, by) = (
        (at[0] + reach_cm * math.sin(turn), at[1] - reach_cm * math.cos(turn))
        for turn in (yaw_rad - fov_rad / 2, yaw_rad + fov_rad / 2)
    )
    arc = f"A{reach_cm:.0f} {reach_cm:.0f} 0 0 1 {bx:.0f} {by:.0f}"
    return f'<path class="{css}" d="M{at[0]} {at[1]}L{ax:.0f} {ay:.0f}{arc}z"/>'
