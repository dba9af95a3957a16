"""What a run's page plots: rates by kind of stage, differences between agents. The same figures go to PNG and PDF."""

from collections.abc import Sequence
from dataclasses import dataclass

from evonav.report.compare.breakdown import Breakdown, breakdown, breakdown_plot
from evonav.report.compare.selection import Side, read_sides
from evonav.report.plots import Gap, GapPlot, Plot, plot_svg
from evonav.report.run import Run
from evonav.report.tables.table import verdict

PLOTTED = ("stratum", "mode", "path-length", "earlier-stages", "radius")
TABLED = ("path-length", "room-count", "radius")
"""Breakdowns that have no table of their own elsewhere on the page."""
_WORDS = {
    "stratum": "Relocated: the target had ever moved since stage 1.",
    "mode": "What happened in the transition just before the stage.",
    "path-length": "Shortest path from where the agent began the stage to the target.",
    "earlier-stages": "How many stages the memory has lived through.",
    "radius": "The same stages judged by other radii: agents stop where their own radius lets them.",
}


@dataclass(frozen=True, slots=True)
class RunFigure:
    """A figure of a page."""

    title: str
    words: str
    svg: str
    """An element for a page that has `line_chart.PLOT_CSS`."""
    plot: Plot
    """The same as data, for `figures.write_plots`."""


def run_breakdowns(run: Run, names: Sequence[str] = TABLED) -> list[Breakdown]:
    """A run's breakdowns; those without a group are left out.

    Raises:
        StoreError: The run cannot be read.
    """
    sides = _sides(run)
    found = [breakdown(sides, by) for by in names] if sides else []
    return [one for one in found if one.groups]


def run_figures(run: Run) -> list[RunFigure]:
    """The figures of a run, in reading order; none of a run without a scored stage.

    Raises:
        StoreError: The run cannot be read.
    """
    figures = []
    if len(run.pairs) > 0:
        plot = _difference_plot(run)
        words = "On the stages that both scored; 95% intervals, bootstrap by task. Blue: beyond the interval."
        figures.append(RunFigure(plot.title, words, plot_svg(plot, is_inline=True), plot))
    for one in run_breakdowns(run, PLOTTED):
        drawn = breakdown_plot(one)
        words = f"{_WORDS[one.by]} 95% intervals, bootstrap by house."
        figures.append(RunFigure(drawn.title, words, plot_svg(drawn, is_inline=True), drawn))
    return figures


def _sides(run: Run) -> list[Side]:
    if run.num_recorded == 0:
        return []
    return [side for side in read_sides([str(run.run_dir)]) if any(row.is_scored for row in side.rows.values())]


def _difference_plot(run: Run) -> GapPlot:
    gaps = tuple(
        Gap(
            f"{pair.b} less {pair.a}",
            f"n = {pair.n}",
            100 * pair.sr,
            None if pair.sr_ci95[0] == pair.sr_ci95[1] else (100 * pair.sr_ci95[0], 100 * pair.sr_ci95[1]),
            verdict(pair).endswith("ahead beyond the interval"),
        )
        for pair in run.pairs
    )
    return GapPlot("SR differences, points", gaps, "the second is better", "the first is better")
