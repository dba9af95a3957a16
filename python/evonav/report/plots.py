"""Plots as data: rates by group, rates along a number, differences around zero.

`plot_svg` draws them for pages, `figures.write_plots` with matplotlib for papers.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from evonav.report.line_chart import COLOURS, Line, line_chart, plot_file
from evonav.report.maps.svg import escape, join, title
from evonav.significance import Interval

ROW_PX, HEAD_PX, FOOT_PX = 24, 56, 46
GROUP_HEIGHT, GROUP_TOP, GROUP_BOTTOM, GROUP_LEFT = 250, 46, 62, 48
DOT_PX = 15


@dataclass(frozen=True, slots=True)
class Dots:
    """One agent's values in every group; `None` where it has none."""

    name: str
    values: tuple[float | None, ...]
    intervals: tuple[Interval | None, ...]


@dataclass(frozen=True, slots=True)
class GroupPlot:
    """Values in groups, in percent unless `unit` says otherwise."""

    title: str
    groups: tuple[str, ...]
    """Each with its n."""
    series: tuple[Dots, ...]
    y_words: str


@dataclass(frozen=True, slots=True)
class CurvePlot:
    """Percentages along a number."""

    title: str
    lines: tuple[Line, ...]
    x_words: str
    y_words: str


@dataclass(frozen=True, slots=True)
class Gap:
    """A difference with its interval, in percentage points."""

    name: str
    detail: str
    value: float
    interval: Interval | None
    is_head: bool = False
    """Stressed: it is no tie."""


@dataclass(frozen=True, slots=True)
class GapPlot:
    """Differences around zero, a row each."""

    title: str
    gaps: tuple[Gap, ...]
    left_words: str
    """What it means to lie left of zero."""
    right_words: str


Plot = GroupPlot | CurvePlot | GapPlot


def plot_svg(plot: Plot, *, is_inline: bool = False) -> str:
    """A plot as an SVG file, readable on light and dark pages.

    Args:
        plot: What to draw.
        is_inline: For a page that has `PLOT_CSS`.
    """
    if isinstance(plot, CurvePlot):
        return line_chart(plot.lines, plot.title, plot.x_words, plot.y_words, is_inline=is_inline)
    width, height, parts = _gap_parts(plot) if isinstance(plot, GapPlot) else _group_parts(plot)
    return plot_file(width, height, plot.title, parts, is_inline=is_inline)


def ticks(low: float, high: float, most: int = 8) -> list[float]:
    """Round numbers that span a range: 1, 2 or 5 times a power of ten apart."""
    high = high if high - low > 1e-9 else low + 1.0
    span = high - low
    steps = [digit * 10.0**power for power in range(-3, 5) for digit in (1, 2, 5)]
    step = next((step for step in steps if span / step <= most - 1), steps[-1])
    first = int(low // step)
    count = int(-((step * first - high) // step))
    return [round(step * (first + i), 6) for i in range(count + 1)]


def gap_range(plot: GapPlot) -> list[float]:
    """Ticks of a plot of differences; zero is one of them."""
    ends = [end for gap in plot.gaps for end in (gap.interval or (gap.value, gap.value))]
    return ticks(min([0.0, *ends]), max([0.0, *ends]))


def group_range(plot: GroupPlot) -> list[float]:
    """Ticks from zero to above the highest interval."""
    ends = [end[1] for dots in plot.series for end in dots.intervals if end is not None]
    values = [value for dots in plot.series for value in dots.values if value is not None]
    return ticks(0.0, max([1e-6, *ends, *values]), 7)


def _gap_parts(plot: GapPlot) -> tuple[float, float, list[str]]:
    label = 7.0 * max([len(gap.name) for gap in plot.gaps], default=0) + 28
    detail = 6.4 * max([len(gap.detail) for gap in plot.gaps], default=0) + 24
    width, height = label + 400 + detail, HEAD_PX + ROW_PX * len(plot.gaps) + FOOT_PX
    marks = gap_range(plot)
    low, high = marks[0], marks[-1]

    def x_of(value: float) -> float:
        return label + 400 * (value - low) / (high - low)

    bottom = height - FOOT_PX
    parts = [f'<text class="head" x="14" y="22">{escape(plot.title)}</text>']
    for mark in marks:
        css = "zero" if mark == 0 else "grid"
        parts.append(f'<path class="{css}" d="M{x_of(mark):.1f} {HEAD_PX - 10}V{bottom}"/>')
        parts.append(f'<text x="{x_of(mark):.1f}" y="{bottom + 17}" text-anchor="middle">{_signed(mark)}</text>')
    zero_x = x_of(0.0)
    left = f'class="soft" x="{zero_x - 8:.1f}" y="{height - 10}" text-anchor="end"'
    parts.append(f"<text {left}>← {escape(plot.left_words)}</text>")
    parts.append(f'<text class="soft" x="{zero_x + 8:.1f}" y="{height - 10}">{escape(plot.right_words)} →</text>')
    for i, gap in enumerate(plot.gaps):
        y = HEAD_PX + ROW_PX * (i + 0.5)
        colour = COLOURS[0] if gap.is_head else "#667085"
        weight = ' font-weight="600"' if gap.is_head else ""
        told = f"{gap.name}: {gap.value:+.1f}" + (
            "" if gap.interval is None else " [{:+.1f}, {:+.1f}]".format(*gap.interval)
        )
        parts.append(f'<g>{title(told)}<text x="14" y="{y + 4}"{weight}>{escape(gap.name)}</text>')
        if gap.interval is not None:
            ends = [x_of(end) for end in gap.interval]
            parts.append(f'<path d="M{ends[0]:.1f} {y}H{ends[1]:.1f}" stroke="{colour}" stroke-width="2"/>')
        parts.append(f'<circle cx="{x_of(gap.value):.1f}" cy="{y}" r="4.5" fill="{colour}"/>')
        parts.append(f'<text class="soft" x="{label + 412}" y="{y + 4}">{escape(gap.detail)}</text></g>')
    return width, height, parts


def _group_parts(plot: GroupPlot) -> tuple[float, float, list[str]]:
    num = max(1, len(plot.series))
    longest = max([len(line) for group in plot.groups for line in group.split("\n")], default=1)
    slot = max(DOT_PX * num + 26, 6.6 * longest + 12)
    marks = group_range(plot)
    legend = _legend([dots.name for dots in plot.series])
    width = max(GROUP_LEFT + slot * len(plot.groups) + 14, legend[1] + GROUP_LEFT, 7.6 * len(plot.title) + 28)
    height = GROUP_TOP + GROUP_HEIGHT + GROUP_BOTTOM
    floor = GROUP_TOP + GROUP_HEIGHT

    def y_of(value: float) -> float:
        return floor - GROUP_HEIGHT * (value - marks[0]) / (marks[-1] - marks[0])

    right = GROUP_LEFT + slot * len(plot.groups)
    parts = [f'<text class="head" x="14" y="20">{escape(plot.title)}</text>']
    parts.append(f'<text class="soft" x="14" y="37">{escape(plot.y_words)}</text>')
    for mark in marks:
        parts.append(f'<path class="grid" d="M{GROUP_LEFT} {y_of(mark):.1f}H{right:.1f}"/>')
        parts.append(f'<text x="{GROUP_LEFT - 7}" y="{y_of(mark) + 4:.1f}" text-anchor="end">{mark:g}</text>')
    for i, group in enumerate(plot.groups):
        middle = GROUP_LEFT + slot * (i + 0.5)
        for j, line in enumerate(group.split("\n")):
            css = ' class="soft"' if j else ""
            parts.append(
                f'<text{css} x="{middle:.1f}" y="{floor + 17 + 14 * j}" text-anchor="middle">{escape(line)}</text>'
            )
        for k, dots in enumerate(plot.series):
            value, interval = dots.values[i], dots.intervals[i]
            if value is None:
                continue
            x, colour = middle + DOT_PX * (k - (num - 1) / 2), COLOURS[k % len(COLOURS)]
            told = f"{dots.name}, {group}: {value:.1f}".replace("\n", ", ")
            told += "" if interval is None else " [{:.1f}, {:.1f}]".format(*interval)
            parts.append(f"<g>{title(told)}")
            if interval is not None:
                ends = [y_of(end) for end in interval]
                parts.append(
                    f'<path d="M{x:.1f} {ends[0]:.1f}V{ends[1]:.1f}" stroke="{colour}" stroke-width="2" opacity=".55"/>'
                )
            parts.append(f'<circle cx="{x:.1f}" cy="{y_of(value):.1f}" r="4" fill="{colour}"/></g>')
    parts.append(f'<g transform="translate({GROUP_LEFT} {height - 16})">{legend[0]}</g>')
    return width, height, parts


def _legend(names: Sequence[str]) -> tuple[str, float]:
    """A row of names in their colours, and its width."""
    drawn, x = [], 0.0
    for i, name in enumerate(names):
        drawn.append(f'<circle cx="{x + 4:.1f}" cy="0" r="4" fill="{COLOURS[i % len(COLOURS)]}"/>')
        drawn.append(f'<text x="{x + 13:.1f}" y="4">{escape(name)}</text>')
        x += 7.2 * len(name) + 30
    return join(drawn), x


def _signed(value: float) -> str:
    return "0" if value == 0 else f"{value:+g}"
