"""The paper's figure of statistics as PNG or PDF, for papers and slides (extra `viz`)."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from evonav.errors import InvalidArgumentError, StoreError
from evonav.report.panels import Panel, paper_panels

if TYPE_CHECKING:
    from evonav.tasks.statistics import TaskStatistics

SUFFIXES = (".pdf", ".png", ".svg")


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
    with style.context({"font.size": 8, "axes.spines.top": False, "axes.spines.right": False, "pdf.fonttype": 42}):
        figure = figure_class(figsize=(10, 3.1), layout="constrained")
        for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
            _draw(axes, panel)
        figure.axes[0].legend(frameon=False, fontsize=7)
        # Without dates, the same statistics are the same file.
        metadata = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}.get(path.suffix.lower(), {})
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            figure.savefig(path, dpi=200, metadata=metadata)
        except OSError as error:
            raise StoreError(f"{path}: {error}") from error
    return path


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
