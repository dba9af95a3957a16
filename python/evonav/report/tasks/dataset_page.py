"""The page of a set of tasks: its statistics beside the paper's, as HTML, SVG and JSON."""

from pathlib import Path
from typing import Any

from evonav.errors import StoreError
from evonav.report.pages.template import page_environment, policy, text_of
from evonav.report.plots.render import has_renderer, plot_elements, write_plots
from evonav.report.plots.statistics_plots import other_plots, paper_plots
from evonav.report.plots.style import plot_css
from evonav.tasks.records import record_bytes
from evonav.tasks.statistics import Estimate, Measure, TaskStatistics

PAGE_NAME = "statistics.html"
DATA_NAME = "statistics.json"
PLOT_NAME = "statistics.svg"


def write_dataset_report(found: TaskStatistics, out_dir: Path) -> Path:
    """Write `statistics.html`, `statistics.json` and, with the extra `viz`, `statistics.svg`.

    The same statistics give the same bytes.

    Returns:
        Path of the page.

    Raises:
        StoreError: A file cannot be written.
    """
    page = page_environment().get_template("statistics.html.j2")
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
        (out_dir / DATA_NAME).write_bytes(record_bytes(found))
        if has_renderer():
            write_statistics_plot(found, out_dir / PLOT_NAME)
        path = out_dir / PAGE_NAME
        path.write_text(page.render(**_context(found)), encoding="utf-8")
    except OSError as error:
        raise StoreError(f"{out_dir}: {error}") from error
    return path


def write_statistics_plot(found: TaskStatistics, path: Path) -> Path:
    """Write the paper's figure of statistics: three plots side by side.

    Args:
        found: Statistics of tasks.
        path: `.svg`, `.png` or `.pdf` file.

    Returns:
        `path`.

    Raises:
        InvalidArgumentError: The file's suffix is of no format.
        StoreError: matplotlib is not installed, or the file cannot be written.
    """
    return write_plots(paper_plots(found), path, columns=3)


def _context(found: TaskStatistics) -> dict[str, Any]:
    groups: dict[str, list[list[str]]] = {}
    for measure in found.measures:
        if measure.raw is not None:
            groups.setdefault(measure.group, []).append(_row(measure))
    return {
        "found": found,
        "policy": policy(None),
        "css": text_of("report.css") + plot_css(),
        "plots": plot_elements(paper_plots(found)),
        "others": plot_elements(other_plots(found)),
        "groups": groups,
    }


def _row(measure: Measure) -> list[str]:
    paper = "" if measure.paper is None else _scaled(measure, measure.paper)
    expected = "" if measure.expected is None else _scaled(measure, measure.expected)
    accepted = "" if measure.accepted is None else "{}–{}".format(*(_scaled(measure, end) for end in measure.accepted))
    raw = _shown(measure, measure.raw)
    raw[1] += " (Wilson)" if measure.interval == "wilson" else ""
    return [
        measure.label.strip(),
        paper,
        expected,
        accepted,
        *raw,
        str(measure.n),
        *_shown(measure, measure.reweighted),
    ]


def _shown(measure: Measure, estimate: Estimate | None) -> list[str]:
    if estimate is None:
        return ["", ""]
    ends = "" if estimate.ci95 is None else "–".join(_scaled(measure, end) for end in estimate.ci95)
    return [_scaled(measure, estimate.value), ends]


def _scaled(measure: Measure, value: float) -> str:
    return f"{100 * value:.1f}%" if "share" in measure.unit else f"{value:.2f}"
