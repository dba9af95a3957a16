"""The paper's figure of statistics as data: three panels of bars, with what it published beside them."""

from collections.abc import Sequence
from dataclasses import dataclass

from evonav.significance import Interval, wilson
from evonav.tasks.statistics import Distribution, Estimate, TaskStatistics


@dataclass(frozen=True, slots=True)
class Panel:
    """Bars, all in shares."""

    title: str
    axis: str
    names: tuple[str, ...]
    values: tuple[float, ...]
    intervals: tuple[Interval | None, ...]
    reweighted: tuple[float, ...] | None
    paper: tuple[float | None, ...]
    """Published, or worked out from what is; `None` where neither."""
    band: tuple[int, int] | None
    """First and last bar of a range that the paper names."""
    band_words: str
    notes: tuple[str, ...]
    """Published figures against these, in words."""


def paper_panels(found: TaskStatistics) -> list[Panel]:
    """Evolution count, stage-goal objects, relocated-object ratio (the paper's figure of statistics)."""
    return [panel for panel in (_evolutions(found), _goals(found), _ratio(found)) if panel is not None]


def other_panels(found: TaskStatistics, most: int = 12) -> list[Panel]:
    """The other distributions; of long ones the most frequent."""
    shown = {"num_evolutions", "relocated_ratio"}
    panels = []
    for one in found.distributions:
        if one.key not in shown:
            paper = None
            test = found.test(one.key)
            if test is not None and test.cells == one.names:
                paper = test.paper_shares
            num_more = max(0, len(one.names) - most)
            notes = (f"{num_more} more",) if num_more else ()
            panels.append(_panel(one, one.label, f"n = {sum(one.counts)}", paper=paper, notes=notes, most=most))
    return panels


def _panel(
    one: Distribution,
    title: str,
    axis: str,
    *,
    paper: Sequence[float | None] | None = None,
    band: tuple[int, int] | None = None,
    band_words: str = "",
    notes: tuple[str, ...] = (),
    most: int | None = None,
) -> Panel:
    total = max(1, sum(one.counts))
    names = one.names[:most]
    return Panel(
        title=title,
        axis=axis,
        names=names,
        values=tuple(count / total for count in one.counts[:most]),
        intervals=tuple(wilson(count, total) for count in one.counts[:most]),
        reweighted=None if one.reweighted_shares is None else one.reweighted_shares[:most],
        paper=tuple(paper or [None] * len(one.names))[: len(names)],
        band=band,
        band_words=band_words,
        notes=notes,
    )


def _evolutions(found: TaskStatistics) -> Panel | None:
    one = found.distribution("num_evolutions")
    if one is None:
        return None
    test = found.test("num_evolutions")
    papers = {} if test is None or test.paper_shares is None else dict(zip(test.cells, test.paper_shares, strict=True))
    notes = [
        f"{words}: {_percent(found.measure(key).raw)}, paper {100 * (found.measure(key).paper or 0):.1f}%"
        for words, key in (("one or more", "evolved_once"), ("two or more", "evolved_twice"))
    ]
    notes += [] if test is None else [f"chi-square p = {test.p:.3f}"]
    paper = [papers.get(name) for name in one.names]
    return _panel(one, "Evolutions a task", "number of evolved transitions", paper=paper, notes=tuple(notes))


def _goals(found: TaskStatistics) -> Panel | None:
    goals = found.measure("goal_relocated")
    if goals.raw is None:
        return None
    value, paper = goals.raw.value, goals.paper or 0.0
    ends = goals.raw.ci95
    again = None if goals.reweighted is None else goals.reweighted.value
    return Panel(
        title="Goals of stages 2 and on",
        axis=f"n = {goals.n}",
        names=("relocated before", "not relocated"),
        values=(value, 1 - value),
        intervals=(ends, None if ends is None else (1 - ends[1], 1 - ends[0])),
        reweighted=None if again is None else (again, 1 - again),
        paper=(paper, 1 - paper),
        band=None,
        band_words="",
        notes=(
            f"relocated: {_percent(goals.raw)}, paper {100 * paper:.1f}%",
            *(() if goals.reweighted is None else (f"reweighted: {_percent(goals.reweighted)}",)),
        ),
    )


def _ratio(found: TaskStatistics) -> Panel | None:
    one = found.distribution("relocated_ratio")
    if one is None:
        return None
    median = found.measure("relocated_ratio")
    notes = [f"median: {_percent(median.raw)}, paper 10-20%"]
    if median.reweighted is not None:
        notes.append(f"reweighted: {_percent(median.reweighted)}")
    band = None
    if "10-20%" in one.names:
        band = (one.names.index("10-20%"),) * 2
    return _panel(
        one,
        "Relocated-object ratio",
        "share of a house's objects relocated by the end",
        band=band,
        band_words="paper: median",
        notes=tuple(notes),
    )


def _percent(estimate: Estimate | None) -> str:
    return "-" if estimate is None else f"{100 * estimate.value:.1f}%"
