"""Plot statistics of tasks: the paper's figure, with what it published beside them, and the other distributions."""

from collections.abc import Sequence

from evonav.report.plots.specs import BarPlot, Series
from evonav.report.tables.numbers import scaled
from evonav.statistics import Interval, wilson
from evonav.tasks.statistics import Distribution, Estimate, TaskStatistics

OURS, REWEIGHTED = "these tasks", "reweighted"
MAX_NAMES = 12
MEDIAN_GROUP = "10-20%"
"""The bar of the relocated-object ratio that holds the paper's median."""


def paper_plots(found: TaskStatistics) -> list[BarPlot]:
    """Return evolution count, stage-goal objects and relocated-object ratio: the paper's figure of statistics."""
    return [plot for plot in (_evolutions(found), _goals(found), _ratio(found)) if plot is not None]


def other_plots(found: TaskStatistics) -> list[BarPlot]:
    """Return the other distributions; of long ones the `MAX_NAMES` most frequent names."""
    shown = {"num_evolutions", "relocated_ratio"}
    plots = []
    for one in found.distributions:
        if one.key not in shown:
            paper = None
            test = found.test(one.key)
            if test is not None and test.cells == one.names:
                paper = test.paper_shares
            num_more = max(0, len(one.names) - MAX_NAMES)
            notes = (f"{num_more} more",) if num_more else ()
            references = tuple(paper or ())[:MAX_NAMES]
            plots.append(
                _plot(one, one.label, f"n = {sum(one.counts)}", references=references, notes=notes, most=MAX_NAMES)
            )
    return plots


def _plot(
    one: Distribution,
    title: str,
    x_label: str,
    *,
    references: tuple[float | None, ...] = (),
    band: tuple[int, int] | None = None,
    notes: tuple[str, ...] = (),
    most: int | None = None,
) -> BarPlot:
    total = max(1, sum(one.counts))
    counts = one.counts[:most]
    series = [_series(OURS, [count / total for count in counts], [wilson(count, total) for count in counts])]
    if one.reweighted_shares is not None:
        series.append(_series(REWEIGHTED, one.reweighted_shares[:most]))
    return BarPlot(
        title=title,
        groups=one.names[:most],
        series=tuple(series),
        x_label=x_label,
        references=tuple(None if share is None else 100 * share for share in references),
        band=band,
        band_label="the paper's median",
        notes=notes,
    )


def _evolutions(found: TaskStatistics) -> BarPlot | None:
    one = found.distribution("num_evolutions")
    if one is None:
        return None
    test = found.test("num_evolutions")
    papers = {} if test is None or test.paper_shares is None else dict(zip(test.cells, test.paper_shares, strict=True))
    notes = [
        f"{name}: {_percent(found.metric(key).raw)}, paper {100 * (found.metric(key).paper or 0):.1f}%"
        for name, key in (("one or more", "evolved_once"), ("two or more", "evolved_twice"))
    ]
    notes += [] if test is None else [f"chi-square p = {test.p:.3f}"]
    references = tuple(papers.get(name) for name in one.names)
    return _plot(one, "Evolutions per task", "number of evolved transitions", references=references, notes=tuple(notes))


def _goals(found: TaskStatistics) -> BarPlot | None:
    goals = found.metric("goal_relocated")
    if goals.raw is None:
        return None
    value, paper, ends = goals.raw.value, goals.paper or 0.0, goals.raw.ci95
    others = None if ends is None else (1 - ends[1], 1 - ends[0])
    series = [_series(OURS, (value, 1 - value), (ends, others))]
    notes = [f"moved: {_percent(goals.raw)}, paper {100 * paper:.1f}%"]
    if goals.reweighted is not None:
        series.append(_series(REWEIGHTED, (goals.reweighted.value, 1 - goals.reweighted.value)))
        notes.append(f"reweighted: {_percent(goals.reweighted)}")
    return BarPlot(
        title="Goals of stages 2 and on",
        groups=("moved before", "not moved"),
        series=tuple(series),
        x_label=f"n = {goals.n}",
        references=(100 * paper, 100 * (1 - paper)),
        notes=tuple(notes),
    )


def _ratio(found: TaskStatistics) -> BarPlot | None:
    one = found.distribution("relocated_ratio")
    if one is None:
        return None
    median = found.metric("relocated_ratio")
    notes = [f"median: {_percent(median.raw)}, paper 10-20%"]
    if median.reweighted is not None:
        notes.append(f"reweighted: {_percent(median.reweighted)}")
    place = one.names.index(MEDIAN_GROUP) if MEDIAN_GROUP in one.names else None
    return _plot(
        one,
        "Relocated-object ratio",
        "share of a house's objects relocated by the end",
        band=None if place is None else (place, place),
        notes=tuple(notes),
    )


def _series(name: str, shares: Sequence[float], intervals: Sequence[Interval | None] = ()) -> Series:
    """Return shares and their intervals in percent."""
    percentages = tuple(100 * share for share in shares)
    ends = tuple(scaled(end) for end in intervals)
    return Series(name, percentages, ends or (None,) * len(percentages))


def _percent(estimate: Estimate | None) -> str:
    return "-" if estimate is None else f"{100 * estimate.value:.1f}%"
