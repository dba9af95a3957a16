"""Describe plots as data: what to draw, not how."""

from collections.abc import Iterable
from dataclasses import dataclass

from evonav.report.tables.numbers import scaled
from evonav.statistics import Estimate, Interval, PairedEffect


@dataclass(frozen=True, slots=True)
class Series:
    """The values of one agent, or of one kind of tasks, in every group."""

    name: str
    values: tuple[float | None, ...]
    """One value a group; `None` where there is none."""
    intervals: tuple[Interval | None, ...]
    """The interval of each value."""

    @staticmethod
    def of(name: str, estimates: Iterable[Estimate | None], scale: float = 100) -> "Series":
        """Return the series of some estimates, by default in percent."""
        found = [Estimate(None, None, 0, 0) if one is None else one for one in estimates]
        values = tuple(None if one.value is None else scale * one.value for one in found)
        return Series(name, values, tuple(scaled(one.ci95, scale) for one in found))


@dataclass(frozen=True, slots=True)
class GroupPlot:
    """Dots with whiskers, side by side in groups."""

    title: str
    groups: tuple[str, ...]
    """Names below the axis; a second line holds the group's n."""
    series: tuple[Series, ...]
    y_label: str


@dataclass(frozen=True, slots=True)
class BarPlot:
    """Bars with whiskers, side by side in groups; in percent."""

    title: str
    groups: tuple[str, ...]
    series: tuple[Series, ...]
    x_label: str = ""
    references: tuple[float | None, ...] = ()
    """Published values, one a group; empty or `None` where there is none."""
    band: tuple[int, int] | None = None
    """First and last group of a range that is shaded."""
    band_label: str = ""
    notes: tuple[str, ...] = ()
    """Lines below the plot."""
    y_top: float | None = None
    """Upper end of the axis; `None` to fit the values."""
    has_values: bool = False
    """Whether the number stands above each bar."""


@dataclass(frozen=True, slots=True)
class Line:
    """Points in order of x."""

    name: str
    points: tuple[tuple[float, float], ...]
    intervals: tuple[Interval | None, ...] = ()
    """The interval of each y; empty: no whiskers."""
    has_dots: bool = True

    @staticmethod
    def of(name: str, estimates: Iterable[tuple[float, Estimate]], scale: float = 100) -> "Line":
        """Return the line of some estimates by x, by default in percent; 0 where there is no value."""
        found = list(estimates)
        points = tuple((x, scale * (one.value or 0.0)) for x, one in found)
        return Line(name, points, tuple(scaled(one.ci95, scale) for _, one in found))


@dataclass(frozen=True, slots=True)
class CurvePlot:
    """Lines along a number."""

    title: str
    lines: tuple[Line, ...]
    x_label: str
    y_label: str
    x_names: tuple[str, ...] = ()
    """Names to write below x = 0, 1, ... in place of the numbers."""
    x_range: tuple[float, float] | None = None
    y_top: float | None = None
    """Upper end of the axis, which begins at 0; `None` to fit the values."""
    is_square: bool = False
    has_diagonal: bool = False
    """Whether to mark where x and y are equal."""


@dataclass(frozen=True, slots=True)
class Gap:
    """A difference with its interval."""

    name: str
    detail: str
    """A few words at the end of the row."""
    value: float
    interval: Interval | None
    is_emphasised: bool = False
    """Whether it is more than a tie."""

    @staticmethod
    def of(name: str, detail: str, effect: PairedEffect) -> "Gap":
        """Return the gap of a difference of rates, in percentage points."""
        return Gap(name, detail, 100 * effect.difference, scaled(effect.ci95), effect.verdict in ("a", "b"))


@dataclass(frozen=True, slots=True)
class GapPlot:
    """Differences around zero, one a row."""

    title: str
    gaps: tuple[Gap, ...]
    left_label: str
    """Meaning of a difference below zero."""
    right_label: str
    """Meaning of a difference above zero."""


@dataclass(frozen=True, slots=True)
class ConfusionRow:
    """The labels that the objects of one category were given."""

    category: str
    num: int
    shares: tuple[float, ...]
    """Shares of the category's objects, one a column."""


@dataclass(frozen=True, slots=True)
class ConfusionPlot:
    """A table of shares in shades; the first column is right, the second is nothing."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[ConfusionRow, ...]


@dataclass(frozen=True, slots=True)
class Dot:
    """One thing that has a place by two numbers, and a size."""

    name: str
    x: float
    y: float | None
    """`None` for a value beyond all others, which is drawn as an open dot at the upper edge."""
    size: float | None = None
    """The dot's area is in proportion to it; `None` for the smallest dot."""
    size_text: str = ""
    """The size in words, for the tooltip."""
    x_interval: Interval | None = None
    y_interval: Interval | None = None


@dataclass(frozen=True, slots=True)
class ScatterPlot:
    """Dots by two numbers, with their names in a column; x is logarithmic, and y from 1 on."""

    title: str
    dots: tuple[Dot, ...]
    x_label: str
    y_label: str
    beyond: str = ""
    """Meaning of a dot at the upper edge."""


Plot = ScatterPlot | GroupPlot | BarPlot | CurvePlot | GapPlot | ConfusionPlot
