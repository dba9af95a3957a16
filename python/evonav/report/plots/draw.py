"""Draw plots with matplotlib: one function a kind of plot, and the room that each kind needs."""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from evonav.drawing.svg import clean
from evonav.report.plots.specs import (
    BarPlot,
    ConfusionPlot,
    CurvePlot,
    GapPlot,
    GroupPlot,
    Line,
    Plot,
    ScatterPlot,
    Series,
)
from evonav.report.plots.style import BAND, COLOURS, INK, PALE, PAPER, REFERENCE, SOFT
from evonav.report.tables.numbers import number, with_interval
from evonav.statistics import Interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

TOOLTIP = "tooltip:"
"""Begins the id of an element that has a tooltip: the rest of the id is its text."""
LETTER_IN = 0.07
"""Width of a letter."""
SMALL, LARGE = 8, 10
"""Sizes of letters, in points; the others are 9 points high."""
MAX_NAME, MAX_TICKS, MAX_LETTERS = 22, 12, 44
REFERENCE_LABEL = "the paper"
CELL_IN, ROW_IN = 0.46, 0.23
_COUNTS = (0, 1, 2, 3, 5, 10, 20, 50, 100, 200, 500, 1000)
"""Ticks of an axis of counts, which is logarithmic from 1 on."""
_NAME_HEIGHT = 0.062
"""Distance of two names beside dots, as a share of the axes' height."""


def size_in(plot: Plot) -> tuple[float, float]:
    """Return the width and height that a plot needs, in inches."""
    title = 0.085 * len(plot.title) + 0.4
    if isinstance(plot, GapPlot):
        names, details = (_longest(text) for text in zip(*((gap.name, gap.detail) for gap in plot.gaps), strict=True))
        return max(title, LETTER_IN * (names + details) + 4.6), 0.95 + 0.25 * len(plot.gaps)
    if isinstance(plot, ConfusionPlot):
        names, heads = _longest([_short(row.category) for row in plot.rows]), _longest(map(_short, plot.columns))
        width = LETTER_IN * (names + 8) + CELL_IN * len(plot.columns) + 0.05 * heads
        return max(title, width), 0.7 + 0.055 * heads + ROW_IN * len(plot.rows)
    if isinstance(plot, ScatterPlot):
        return max(title, 7.2), 4.4
    if isinstance(plot, CurvePlot):
        return (3.7, 3.6 + 0.17 * len(plot.lines)) if plot.is_square else (max(title, 5.6), 3.5)
    slot = LETTER_IN * _longest(line for group in plot.groups for line in group.split("\n")) + 0.14
    legend = sum(LETTER_IN * len(one.name) + 0.5 for one in plot.series)
    if isinstance(plot, BarPlot):
        slot = 0.32 if _is_slanted(plot) else slot
        return max(title, legend, 4.3, 0.7 + slot * len(plot.groups)), 3.2 + 0.17 * len(plot.notes)
    slot = max(slot, 0.16 * len(plot.series) + 0.27)
    return max(title, legend, 0.75 + slot * len(plot.groups)), 3.4


def draw(panel: "SubFigure", plot: Plot) -> None:
    """Draw a plot into a part of a figure."""
    width_in = panel.bbox.width / panel.get_figure(root=True).dpi
    panel.suptitle(clean(plot.title), x=0.12 / width_in, ha="left", fontsize=LARGE, fontweight="bold", color=INK)
    axes = panel.subplots()
    _DRAWING[type(plot)](axes, plot)
    handles, names = axes.get_legend_handles_labels()
    if isinstance(plot, BarPlot):
        # Bars first, then what they are compared with.
        order = sorted(range(len(names)), key=lambda i: names[i] in (REFERENCE_LABEL, plot.band_label))
        handles, names = [handles[i] for i in order], [names[i] for i in order]
    if len(names) > 1 or isinstance(plot, GroupPlot):
        # What a square plot compares has long names: a row each.
        is_square = isinstance(plot, CurvePlot) and plot.is_square
        longest_in = max(LETTER_IN * len(name) + 0.5 for name in (*names, ""))
        columns = 1 if is_square else max(1, min(len(names), int(width_in / longest_in)))
        panel.legend(handles, names, loc="outside lower left", ncols=columns, fontsize=SMALL, columnspacing=1.2)


def _draw_gaps(axes: "Axes", plot: GapPlot) -> None:
    axes.axvline(0, color=SOFT, linewidth=0.8)
    for i, gap in enumerate(plot.gaps):
        colour = COLOURS[0] if gap.is_emphasised else SOFT
        if gap.interval is not None:
            axes.plot(gap.interval, (i, i), color=colour)
        _mark(axes, gap.value, i, colour, f"{gap.name}: {_value_text(gap.value, gap.interval, is_signed=True)}")
        place: dict[str, Any] = {
            "xycoords": ("axes fraction", "data"),
            "va": "center",
            "color": SOFT,
            "fontsize": SMALL,
        }
        axes.annotate(clean(gap.detail), (1.02, i), **place)
    names = axes.set_yticks(range(len(plot.gaps)), [clean(gap.name) for gap in plot.gaps])
    for tick, gap in zip(names, plot.gaps, strict=True):
        tick.label1.set_fontweight("bold" if gap.is_emphasised else "normal")
    axes.set_ylim(len(plot.gaps) - 0.5, -0.5)
    axes.xaxis.set_major_formatter(lambda value, _: "0" if abs(value) < 1e-9 else f"{value:+g}")
    axes.grid(axis="x")
    axes.tick_params(length=0)
    axes.spines[["left", "bottom"]].set_visible(False)
    for text, shift, side in ((f"← {plot.left_label}", -6, "right"), (f"{plot.right_label} →", 6, "left")):
        axes.annotate(
            clean(text),
            (0, 0),
            xycoords=("data", "axes fraction"),
            xytext=(shift, -28),
            textcoords="offset points",
            ha=side,
            color=SOFT,
            fontsize=SMALL,
        )


def _draw_groups(axes: "Axes", plot: GroupPlot) -> None:
    for k, series in enumerate(plot.series):
        colour, shift = COLOURS[k % len(COLOURS)], _shift(k, len(plot.series), 0.7)
        for i, (value, interval) in enumerate(zip(series.values, series.intervals, strict=True)):
            if value is not None:
                _whisker(axes, i + shift, interval, colour)
                text = f"{series.name}, {plot.groups[i]}: {_value_text(value, interval)}".replace("\n", ", ")
                _mark(axes, i + shift, value, colour, text)
        axes.plot([], [], "o", color=colour, label=_name(series.name))
    _name_groups(axes, plot.groups, is_slanted=False)
    axes.set_ylim(bottom=0)
    axes.grid(axis="y")
    axes.set_ylabel(clean(plot.y_label))


def _draw_bars(axes: "Axes", plot: BarPlot) -> None:
    if plot.band is not None:
        axes.axvspan(plot.band[0] - 0.5, plot.band[1] + 0.5, color=BAND, zorder=0, label=_name(plot.band_label))
    colours = (PALE, REFERENCE) if plot.has_values else (COLOURS[0], PALE)
    for k, series in enumerate(plot.series):
        for i in range(len(plot.groups)):
            _draw_bar(axes, plot, series, i, _shift(k, len(plot.series), 0.8), colours[k])
    _draw_references(axes, plot)
    _name_groups(axes, plot.groups, is_slanted=_is_slanted(plot))
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}%")
    axes.set_ylim(bottom=0, top=plot.y_top)
    axes.grid(axis="y")
    axes.set_xlabel("\n".join(clean(line) for line in (plot.x_label, *plot.notes) if line), fontsize=SMALL)


def _draw_bar(axes: "Axes", plot: BarPlot, series: Series, index: int, shift: float, colour: str) -> None:
    value, interval = series.values[index], series.intervals[index]
    if value is None:
        return
    x, width = index + shift, 0.8 / len(plot.series)
    text = f"{plot.groups[index]}, {series.name}: {_value_text(value, interval, unit='%')}".replace("\n", " ")
    axes.bar(x, value, width, color=colour, gid=TOOLTIP + clean(text), label=_name(series.name, index))
    _whisker(axes, x, interval, INK, alpha=1.0, has_caps=True)
    if plot.has_values:
        top = (x, value if interval is None else interval[1])
        look: dict[str, Any] = {"ha": "center", "color": SOFT, "fontsize": SMALL}
        axes.annotate(f"{value:.0f}", top, xytext=(0, 3), textcoords="offset points", **look)


def _draw_references(axes: "Axes", plot: BarPlot) -> None:
    look: dict[str, Any] = {"color": REFERENCE, "markeredgecolor": PAPER, "markeredgewidth": 0.6, "linestyle": "none"}
    found = [(i, value) for i, value in enumerate(plot.references) if value is not None]
    for k, (i, value) in enumerate(found):
        text = f"{plot.groups[i]}, {REFERENCE_LABEL}: {value:.1f}%"
        axes.plot(i, value, "D", gid=TOOLTIP + clean(text), label=_name(REFERENCE_LABEL, k), **look)


def _draw_curves(axes: "Axes", plot: CurvePlot) -> None:
    xs = sorted({x for line in plot.lines for x, _ in line.points})
    low, high = plot.x_range or (xs[0], xs[-1]) if xs else (0.0, 1.0)
    if plot.has_diagonal:
        axes.plot((low, high), (low, high), color=SOFT, linewidth=0.8, linestyle=(0, (4, 4)))
    for k, line in enumerate(plot.lines):
        # Intervals of lines with the same places would lie on each other.
        shift = (high - low) * _shift(k, len(plot.lines), 0.01 * len(plot.lines)) if line.intervals else 0.0
        _draw_line(axes, line, COLOURS[k % len(COLOURS)], shift, is_dashed=k >= len(COLOURS))
    if plot.x_names:
        axes.set_xticks(range(len(plot.x_names)), list(map(clean, plot.x_names)))
    elif not plot.is_square and len(xs) <= MAX_TICKS:
        axes.set_xticks(xs, [f"{x:g}" for x in xs])
    if plot.is_square:
        axes.set_xlim(low, high)
        axes.set_box_aspect(1)
    axes.set_ylim(bottom=0, top=plot.y_top)
    axes.grid(axis="y")
    axes.set_xlabel(clean(plot.x_label))
    axes.set_ylabel(clean(plot.y_label))


def _draw_line(axes: "Axes", line: Line, colour: str, shift: float, *, is_dashed: bool) -> None:
    xs, ys = [x + shift for x, _ in line.points], [y for _, y in line.points]
    axes.plot(
        xs, ys, color=colour, label=_name(line.name), linestyle=(0, (6, 3)) if is_dashed else "solid", clip_on=False
    )
    for x, interval in zip(xs, line.intervals, strict=False):
        _whisker(axes, x, interval, colour)
    if line.has_dots:
        for x, (place, value) in zip(xs, line.points, strict=True):
            _mark(axes, x, value, colour, f"{line.name}: {_short_number(value)} at {place:g}")


def _draw_dots(axes: "Axes", plot: ScatterPlot) -> None:
    ends = [dot.y if dot.y_interval is None else dot.y_interval[1] for dot in plot.dots if dot.y is not None]
    top = 1.5 * max([1.0, *(end for end in ends if end is not None and math.isfinite(end))])
    largest = max([0.0, *(dot.size or 0.0 for dot in plot.dots)])
    axes.set_xscale("log")
    axes.margins(x=0.15)
    for axis in (axes.xaxis.set_major_formatter, axes.xaxis.set_minor_formatter):
        axis(lambda value, _: f"{value:g}")
    for k, dot in enumerate(sorted(plot.dots, key=lambda dot: -(dot.size or 0.0))):
        colour, y = COLOURS[k % len(COLOURS)], top if dot.y is None else dot.y
        area = 20 + (200 * (dot.size or 0.0) / largest if largest else 0.0)
        if dot.x_interval is not None:
            axes.plot(dot.x_interval, (y, y), color=colour, alpha=0.5)
        if dot.y is not None and dot.y_interval is not None:
            low, high = dot.y_interval
            axes.plot((dot.x, dot.x), (low, min(high, top)), color=colour, alpha=0.5)
        reached = plot.beyond if dot.y is None else _short_number(dot.y)
        text = f"{dot.name}: {_short_number(dot.x)}, {reached}{', ' if dot.size_text else ''}{dot.size_text}"
        look: dict[str, Any] = {"facecolors": "none" if dot.y is None else colour, "edgecolors": colour, "alpha": 0.75}
        axes.scatter([dot.x], [y], s=area, clip_on=False, gid=TOOLTIP + clean(text), **look)
    axes.set_yscale("symlog", linthresh=1.0)
    axes.set_yticks([tick for tick in _COUNTS if tick <= top], [f"{tick:g}" for tick in _COUNTS if tick <= top])
    axes.set_ylim(bottom=0, top=top)
    _name_dots(axes, [(dot.x, top if dot.y is None else dot.y, dot.name) for dot in plot.dots])
    axes.grid(axis="y")
    axes.set_xlabel(clean(plot.x_label))
    axes.set_ylabel(clean(plot.y_label))
    if any(dot.y is None for dot in plot.dots):
        look = {"xycoords": "axes fraction", "va": "bottom", "color": SOFT, "fontsize": SMALL}
        axes.annotate(clean(f"open: {plot.beyond}"), (0.0, 1.06), **look)


def _name_dots(axes: "Axes", places: Sequence[tuple[float, float, str]]) -> None:
    """Write the names in a column right of the axes, by height, each with a line from its dot."""
    ordered = sorted(places, key=lambda place: (-place[1], -place[0]))
    to_axes = axes.transData + axes.transAxes.inverted()
    heights = [float(to_axes.transform((x, y))[1]) for x, y, _ in ordered]
    for order, is_below in ((range(1, len(heights)), True), (range(len(heights) - 2, -1, -1), False)):
        for i in order:  # from the top down, and then, what was pushed below the axes, up again
            limit = heights[i - 1] - _NAME_HEIGHT if is_below else max(heights[i + 1], 0.0) + _NAME_HEIGHT
            heights[i] = min(heights[i], limit) if is_below else max(heights[i], limit)
    for (x, y, name), height in zip(ordered, heights, strict=True):
        axes.annotate(
            clean(name),
            (x, y),
            xytext=(1.04, max(height, 0.0)),
            textcoords="axes fraction",
            va="center",
            fontsize=SMALL,
            color=INK,
            arrowprops={"arrowstyle": "-", "color": SOFT, "linewidth": 0.5, "shrinkA": 2, "shrinkB": 0},
        )


def _draw_confusions(axes: "Axes", plot: ConfusionPlot) -> None:
    for i, row in enumerate(plot.rows):
        for j, share in enumerate(row.shares):
            colour = COLOURS[0] if j == 0 else SOFT if j == 1 else COLOURS[1]
            text = f"{row.category}: {plot.columns[j]} {100 * share:.1f}%"
            look: dict[str, Any] = {
                "color": colour,
                "alpha": min(0.85, share),
                "linewidth": 0,
                "gid": TOOLTIP + clean(text),
            }
            axes.barh(i, 0.94, height=0.9, left=j - 0.47, **look)
            if share >= 0.005:
                axes.text(j, i, f"{100 * share:.0f}", ha="center", va="center", fontsize=SMALL)
    names = [f"{_short(row.category)} ({row.num})" for row in plot.rows]
    axes.set_yticks(range(len(plot.rows)), names, fontsize=SMALL)
    axes.set_xticks(range(len(plot.columns)), list(map(_short, plot.columns)), fontsize=SMALL, rotation=45, ha="left")
    axes.tick_params(length=0, top=False, labeltop=True, labelbottom=False)
    axes.set_xlim(-0.5, len(plot.columns) - 0.5)
    axes.set_ylim(len(plot.rows) - 0.5, -0.5)
    axes.spines[:].set_visible(False)


def _mark(axes: "Axes", x: float, y: float, colour: str, text: str) -> None:
    axes.plot(x, y, "o", color=colour, markeredgewidth=0, clip_on=False, gid=TOOLTIP + clean(text))


def _whisker(
    axes: "Axes", x: float, interval: Interval | None, colour: str, *, alpha: float = 0.5, has_caps: bool = False
) -> None:
    if interval is not None:
        caps: dict[str, Any] = (
            {"marker": "_", "markersize": 4, "markeredgewidth": 0.9, "linewidth": 0.9} if has_caps else {}
        )
        axes.plot((x, x), interval, color=colour, alpha=alpha, clip_on=False, **caps)


def _name_groups(axes: "Axes", groups: Sequence[str], *, is_slanted: bool) -> None:
    turn: dict[str, Any] = {"rotation": 35, "ha": "right", "rotation_mode": "anchor"} if is_slanted else {}
    axes.set_xticks(range(len(groups)), list(map(clean, groups)), fontsize=SMALL, **turn)
    axes.set_xlim(-0.5, len(groups) - 0.5)
    axes.tick_params(axis="x", length=0)


def _is_slanted(plot: BarPlot) -> bool:
    return sum(map(len, plot.groups)) > MAX_LETTERS and not plot.has_values


def _name(name: str, index: int = 0) -> str | None:
    """Return the entry of a legend: one for the first mark of a kind alone, and shown whatever it begins with."""
    if index > 0:
        return None
    return clean(f"\u200b{name}" if name.startswith("_") else name)


def _shift(index: int, num: int, room: float) -> float:
    return room * (index - (num - 1) / 2) / max(1, num)


def _value_text(value: float, interval: Interval | None, **form: Any) -> str:  # noqa: ANN401 - options of `number`
    """Return a tooltip's number, with its interval if there is one."""
    return number(value, **form) if interval is None else with_interval(value, interval, **form)


def _short_number(value: float) -> str:
    return f"{value:.1f}" if abs(value) > 1.0 else f"{value:.3g}"


def _longest(texts: Iterable[str]) -> int:
    return max(map(len, texts), default=1)


def _short(name: str) -> str:
    return clean(name if len(name) <= MAX_NAME else f"{name[: MAX_NAME - 1]}…")


_DRAWING: dict[type[Plot], Callable[["Axes", Any], None]] = {
    BarPlot: _draw_bars,
    ConfusionPlot: _draw_confusions,
    CurvePlot: _draw_curves,
    GapPlot: _draw_gaps,
    GroupPlot: _draw_groups,
    ScatterPlot: _draw_dots,
}
