"""Plot a run: rates by kind of stage, differences between agents."""

from collections.abc import Mapping

from evonav.report.compare.breakdown import Breakdown, breakdown, breakdown_plot
from evonav.report.compare.selection import agents_of
from evonav.report.plots.specs import Gap, GapPlot, Plot
from evonav.report.run import RecordedRun

PLOTTED = (
    ("stratum", "success"),
    ("stratum", "spl"),
    ("mode", "success"),
    ("path-length", "success"),
    ("earlier-stages", "success"),
    ("radius", "success"),
)
"""Breakdowns with a plot: groups and metric."""
TABLED = (("path-length", "success"), ("room-count", "success"), ("radius", "success"))
"""Breakdowns that have no table of their own elsewhere on the page."""
Breakdowns = Mapping[tuple[str, str], Breakdown]
"""Breakdowns by groups and metric."""
_CAPTIONS = {
    "stratum": "First: stage 1. Moved: the target had moved since stage 1, at any time.",
    "mode": "What changed in the house just before the stage.",
    "path-length": "Shortest path from where the agent began the stage to the target.",
    "earlier-stages": "Number of stages of the task before this one, which memory may know.",
    "radius": "The same stages judged by other success radii than the one that the agents ran with.",
}


def run_breakdowns(run: RecordedRun) -> Breakdowns:
    """Return the breakdowns of a run that have a table or a plot, without those that have no group."""
    agents = [one for one in agents_of(run) if any(row.is_scored for row in one.rows.values())]
    wanted = dict.fromkeys((*TABLED, *PLOTTED)) if agents else ()
    found = {(by, metric): breakdown(agents, by, metric) for by, metric in wanted}
    return {key: one for key, one in found.items() if one.groups}


def run_plots(run: RecordedRun, breakdowns: Breakdowns) -> list[tuple[Plot, str]]:
    """Return the plots of a run with their captions, in reading order; none of a run without a scored stage."""
    plots: list[tuple[Plot, str]] = []
    if len(run.pairs) > 0:
        caption = "On the stages that both scored; 95% intervals, bootstrap by house. Blue: ahead, as the table says."
        for name in ("SR", "SPL"):
            effects = [(pair, pair.sr if name == "SR" else pair.spl) for pair in run.pairs]
            gaps = tuple(
                Gap.of(f"{run.names[pair.b]} minus {run.names[pair.a]}", f"n = {pair.n}", effect)
                for pair, effect in effects
            )
            plot = GapPlot(f"{name} differences, points", gaps, "the second is better", "the first is better")
            plots.append((plot, caption))
    for one in (breakdowns[key] for key in PLOTTED if key in breakdowns):
        plots.append((breakdown_plot(one), f"{_CAPTIONS[one.by]} 95% intervals, bootstrap by house."))
    return plots
