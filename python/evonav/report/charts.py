"""Bar charts as SVG, drawn by hand: no library, readable on light and dark pages."""

from collections.abc import Callable
from importlib.resources import files

from evonav.report.maps.svg import escape, join, title
from evonav.report.panels import Panel

WIDTH, HEIGHT = 400, 300
LEFT, RIGHT, TOP, BOTTOM = 44, 12, 34, 86
NOTE_PX = 15


def chart_css() -> str:
    """What charts look like."""
    return (files("evonav.report") / "templates" / "chart.css").read_text(encoding="utf-8")


def figure_svg(panels: list[Panel]) -> str:
    """Panels side by side with a legend, a file of its own."""
    has_again = any(panel.reweighted is not None for panel in panels)
    width, height = WIDTH * max(1, len(panels)), HEIGHT + 3 * NOTE_PX + 30
    drawn = [f'<g transform="translate({WIDTH * i} 0)">{_panel(panel)}</g>' for i, panel in enumerate(panels)]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="chart" viewBox="0 0 {width} {height}" role="img"'
        f' aria-label="{escape("; ".join(panel.title for panel in panels))}"><style>{chart_css()}</style>'
        f'<rect class="page" width="{width}" height="{height}"/>{join(drawn)}{_legend(has_again, height - 16)}</svg>\n'
    )


def panel_svg(panel: Panel) -> str:
    """One panel for a page that has `chart_css()`."""
    height = HEIGHT + NOTE_PX * len(panel.notes)
    return (
        f'<svg class="chart" viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{escape(panel.title)}">'
        f'<rect class="page" width="{WIDTH}" height="{height}"/>{_panel(panel)}</svg>'
    )


def legend_svg(has_again: bool) -> str:
    """What bars and marks are, for a page that has `chart_css()`."""
    return f'<svg class="chart" viewBox="0 0 {2 * WIDTH} 22" width="{2 * WIDTH}">{_legend(has_again, 11)}</svg>'


def _legend(has_again: bool, y: float) -> str:
    parts = [("ours", "these tasks, with 95% interval")] + ([("again", "reweighted")] if has_again else [])
    drawn, x = [], LEFT
    for css, words in parts:
        drawn.append(f'<rect class="{css}" x="{x}" y="{y - 5}" width="10" height="10"/>')
        drawn.append(f'<text class="soft" x="{x + 15}" y="{y + 4}">{words}</text>')
        x += 32 + round(6.2 * len(words))
    drawn.append(
        f'{_mark(x + 5, y)}<text class="soft" x="{x + 16}" y="{y + 4}">the paper, or worked out from it</text>'
    )
    return join(drawn)


def _panel(panel: Panel) -> str:
    ends = [end[1] for end in panel.intervals if end is not None]
    marks = [share for share in panel.paper if share is not None]
    highest = max([*panel.values, *(panel.reweighted or ()), *ends, *marks, 0.01])
    step = next((s for s in (0.01, 0.02, 0.05, 0.1, 0.2) if highest / s <= 5), 0.25)
    top = step * -(-highest // step)
    floor_y, plot_height = HEIGHT - BOTTOM, HEIGHT - BOTTOM - TOP
    slot = (WIDTH - LEFT - RIGHT) / len(panel.names)

    def y_of(share: float) -> float:
        return floor_y - plot_height * min(1.0, share / top)

    parts = [f'<text class="head" x="{LEFT}" y="20">{escape(panel.title)}</text>']
    if panel.band is not None:
        x, width = LEFT + slot * panel.band[0], slot * (panel.band[1] - panel.band[0] + 1)
        parts.append(f'<rect class="band" x="{x:.1f}" y="{TOP}" width="{width:.1f}" height="{plot_height}"/>')
        parts.append(f'<text class="bandword" x="{x + width + 4:.1f}" y="{TOP + 10}">{escape(panel.band_words)}</text>')
    for i in range(round(top / step) + 1):
        y = y_of(i * step)
        parts.append(f'<path class="grid" d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}"/>')
        parts.append(
            f'<text class="soft" text-anchor="end" x="{LEFT - 5}" y="{y + 4:.1f}">{100 * i * step:.0f}%</text>'
        )
    is_slanted = max(map(len, panel.names)) * 6.2 > slot
    for i, name in enumerate(panel.names):
        parts.append(_bar(panel, i, LEFT + slot * i, slot, y_of, floor_y))
        x, y = LEFT + slot * (i + 0.5), floor_y + 15
        turn = f' transform="rotate(-35 {x:.1f} {y})" text-anchor="end"' if is_slanted else ' text-anchor="middle"'
        parts.append(f'<text x="{x:.1f}" y="{y}"{turn}>{escape(name[:18])}</text>')
    middle, axis_y = (WIDTH + LEFT - RIGHT) / 2, HEIGHT - 12 if is_slanted else floor_y + 36
    parts.append(f'<text class="soft" text-anchor="middle" x="{middle}" y="{axis_y}">{escape(panel.axis)}</text>')
    for i, note in enumerate(panel.notes):
        parts.append(f'<text class="soft" x="{LEFT}" y="{axis_y + 18 + NOTE_PX * i}">{escape(note)}</text>')
    return join(parts)


def _bar(panel: Panel, i: int, x: float, slot: float, y_of: Callable[[float], float], floor_y: float) -> str:
    value, ends, paper = panel.values[i], panel.intervals[i], panel.paper[i]
    shares = [("ours", value)]
    if panel.reweighted is not None:
        shares.append(("again", panel.reweighted[i]))
    width = min(46.0, 0.8 * slot / len(shares))
    left = x + (slot - width * len(shares)) / 2
    words = f"{panel.names[i]}: {100 * value:.1f}%"
    words += "" if panel.reweighted is None else f", reweighted {100 * panel.reweighted[i]:.1f}%"
    words += "" if paper is None else f", paper {100 * paper:.1f}%"
    parts = [f"<g>{title(words)}"]
    for j, (css, share) in enumerate(shares):
        y = y_of(share)
        box = f'x="{left + j * width:.1f}" y="{y:.1f}" width="{width:.1f}" height="{floor_y - y:.1f}"'
        parts.append(f'<rect class="{css}" {box}/>')
    if ends is not None:
        low, high, middle = y_of(ends[0]), y_of(ends[1]), left + width / 2
        caps = f"M{middle - 3:.1f} {low:.1f}h6M{middle - 3:.1f} {high:.1f}h6"
        parts.append(f'<path class="whisker" d="M{middle:.1f} {low:.1f}V{high:.1f}{caps}"/>')
    if paper is not None:
        parts.append(_mark(x + slot / 2 if len(shares) > 1 else left + width, y_of(paper)))
    return join(parts) + "</g>"


def _mark(x: float, y: float) -> str:
    return f'<path class="paper" d="M{x - 5:.1f} {y:.1f}l5 -5l5 5l-5 5z"/>'
