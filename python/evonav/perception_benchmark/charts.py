"""Charts of perceptions as SVG: curves in a square, and which category is told by which label."""

from collections.abc import Sequence
from dataclasses import dataclass

from evonav.report.line_chart import COLOURS, plot_file
from evonav.report.maps.svg import escape, title
from evonav.significance import Interval

SIDE_PX = 300
LEFT, RIGHT, TOP, BOTTOM = 48, 16, 48, 46
LEGEND_PX = 16
CELL_PX, ROW_PX = 46, 22
_MAX_WORDS = 22


@dataclass(frozen=True, slots=True)
class Curve:
    """Points in order of x, both in 0..1 of the axes' ranges."""

    name: str
    points: Sequence[tuple[float, float]]
    intervals: Sequence[Interval | None] = ()
    """Of each y; none: no whiskers."""
    has_dots: bool = False


@dataclass(frozen=True, slots=True)
class Axes:
    """Of a square chart."""

    heading: str
    x_words: str
    y_words: str
    x_range: tuple[float, float] = (0.0, 1.0)
    y_top: float = 1.0
    has_diagonal: bool = False
    """Where x and y are equal."""


def square_chart(axes: Axes, curves: Sequence[Curve]) -> str:
    """Curves for a page that has `PLOT_CSS`; names and colours are below."""
    width = LEFT + SIDE_PX + RIGHT
    height = TOP + SIDE_PX + BOTTOM + LEGEND_PX * len(curves)
    low, high = axes.x_range

    def x_of(x: float) -> float:
        return LEFT + SIDE_PX * (x - low) / (high - low)

    def y_of(y: float) -> float:
        return TOP + SIDE_PX * (1.0 - y / axes.y_top)

    parts = [f'<text class="head" x="{LEFT}" y="16">{escape(axes.heading)}</text>']
    for i in range(6):
        x, y = low + (high - low) * i / 5, axes.y_top * i / 5
        parts.append(f'<path class="grid" d="M{LEFT} {y_of(y):.1f}H{LEFT + SIDE_PX}"/>')
        parts.append(f'<text class="soft" x="{LEFT - 6}" y="{y_of(y) + 4:.1f}" text-anchor="end">{y:.2g}</text>')
        parts.append(
            f'<text class="soft" x="{x_of(x):.1f}" y="{TOP + SIDE_PX + 17}" text-anchor="middle">{x:.2g}</text>'
        )
    if axes.has_diagonal:
        ends = f"M{x_of(low):.1f} {y_of(low):.1f}L{x_of(high):.1f} {y_of(high):.1f}"
        parts.append(f'<path class="zero" stroke-dasharray="4 4" d="{ends}"/>')
    parts.append(f'<text class="soft" x="{LEFT}" y="35">{escape(axes.y_words)}</text>')
    middle = LEFT + SIDE_PX / 2
    parts.append(f'<text x="{middle}" y="{TOP + SIDE_PX + 36}" text-anchor="middle">{escape(axes.x_words)}</text>')
    for i, curve in enumerate(curves):
        colour = COLOURS[i % len(COLOURS)]
        dash = "" if i < len(COLOURS) else ' stroke-dasharray="6 3"'
        path = "M" + "L".join(f"{x_of(x):.1f} {y_of(min(y, axes.y_top)):.1f}" for x, y in curve.points)
        if curve.points:
            parts.append(f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="2"{dash}/>')
        for (x, _), interval in zip(curve.points, curve.intervals, strict=False):
            if interval is not None:
                whisker = f"M{x_of(x):.1f} {y_of(interval[0]):.1f}V{y_of(min(interval[1], axes.y_top)):.1f}"
                parts.append(f'<path d="{whisker}" stroke="{colour}" opacity=".45"/>')
        for x, y in curve.points if curve.has_dots else ():
            told = title(f"{curve.name}: {y:.3f} at {x:.3f}")
            parts.append(f'<circle cx="{x_of(x):.1f}" cy="{y_of(y):.1f}" r="3.5" fill="{colour}">{told}</circle>')
        legend_y = TOP + SIDE_PX + BOTTOM + LEGEND_PX * i + 4
        parts.append(f'<path d="M{LEFT} {legend_y - 4}h22" stroke="{colour}" stroke-width="2"{dash}/>')
        parts.append(f'<text x="{LEFT + 28}" y="{legend_y}">{escape(_short(curve.name, 44))}</text>')
    return plot_file(width, height, axes.heading, parts, is_inline=True)


@dataclass(frozen=True, slots=True)
class ConfusionRow:
    """What the objects of a category were taken for."""

    category: str
    num: int
    shares: Sequence[float]
    """Of its objects, one a column."""


def confusion_chart(heading: str, columns: Sequence[str], rows: Sequence[ConfusionRow]) -> str:
    """A table in shades, for a page that has `PLOT_CSS`: the first column is right, the second nothing."""
    label_px = 8 + 6.6 * max(len(_short(row.category)) + 8 for row in rows)
    slant_px = 4.8 * max(len(_short(column)) for column in columns)
    head_px = 40 + slant_px
    width = max(label_px + CELL_PX * len(columns) + slant_px, 16 + 8.0 * len(heading))
    height = head_px + ROW_PX * len(rows) + 10
    parts = [f'<text class="head" x="8" y="16">{escape(heading)}</text>']
    for j, column in enumerate(columns):
        x, y = label_px + CELL_PX * (j + 0.5), head_px - 8
        turn = f'transform="rotate(-45 {x:.1f} {y:.1f})"'
        parts.append(f'<text x="{x:.1f}" y="{y:.1f}" {turn}>{escape(_short(column))}</text>')
    for i, row in enumerate(rows):
        y = round(head_px + ROW_PX * i, 1)
        name = f"{_short(row.category)} ({row.num})"
        parts.append(f'<text x="{label_px - 8:.1f}" y="{y + 15}" text-anchor="end">{escape(name)}</text>')
        for j, share in enumerate(row.shares):
            colour = COLOURS[0] if j == 0 else "#667085" if j == 1 else COLOURS[1]
            x = label_px + CELL_PX * j
            box = f'x="{x:.1f}" y="{y}" width="{CELL_PX - 2}" height="{ROW_PX - 2}"'
            told = title(f"{row.category}: {columns[j]} {100 * share:.1f}%")
            parts.append(f'<rect {box} fill="{colour}" fill-opacity="{min(0.85, share):.3f}">{told}</rect>')
            if share >= 0.005:
                middle = x + CELL_PX / 2 - 1
                parts.append(f'<text x="{middle:.1f}" y="{y + 15}" text-anchor="middle">{100 * share:.0f}</text>')
    return plot_file(width, height, heading, parts, is_inline=True)


def _short(name: str, most: int = _MAX_WORDS) -> str:
    return name if len(name) <= most else f"{name[: most - 1]}…"
