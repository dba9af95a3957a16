"""Write small pieces of SVG: escaped text, numbers, paths, marks.

Drawings are in centimetres seen from above, x to the right and z up the page, so that coordinates are short integers.
Colours are CSS classes (`map.css`); only geometry is written here.
"""

import hashlib
import html
import math
import re
from collections.abc import Iterable, Sequence
from functools import lru_cache

Point = tuple[float, float]
"""`(x, z)` in metres, as in records."""

MAX_SLUG_LENGTH = 80
MAX_M = 1e7
TOLERANCE_CM = 2.0

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_NOT_SLUG = re.compile(r"[^A-Za-z0-9._-]+")


def clean(text: str) -> str:
    """Return `text` with the characters replaced that no XML or HTML page may hold."""
    return text if text.isprintable() else _NOT_XML.sub("\ufffd", text)


def escape(text: str) -> str:
    """Return `text` as the content of an element or a quoted attribute."""
    return html.escape(clean(text))


def slug(name: str) -> str:
    """Return a file name or anchor for `name`: ASCII, no separator, different for different names."""
    plain = _NOT_SLUG.sub("_", name).lstrip(".-")[:MAX_SLUG_LENGTH]
    if plain == name and plain:
        return plain
    digest = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    return f"{plain or 'task'}-{digest}"


def cm(point_m: Point) -> tuple[int, int]:
    """Return page coordinates of a point; the origin for one that is not finite or not on this planet."""
    x_m, z_m = point_m
    if -MAX_M < x_m < MAX_M and -MAX_M < z_m < MAX_M:
        return (round(100 * x_m), round(-100 * z_m))
    return (0, 0)


def polyline(points_cm: Sequence[tuple[int, int]], *, closed: bool = False) -> str:
    """Return path data through points, relative and without needless separators. A single point is a dot."""
    if not points_cm:
        return ""
    x, y = points_cm[0]
    parts = [f"M{x} {y}"]
    for next_x, next_y in points_cm[1:]:
        dx, dy = next_x - x, next_y - y
        if dx == 0 and dy == 0:
            continue
        parts.append(f"h{dx}" if dy == 0 else f"v{dy}" if dx == 0 else f"l{dx} {dy}")
        x, y = next_x, next_y
    if len(parts) == 1:
        return f"{parts[0]}h0"
    return "".join(parts) + ("z" if closed else "")


def simplified(points_cm: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return a polyline without the points that lie within `TOLERANCE_CM` of the line they are on (Douglas-Peucker)."""
    if len(points_cm) < 3:
        return list(points_cm)
    chosen = {0, len(points_cm) - 1}
    todo = [(0, len(points_cm) - 1)]
    while todo:
        first, last = todo.pop()
        farthest, distance_cm = first, TOLERANCE_CM
        (x, y), (end_x, end_y) = points_cm[first], points_cm[last]
        dx, dy = end_x - x, end_y - y
        length2 = dx * dx + dy * dy
        for i in range(first + 1, last):
            px, py = points_cm[i][0] - x, points_cm[i][1] - y
            along = px * dx + py * dy
            t = 0.0 if along <= 0 else 1.0 if along >= length2 else along / length2
            d = math.hypot(px - t * dx, py - t * dy)
            if d > distance_cm:
                farthest, distance_cm = i, d
        if farthest != first:
            chosen.add(farthest)
            todo += [(first, farthest), (farthest, last)]
    return [points_cm[i] for i in sorted(chosen)]


def arrow_head(tip: Point, direction: Point, size: float) -> str:
    """Return path data of a filled triangle whose tip is at `tip` (page coordinates), pointing along `direction`."""
    length = math.hypot(*direction)
    if length == 0.0:
        return ""
    ux, uy = direction[0] / length, direction[1] / length
    back = (tip[0] - ux * size, tip[1] - uy * size)
    corners = [
        tip,
        (back[0] - uy * size * 0.55, back[1] + ux * size * 0.55),
        (back[0] + uy * size * 0.55, back[1] - ux * size * 0.55),
    ]
    return polyline([(round(x), round(y)) for x, y in corners], closed=True)


def star(centre: Point, radius: float) -> str:
    """Return path data of a five-pointed star, page coordinates."""
    corners = []
    for i in range(10):
        r = radius if i % 2 == 0 else radius * 0.42
        angle = math.pi * i / 5
        corners.append((round(centre[0] + r * math.sin(angle)), round(centre[1] - r * math.cos(angle))))
    return polyline(corners, closed=True)


def cross(centre: Point, arm: float) -> str:
    """Return path data of a cross, page coordinates."""
    x, y = centre
    return f"M{x - arm:.0f} {y - arm:.0f}l{2 * arm:.0f} {2 * arm:.0f}m0 {-2 * arm:.0f}l{-2 * arm:.0f} {2 * arm:.0f}"


@lru_cache(maxsize=10_000)  # the same few thousand for all rounds and furniture of a report
def title(text: str) -> str:
    """Return a tooltip, which a screen reader reads out too."""
    return f"<title>{escape(text)}</title>"


def text_lines(text: str, width: int, max_lines: int) -> list[str]:
    """Return `text` broken into lines of at most `width` characters, with an ellipsis where it does not fit."""
    lines: list[str] = []
    for word in clean(text).split():
        if lines and len(lines[-1]) + 1 + len(word) <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word if len(word) <= width else f"{word[: width - 1]}…")
    if len(lines) > max_lines:
        lines = lines[:max_lines]
        lines[-1] = f"{lines[-1][: width - 1]}…"
    return lines


def join(parts: Iterable[str]) -> str:
    """Concatenate parts; it makes callers easier to read."""
    return "".join(parts)
