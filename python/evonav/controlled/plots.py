"""Figures of a controlled analysis: bars of Fixed / Not Fixed as in the paper, lines over evolution rates."""

from pathlib import Path
from typing import Any

import numpy as np

from evonav.controlled.analysis import MEASURES, Analysis, Measure
from evonav.controlled.rates import by_rate
from evonav.errors import StoreError
from evonav.paired import cluster_means
from evonav.report.charts import chart_css
from evonav.report.figures import _matplotlib
from evonav.report.line_chart import COLOURS, Line, line_chart
from evonav.report.maps.svg import escape, join, title
from evonav.significance import Interval

ARM_WORDS = ("Fixed", "Not Fixed")
ARM_COLOURS = ("#9db9ec", "#c2410c")
PANEL_PX, HEIGHT_PX = 470, 300
LEFT, RIGHT, TOP, BOTTOM = 42, 8, 34, 54

Bars = list[tuple[str, list[tuple[float, Interval | None]]]]
"""Per agent, mean and interval in each arm."""


def bars(analysis: Analysis, measure: Measure) -> Bars:
    """Means of all agents in both arms, over the pairs that each has scored."""
    found: Bars = []
    for agent in analysis.agents:
        keys = analysis.keys(agent)
        if keys:
            values = np.array([[measure(analysis.outcomes[arm, agent][key]) for arm in analysis.arms] for key in keys])
            houses = [analysis.outcomes[analysis.arms[0], agent][key].row.house for key in keys]
            found.append((f"{agent} ({len(keys)})", cluster_means(values, houses)))
    return found


def bars_svg(analysis: Analysis) -> str:
    """SR and SPL of every agent, Fixed beside Not Fixed, as a file of its own."""
    panels = [_bar_panel(name, bars(analysis, measure)) for name, measure in MEASURES.items()]
    width = PANEL_PX * len(panels)
    drawn = join(f'<g transform="translate({PANEL_PX * i} 0)">{panel}</g>' for i, panel in enumerate(panels))
    keys = join(
        f'<rect x="{LEFT + 90 * i}" y="{HEIGHT_PX + 3}" width="11" height="11" fill="{colour}"/>'
        f'<text x="{LEFT + 90 * i + 16}" y="{HEIGHT_PX + 13}">{words}</text>'
        for i, (words, colour) in enumerate(zip(ARM_WORDS, ARM_COLOURS, strict=True))
    )
    note = (
        f'<text class="soft" x="{LEFT + 190}" y="{HEIGHT_PX + 13}">'
        "in parentheses: pairs; whiskers: 95%, bootstrap by house</text>"
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="chart" viewBox="0 0 {width} {HEIGHT_PX + 24}" role="img" '
        f'aria-label="SR and SPL, Fixed and Not Fixed"><style>{chart_css()}</style>'
        f'<rect class="page" width="{width}" height="{HEIGHT_PX + 24}"/>{drawn}{keys}{note}</svg>\n'
    )


def _bar_panel(name: str, found: Bars) -> str:
    floor_y, plot = HEIGHT_PX - BOTTOM, HEIGHT_PX - BOTTOM - TOP
    slot = (PANEL_PX - LEFT - RIGHT) / max(1, len(found))
    width = min(30.0, 0.38 * slot)
    parts = [f'<text class="head" x="{LEFT}" y="20">{name}, %</text>']
    for i in range(0, 101, 20):
        y = floor_y - plot * i / 100
        parts.append(f'<path class="grid" d="M{LEFT} {y:.1f}H{PANEL_PX - RIGHT}"/>')
        parts.append(f'<text class="soft" text-anchor="end" x="{LEFT - 5}" y="{y + 4:.1f}">{i}</text>')
    for i, (agent, arms) in enumerate(found):
        middle = LEFT + slot * (i + 0.5)
        for j, (mean, ends) in enumerate(arms):
            x, y = middle + width * (j - 1), floor_y - plot * mean
            words = title(f"{agent}, {ARM_WORDS[j]}: {100 * mean:.1f}%")
            box = f'x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{floor_y - y:.1f}"'
            parts.append(f'<rect fill="{ARM_COLOURS[j]}" {box}>{words}</rect>')
            if ends is not None:
                low, high = (floor_y - plot * end for end in ends)
                centre = x + width / 2
                caps = f"M{centre - 3:.1f} {low:.1f}h6M{centre - 3:.1f} {high:.1f}h6"
                parts.append(f'<path class="whisker" d="M{centre:.1f} {low:.1f}V{high:.1f}{caps}"/>')
            tip = floor_y - plot * (mean if ends is None else ends[1]) - 5
            parts.append(
                f'<text class="soft" font-size="10" text-anchor="middle" x="{x + width / 2:.1f}" y="{tip:.1f}">'
                f"{100 * mean:.0f}</text>"
            )
        parts.append(f'<text text-anchor="middle" x="{middle:.1f}" y="{floor_y + 16}">{escape(agent.split(" (")[0])}')
        parts.append(f'</text><text class="soft" text-anchor="middle" x="{middle:.1f}" y="{floor_y + 31}">')
        parts.append(f"({agent.split(' (')[1]}</text>")
    return join(parts)


def lines_svg(analysis: Analysis, name: str, measure: Measure) -> str:
    """One measure over evolution rates, a line an agent."""
    lines = []
    for agent in analysis.agents:
        found = by_rate(analysis, agent, measure)
        if found:
            lines.append(
                Line(
                    agent,
                    [(rate, 100 * mean) for rate, mean, _ in found],
                    [None if ends is None else (100 * ends[0], 100 * ends[1]) for _, _, ends in found],
                )
            )
    return line_chart(lines, f"{name} by evolution rate", "probability that a transition evolves the house", "%")


def write_figures(analysis: Analysis, out: Path) -> list[Path]:
    """The same as PNG and PDF for papers and slides, where matplotlib is installed.

    Returns:
        The files; none without matplotlib.

    Raises:
        StoreError: A file cannot be written.
    """
    try:
        figure_class, style = _matplotlib()
    except StoreError:
        return []
    written = []
    with style.context({"font.size": 8, "axes.spines.top": False, "axes.spines.right": False, "pdf.fonttype": 42}):
        figure = figure_class(figsize=(8.4, 2.9), layout="constrained")
        for axes, (name, measure) in zip(figure.subplots(1, len(MEASURES)), MEASURES.items(), strict=True):
            if analysis.record.kind == "pairs":
                _draw_bars(axes, name, bars(analysis, measure))
            else:
                _draw_lines(axes, name, analysis, measure)
        figure.axes[-1].legend(frameon=False, fontsize=7)
        for suffix in (".png", ".pdf"):
            path = out / f"{'fixed-not-fixed' if analysis.record.kind == 'pairs' else 'rates'}{suffix}"
            try:
                # Without dates, the same results are the same file.
                figure.savefig(path, dpi=200, metadata={"CreationDate": None} if suffix == ".pdf" else {})
            except OSError as error:
                raise StoreError(f"{path}: {error}") from error
            written.append(path)
    return written


def _draw_bars(axes: Any, name: str, found: Bars) -> None:  # noqa: ANN401 - matplotlib is not there for the type checker
    for j, (words, colour) in enumerate(zip(ARM_WORDS, ARM_COLOURS, strict=True)):
        means = [100 * arms[j][0] for _, arms in found]
        ends = [arms[j][1] or (arms[j][0], arms[j][0]) for _, arms in found]
        errors = [
            [max(0.0, mean - 100 * low) for mean, (low, _) in zip(means, ends, strict=True)],
            [max(0.0, 100 * high - mean) for mean, (_, high) in zip(means, ends, strict=True)],
        ]
        places = [i + 0.38 * (j - 0.5) for i in range(len(found))]
        axes.bar(places, means, 0.36, color=colour, label=words)
        axes.errorbar(places, means, yerr=errors, fmt="none", ecolor="#1f2530", elinewidth=0.8, capsize=2)
    axes.set_xticks(range(len(found)), [agent.replace(" (", "\n(") for agent, _ in found])
    axes.set_ylim(0, 100)
    axes.set_ylabel(f"{name}, %")


def _draw_lines(axes: Any, name: str, analysis: Analysis, measure: Measure) -> None:  # noqa: ANN401 - as above
    for i, agent in enumerate(analysis.agents):
        found = by_rate(analysis, agent, measure)
        if not found:
            continue
        shift = 0.008 * (i - (len(analysis.agents) - 1) / 2)
        rates = [rate + shift for rate, _, _ in found]
        means = [100 * mean for _, mean, _ in found]
        ends = [(mean, mean) if end is None else end for _, mean, end in found]
        errors = [
            [max(0.0, mean - 100 * low) for mean, (low, _) in zip(means, ends, strict=True)],
            [max(0.0, 100 * high - mean) for mean, (_, high) in zip(means, ends, strict=True)],
        ]
        colour = COLOURS[i % len(COLOURS)]
        axes.errorbar(rates, means, yerr=errors, fmt="o-", ms=3, color=colour, elinewidth=0.7, capsize=2, label=agent)
    axes.set_xticks([arm.evolve_probability for arm in analysis.record.arms])
    axes.set_xlabel("probability that a transition evolves the house")
    axes.set_ylabel(f"{name}, %")
    axes.set_ylim(bottom=0)
