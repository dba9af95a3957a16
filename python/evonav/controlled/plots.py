"""Plot a controlled analysis: bars of Fixed and Not Fixed as in the paper, lines over evolution rates."""

from evonav.controlled.analysis import MEASURES, Analysis, Measure
from evonav.controlled.rates import by_rate
from evonav.report.plots.specs import BarPlot, CurvePlot, Line, Plot, Series
from evonav.statistics import ClusterBootstrap

ARM_NAMES = ("Fixed", "Not Fixed")


def controlled_plots(analysis: Analysis) -> list[Plot]:
    """Return SR and SPL of every agent: in both arms, or over all evolution rates."""
    if analysis.record.kind == "pairs":
        return [_arm_plot(analysis, name, measure) for name, measure in MEASURES.items()]
    return [_rate_plot(analysis, name, measure) for name, measure in MEASURES.items()]


def _arm_plot(analysis: Analysis, name: str, measure: Measure) -> BarPlot:
    """Return means in both arms, over the pairs that each agent has scored."""
    groups, arm_means = [], []
    for agent in analysis.paired_agents:
        keys = analysis.keys(agent)
        groups.append(f"{agent}\n({len(keys)})")
        bootstrap = ClusterBootstrap(analysis.houses(keys, agent))
        arm_means.append(bootstrap.column_means(analysis.values(agent, measure, keys)))
    series = tuple(Series.of(arm, [found[j] for found in arm_means]) for j, arm in enumerate(ARM_NAMES))
    note = "in parentheses: pairs; whiskers: 95%, bootstrap by house"
    return BarPlot(f"{name}, %", tuple(groups), series, notes=(note,), y_top=100.0, has_values=True)


def _rate_plot(analysis: Analysis, name: str, measure: Measure) -> CurvePlot:
    found = {agent: by_rate(analysis, agent, measure) for agent in analysis.agents}
    lines = [Line.of(agent, by_arm) for agent, by_arm in found.items() if by_arm]
    x_label = "probability that a transition evolves the house"
    return CurvePlot(f"{name} by evolution rate", tuple(lines), x_label, f"{name}, %")
