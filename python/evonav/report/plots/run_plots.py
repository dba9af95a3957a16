"""Plot a run: rates by kind of stage, differences between agents."""

from collections.abc import Sequence

from evonav.report.compare.breakdown import Breakdown, breakdown, breakdown_plot
from evonav.report.compare.selection import agents_of
from evonav.report.plots.specs import Gap, GapPlot, Plot
from evonav.report.run import Run

PLOTTED = ("stratum", "mode", "path-length", "earlier-stages", "radius")
TABLED = ("path-length", "room-count", "radius")
"""Breakdowns that have no table of their own elsewhere on the page."""
_CAPTIONS = {
    "stratum": "Relocated: the target had ever moved since stage 1.",
    "mode": "What happened in the transition just before the stage.",
    "path-length": "Shortest path from where the agent began the stage to the target.",
    "earlier-stages": "How many stages the memory has lived through.",
    "radius": "The same stages judged by other radii: agents stop where their own radius lets them.",
}


def run_breakdowns(run: Run, names: Sequence[str] = TABLED) -> list[Breakdown]:
    """Return breakdowns of a run, without those that have no group.

    Raises:
        StoreError: The run cannot be read.
    """
    agents = [one for one in agents_of(run) if any(row.is_scored for row in one.rows.values())]
    found = [breakdown(agents, by) for by in names] if agents else []
    return [one for one in found if one.groups]


def run_plots(run: Run) -> list[tuple[Plot, str]]:
    """Return the plots of a run with their captions, in reading order; none of a run without a scored stage.

    Raises:
        StoreError: The run cannot be read.
    """
    plots: list[tuple[Plot, str]] = []
    if len(run.pairs) > 0:
        caption = "On the stages that both scored; 95% intervals, bootstrap by house. Blue: ahead, as the table says."
        plots.append((_difference_plot(run), caption))
    for one in run_breakdowns(run, PLOTTED):
        plots.append((breakdown_plot(one), f"{_CAPTIONS[one.by]} 95% intervals, bootstrap by house."))
    return plots


def _difference_plot(run: Run) -> GapPlot:
    gaps = tuple(Gap.of(f"{pair.b} less {pair.a}", f"n = {pair.n}", pair.sr) for pair in run.pairs)
    return GapPlot("SR differences, points", gaps, "the second is better", "the first is better")
