"""Figures as PNG or PDF, for papers and slides (extra `viz`): the look of the pages' own SVG."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evonav.errors import InvalidArgumentError, StoreError
from evonav.parallel.folders import write_atomically
from evonav.report.line_chart import COLOURS
from evonav.report.panels import Panel, paper_panels
from evonav.report.plots import CurvePlot, GapPlot, GroupPlot, Plot, gap_range, group_range, plot_svg

if TYPE_CHECKING:
    from evonav.tasks.statistics import TaskStatistics

SUFFIXES = (".pdf", ".png", ".svg")
_STYLE = {"font.size": 8, "axes.spines.top": False, "axes.spines.right": False, "pdf.fonttype": 42}
_INK, _SOFT, _GRID = "#1f2530", "#667085", "#e2e5ea"


def check_figure(path: Path) -> None:
    """Whether a figure could be written there, before the work is done.

    Raises:
        InvalidArgumentError: The file's suffix is of no format.
        StoreError: matplotlib is not installed.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InvalidArgumentError(f"argument `figure` is {str(path)!r}, expected a file {', '.join(SUFFIXES)}")
    _matplotlib()


def write_figure(found: "TaskStatistics", path: Path) -> Path:
    """Draws evolution count, stage-goal objects and relocated-object ratio, the paper's values marked.

    Args:
        found: Statistics of tasks.
        path: `.png`, `.pdf` or `.svg` file.

    Returns:
        The file.

    Raises:
        InvalidArgumentError: The file's suffix is of no format.
        StoreError: matplotlib is not installed, or the file cannot be written.
    """
    check_figure(path)
    figure_class, style = _matplotlib()
    panels = paper_panels(found)
    with style.context(_STYLE):
        figure = figure_class(figsize=(10, 3.1), layout="constrained")
        for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
            _draw(axes, panel)
        figure.axes[0].legend(frameon=False, fontsize=7)
        return _save(figure, path)


def write_plots(plots: Sequence[Plot], path: Path) -> Path:
    """Draws plots below each other: `.svg` by evonav itself (one plot a file), `.png` and `.pdf` by matplotlib.

    Args:
        plots: At least one.
        path: Its suffix decides; several plots as `.svg` are numbered files.

    Returns:
        The file, of several the first.

    Raises:
        InvalidArgumentError: The file's suffix is of no format.
        StoreError: matplotlib is not installed, or the file cannot be written.
    """
    if path.suffix.lower() == ".svg":
        names = [path if i == 0 else path.with_stem(f"{path.stem}-{i + 1}") for i in range(len(plots))]
        path.parent.mkdir(parents=True, exist_ok=True)
        for name, plot in zip(names, plots, strict=True):
            write_atomically(name, plot_svg(plot))
        return names[0]
    check_figure(path)
    figure_class, style = _matplotlib()
    heights = [0.9 + 0.2 * len(plot.gaps) if isinstance(plot, GapPlot) else 3.0 for plot in plots]
    with style.context(_STYLE):
        # Ten names of categories need more room than the paper's column.
        widest = max([len(plot.groups) for plot in plots if isinstance(plot, GroupPlot)], default=0)
        figure = figure_class(figsize=(max(7.0, 0.95 * widest), sum(heights)), layout="constrained")
        every = figure.subplots(len(plots), 1, squeeze=False, gridspec_kw={"height_ratios": heights})
        for (axes,), plot in zip(every, plots, strict=True):
            if isinstance(plot, GapPlot):
                _draw_gaps(axes, plot)
            elif isinstance(plot, GroupPlot):
                _draw_groups(axes, plot)
            else:
                _draw_curves(axes, plot)
            axes.set_title(plot.title, loc="left", fontsize=9, fontweight="bold", color=_INK)
        return _save(figure, path)


def _save(figure: Any, path: Path) -> Path:  # noqa: ANN401 - matplotlib is not there for the type checker
    # Without dates, the same statistics are the same file.
    metadata = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}.get(path.suffix.lower(), {})
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=200, metadata=metadata)
    except OSError as error:
        raise StoreError(f"{path}: {error}") from error
    return path


def _draw_gaps(axes: Any, plot: GapPlot) -> None:  # noqa: ANN401
    marks = gap_range(plot)
    axes.axvline(0, color=_SOFT, linewidth=0.8)
    for i, gap in enumerate(plot.gaps):
        colour = COLOURS[0] if gap.is_head else _SOFT
        if gap.interval is not None:
            axes.plot(gap.interval, (i, i), color=colour, linewidth=1.4)
        axes.plot(gap.value, i, "o", color=colour, ms=4)
        axes.annotate(gap.detail, (1.01, i), xycoords=("axes fraction", "data"), va="center", color=_SOFT, fontsize=7)
    axes.set_yticks(range(len(plot.gaps)), [gap.name for gap in plot.gaps])
    axes.set_xticks(marks, [f"{mark:+g}" if mark else "0" for mark in marks])
    axes.set_xlim(marks[0], marks[-1])
    axes.set_ylim(len(plot.gaps) - 0.5, -0.5)
    axes.grid(axis="x", color=_GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.set_xlabel(f"← {plot.left_words}     {plot.right_words} →", color=_SOFT)


def _draw_groups(axes: Any, plot: GroupPlot) -> None:  # noqa: ANN401
    marks, num = group_range(plot), max(1, len(plot.series))
    for k, dots in enumerate(plot.series):
        colour, shift = COLOURS[k % len(COLOURS)], 0.7 * (k - (num - 1) / 2) / num
        for i, (value, interval) in enumerate(zip(dots.values, dots.intervals, strict=True)):
            if value is not None and interval is not None:
                axes.plot((i + shift, i + shift), interval, color=colour, linewidth=1.4, alpha=0.55)
        there = [(i + shift, value) for i, value in enumerate(dots.values) if value is not None]
        xs, ys = [x for x, _ in there], [y for _, y in there]
        axes.plot(xs, ys, "o", color=colour, ms=3.5, label=dots.name, clip_on=False)
    axes.set_xticks(range(len(plot.groups)), plot.groups)
    axes.set_xlim(-0.5, len(plot.groups) - 0.5)
    axes.set_yticks(marks)
    axes.set_ylim(marks[0], marks[-1])
    axes.grid(axis="y", color=_GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_ylabel(plot.y_words)
    axes.legend(frameon=False, fontsize=7, ncols=num, loc="upper center", bbox_to_anchor=(0.5, -0.16))


def _draw_curves(axes: Any, plot: CurvePlot) -> None:  # noqa: ANN401
    for k, line in enumerate(plot.lines):
        colour = COLOURS[k % len(COLOURS)]
        axes.plot([x for x, _ in line.points], [y for _, y in line.points], "o-", color=colour, ms=3, label=line.name)
        there = [(x, ends) for (x, _), ends in zip(line.points, line.intervals, strict=True) if ends is not None]
        low, high = [ends[0] for _, ends in there], [ends[1] for _, ends in there]
        axes.fill_between([x for x, _ in there], low, high, color=colour, alpha=0.12, linewidth=0)
    axes.set_xticks(sorted({x for line in plot.lines for x, _ in line.points}))
    axes.set_ylim(0, None)
    axes.grid(axis="y", color=_GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_xlabel(plot.x_words)
    axes.set_ylabel(plot.y_words)
    axes.legend(frameon=False, fontsize=7)


def _draw(axes: Any, panel: Panel) -> None:  # noqa: ANN401 - matplotlib is not there for the type checker
    num_series = 1 if panel.reweighted is None else 2
    width = 0.8 / num_series
    places = [i - 0.4 + width / 2 for i in range(len(panel.names))]
    percent = [100 * value for value in panel.values]
    ends = [(value, value) if end is None else end for value, end in zip(panel.values, panel.intervals, strict=True)]
    errors = [
        [max(0.0, 100 * (value - low)) for value, (low, _) in zip(panel.values, ends, strict=True)],
        [max(0.0, 100 * (high - value)) for value, (_, high) in zip(panel.values, ends, strict=True)],
    ]
    if panel.band is not None:
        axes.axvspan(panel.band[0] - 0.5, panel.band[1] + 0.5, color="#fdeadb", zorder=0, label=panel.band_words)
    axes.bar(places, percent, width, color="#2f66cb", label="these tasks")
    axes.errorbar(places, percent, yerr=errors, fmt="none", ecolor="#1f2530", elinewidth=0.8, capsize=2)
    if panel.reweighted is not None:
        shifted = [place + width for place in places]
        axes.bar(shifted, [100 * share for share in panel.reweighted], width, color="#9db9ec", label="reweighted")
    marks = [(i, 100 * share) for i, share in enumerate(panel.paper) if share is not None]
    if marks:
        axes.plot(*zip(*marks, strict=True), "D", color="#c2410c", ms=4, mec="white", mew=0.6, label="paper")
    is_long = max(map(len, panel.names)) * len(panel.names) > 40
    axes.set_xticks(
        range(len(panel.names)), panel.names, rotation=45 if is_long else 0, ha="right" if is_long else "center"
    )
    axes.set_ylabel("%")
    axes.set_xlabel(panel.axis)
    axes.set_title(panel.title + "\n" + "\n".join(panel.notes), fontsize=8, loc="left")
    if panel.band is not None:
        axes.legend(frameon=False, fontsize=7)


def _matplotlib() -> tuple[Any, Any]:
    try:
        from matplotlib import style
        from matplotlib.figure import Figure
    except ImportError as error:
        raise StoreError(f"figures need matplotlib ({error}): pip install 'evonav[viz]'") from error
    return Figure, style
