"""A line chart as SVG, drawn by hand: readable on light and dark pages."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from evonav.report.maps.svg import escape, join, title
from evonav.significance import Interval

WIDTH, HEIGHT = 560, 330
LEFT, RIGHT, TOP, BOTTOM = 48, 110, 36, 46
COLOURS = ("#2f66cb", "#c2410c", "#15803d", "#7c3aed", "#a16207", "#0e7490")
"""Dark enough for white pages, light enough for black ones."""


@dataclass(frozen=True, slots=True)
class Line:
    """Points in order of x."""

    name: str
    points: Sequence[tuple[float, float]]
    intervals: Sequence[Interval | None]
    """Of each y."""


def line_chart(
    lines: Sequence[Line],
    heading: str,
    x_words: str,
    y_words: str,
    *,
    x_names: Sequence[str] | None = None,
    is_inline: bool = False,
) -> str:
    """An SVG file; y from 0 to the next ten above the largest value, whiskers a hair apart.

    Args:
        lines: At most six.
        heading: Of the chart.
        x_words: Of the axis.
        y_words: Of the axis.
        x_names: What to write below x = 0, 1, ... instead of the numbers.
        is_inline: For a page that has `PLOT_CSS`.
    """
    xs = sorted({x for line in lines for x, _ in line.points})
    highest = max([y for line in lines for _, y in line.points], default=0.0)
    ends = [end[1] for line in lines for end in line.intervals if end is not None]
    top = 10.0 * max(1, -int(-max([highest, *ends]) // 10))
    span = (xs[-1] - xs[0] if len(xs) > 1 else 0.0) or 1.0

    def x_of(x: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * (x - xs[0]) / span

    def y_of(y: float) -> float:
        return HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * y / top

    parts = [f'<text class="head" x="{LEFT}" y="20">{escape(heading)}</text>']
    for i in range(0, round(top) + 1, 20 if top > 50 else 10):
        parts.append(f'<path class="grid" d="M{LEFT} {y_of(i):.1f}H{WIDTH - RIGHT}"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y_of(i) + 4:.1f}" text-anchor="end">{i}</text>')
    for x in xs:
        name = f"{x:g}" if x_names is None else escape(x_names[round(x)])
        parts.append(f'<text x="{x_of(x):.1f}" y="{HEIGHT - BOTTOM + 18}" text-anchor="middle">{name}</text>')
    middle = (LEFT + WIDTH - RIGHT) / 2
    parts.append(f'<text x="{middle:.1f}" y="{HEIGHT - 8}" text-anchor="middle">{escape(x_words)}</text>')
    parts.append(f'<text x="10" y="{TOP - 8}">{escape(y_words)}</text>')
    labels = _spread([(y_of(line.points[-1][1]), i) for i, line in enumerate(lines)])
    for i, line in enumerate(lines):
        parts.append(_line(line, COLOURS[i % len(COLOURS)], 3.0 * (i - (len(lines) - 1) / 2), x_of, y_of, labels[i]))
    return plot_file(WIDTH, HEIGHT, heading, parts, is_inline=is_inline)


def plot_file(width: float, height: float, heading: str, parts: Sequence[str], *, is_inline: bool) -> str:
    """Parts of a plot as an `svg` element, with its style unless the page has that.

    Args:
        width: Of the plot, in pixels.
        height: Of the plot, in pixels.
        heading: Read out in its place.
        parts: Its elements.
        is_inline: For a page that has `PLOT_CSS`, and whose policy forbids any other style.
    """
    style = "" if is_inline else f"<style>{PLOT_CSS}</style>"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="plot" viewBox="0 0 {width:g} {height:g}" width="{width:g}"'
        f' role="img" aria-label="{escape(heading)}">{style}'
        f'<rect class="page" width="{width:g}" height="{height:g}"/>{join(parts)}</svg>\n'
    )


PLOT_CSS = (
    ".plot{font:12px system-ui,sans-serif;max-width:100%;height:auto}.plot text:not([fill]){fill:#1f2530}"
    ".plot .soft:not([fill]){fill:#667085}.plot .head{font-weight:600;font-size:14px}.plot .page{fill:#fff}"
    ".plot .grid{stroke:#e2e5ea;fill:none}.plot .zero{stroke:#667085;fill:none}"
    "@media(prefers-color-scheme:dark){.plot text:not([fill]){fill:#e6e9ef}.plot .soft:not([fill]){fill:#98a1b3}"
    ".plot .page{fill:#14171c}.plot .grid{stroke:#2a2f38}.plot .zero{stroke:#98a1b3}}"
)
"""Of all plots, on light and dark pages."""


def _line(
    line: Line,
    colour: str,
    shift_px: float,
    x_of: Callable[[float], float],
    y_of: Callable[[float], float],
    label_y: float,
) -> str:
    places = [(x_of(x) + shift_px, y_of(y)) for x, y in line.points]
    path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in places)
    parts = [f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="2"/>']
    for (x, y), (value_x, value_y), ends in zip(places, line.points, line.intervals, strict=True):
        if ends is not None:
            low, high = (y_of(end) for end in ends)
            parts.append(f'<path d="M{x:.1f} {low:.1f}V{high:.1f}" stroke="{colour}" opacity=".45"/>')
        words = f"{line.name}: {value_y:.1f} at {value_x:g}"
        parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{colour}">{title(words)}</circle>')
    end_x, end_y = places[-1]
    parts.append(f'<path d="M{end_x + 5:.1f} {end_y:.1f}L{WIDTH - RIGHT + 22} {label_y:.1f}" stroke="{colour}"/>')
    name_x = WIDTH - RIGHT + 26
    parts.append(f'<text x="{name_x}" y="{label_y + 4:.1f}" fill="{colour}">{escape(line.name)}</text>')
    return join(parts)


def _spread(wanted: Sequence[tuple[float, int]], gap: float = 14.0) -> dict[int, float]:
    """Places for labels, none nearer to another than `gap`, in the order of the places wanted."""
    placed: dict[int, float] = {}
    last = float("-inf")
    for y, index in sorted(wanted):
        last = max(y, last + gap)
        placed[index] = last
    return placed
