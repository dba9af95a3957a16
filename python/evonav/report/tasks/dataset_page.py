"""Write the statistics of a set of tasks beside the paper's, as HTML, SVG and JSON."""

from pathlib import Path

from evonav.parallel.folders import write_atomically
from evonav.report.pages.template import page_text, text_of
from evonav.report.plots.render import has_renderer, plot_elements, write_plots
from evonav.report.plots.statistics_plots import other_plots, paper_plots
from evonav.report.plots.style import plot_css
from evonav.tasks.records import record_bytes
from evonav.tasks.statistics import Estimate, Metric, TaskStatistics

PAGE_NAME = "statistics.html"
DATA_NAME = "statistics.json"
PLOT_NAME = "statistics.svg"


def write_dataset_report(found: TaskStatistics, out_dir: Path) -> Path:
    """Write `statistics.html`, `statistics.json` and, with the extra `viz`, `statistics.svg`.

    The same statistics give the same bytes. Returns the path of the page.
    """
    write_atomically(out_dir / DATA_NAME, record_bytes(found))
    if has_renderer():
        write_statistics_plot(found, out_dir / PLOT_NAME)
    return write_atomically(out_dir / PAGE_NAME, _page(found))


def write_statistics_plot(found: TaskStatistics, path: Path) -> Path:
    """Write the paper's figure of statistics, three plots side by side, as a `.svg`, `.png` or `.pdf` file.

    Raises:
        InvalidArgumentError: The file's suffix is of no format.
        StoreError: matplotlib is not installed, or the file cannot be written.
    """
    return write_plots(paper_plots(found), path, columns=3)


def _page(found: TaskStatistics) -> str:
    groups: dict[str, list[list[str]]] = {}
    for metric in found.metrics:
        if metric.raw is not None:
            groups.setdefault(metric.group, []).append(_row(metric))
    return page_text(
        "statistics.html.j2",
        text_of("report.css") + plot_css(),
        has_drawings=True,
        found=found,
        plots=plot_elements(paper_plots(found)),
        others=plot_elements(other_plots(found)),
        groups=groups,
    )


def _row(metric: Metric) -> list[str]:
    paper = "" if metric.paper is None else _scaled(metric, metric.paper)
    expected = "" if metric.expected is None else _scaled(metric, metric.expected)
    accepted = "" if metric.accepted is None else "{}–{}".format(*(_scaled(metric, end) for end in metric.accepted))
    raw = _shown(metric, metric.raw)
    raw[1] += " (Wilson)" if metric.interval == "wilson" else ""
    return [
        metric.label.strip(),
        paper,
        expected,
        accepted,
        *raw,
        str(metric.n),
        *_shown(metric, metric.reweighted),
    ]


def _shown(metric: Metric, estimate: Estimate | None) -> list[str]:
    if estimate is None:
        return ["", ""]
    ends = "" if estimate.ci95 is None else "–".join(_scaled(metric, end) for end in estimate.ci95)
    return [_scaled(metric, estimate.value), ends]


def _scaled(metric: Metric, value: float) -> str:
    return f"{100 * value:.1f}%" if "share" in metric.unit else f"{value:.2f}"
