"""Write the statistics of a set of tasks beside the paper's, as HTML, SVG and JSON."""

from dataclasses import replace
from pathlib import Path

from evonav.parallel.folders import write_atomically
from evonav.report.pages.template import page_text, text_of
from evonav.report.plots.render import has_renderer, plot_elements, write_plots
from evonav.report.plots.statistics_plots import other_plots, paper_plots
from evonav.report.plots.style import plot_css
from evonav.report.tables.table import Table
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


def statistics_tables(found: TaskStatistics, *, is_brief: bool = False) -> list[Table]:
    """Return the metrics of each group beside the paper's, the tests, and the quantities.

    Args:
        is_brief: True for 80 columns: fewer quantiles, no share of relocated objects.
    """
    is_weighted = found.weighting is not None
    columns = ("", "paper", "here", "95%", "n", *(("rewtd", "95%") if is_weighted else ()))
    groups: dict[str, list[Metric]] = {}
    for metric in found.metrics:
        if metric.raw is not None:
            groups.setdefault(metric.group, []).append(metric)
    tables = []
    for group, metrics in groups.items():
        rows = [
            (
                metric.label,
                _paper(metric),
                *_shown(metric, metric.raw, "w" if metric.interval == "wilson" else ""),
                str(metric.n),
                *(_shown(metric, metric.reweighted) if is_weighted else ()),
            )
            for metric in metrics
        ]
        verdicts = tuple(_verdict(metric) for metric in metrics if metric.accepted is not None)
        tables.append(Table(group, columns, tuple(rows), verdicts))
    if tables:
        tables[-1] = replace(tables[-1], notes=(*tables[-1].notes, *_NOTES))
    return [*tables, _tests_table(found), _quantities_table(found, is_brief=is_brief)]


_NOTES = (
    "Shares are in %. 95% intervals: Wilson where marked w, else percentile bootstrap over houses (2,000 resamples; "
    "reweighted ones within each kind of house).",
    "Numbers in parentheses are not in the paper: they are derived from its text, or simulated without images and "
    "without rejected goals.",
)


def _paper(metric: Metric) -> str:
    if metric.paper is not None:
        return _scaled(metric, metric.paper)
    if metric.accepted is not None and metric.unit == "median share":
        return "{:.0f}-{:.0f}".format(*(100 * end for end in metric.accepted))
    return "" if metric.expected is None else f"({_scaled(metric, metric.expected)})"


def _shown(metric: Metric, estimate: Estimate | None, mark: str = "") -> tuple[str, str]:
    if estimate is None:
        return ("-", "")
    ends = "" if estimate.ci95 is None else "-".join(_scaled(metric, end) for end in estimate.ci95) + mark
    return (_scaled(metric, estimate.value), ends)


def _scaled(metric: Metric, value: float) -> str:
    return f"{100 * value:.1f}" if "share" in metric.unit else f"{value:.2f}"


def _verdict(metric: Metric) -> str:
    low, high = metric.accepted or (0.0, 1.0)
    parts = []
    for name, estimate in (("here", metric.raw), ("reweighted", metric.reweighted)):
        if estimate is not None:
            verdict = "inside" if low <= estimate.value <= high else "OUTSIDE"
            parts.append(f"{name} {_scaled(metric, estimate.value)}% is {verdict}")
    return f"{metric.label.strip()}: accepted range {100 * low:.0f}-{100 * high:.0f}%, {', '.join(parts)}."


def _tests_table(found: TaskStatistics) -> Table:
    rows = tuple(
        (
            test.label,
            "/".join(f"{100 * count / sum(test.observed):.1f}" for count in test.observed),
            "/".join(f"{100 * share:.1f}" for share in test.expected_shares),
            f"{test.statistic:.2f}",
            str(test.num_degrees),
            f"{test.p:.3f}",
            *(() if found.weighting is None else ("-" if test.reweighted_p is None else f"{test.reweighted_p:.3f}",)),
        )
        for test in found.tests
    )
    columns = ("", "observed, %", "expected, %", "chi-square", "degrees", "p")
    return Table("Tests", columns if found.weighting is None else (*columns, "reweighted p"), rows)


def _quantities_table(found: TaskStatistics, *, is_brief: bool) -> Table:
    names = ("least", "5%", "25%", "median", "75%", "95%", "most")
    shown = (1, 3, 5) if is_brief else range(len(names))
    is_weighted = found.weighting is not None
    columns = ("", "mean", *(names[place] for place in shown), "n", *(("rewtd",) if is_weighted else ()))
    rows = []
    for one in found.quantities:
        if is_brief and one.key == "relocated_ratio":
            continue
        numbers = [one.mean, *(one.quantiles[place] for place in shown)]
        weighted = "-" if one.reweighted_mean is None else _number(one.reweighted_mean)
        row = (f"{one.label}, {one.unit}", *map(_number, numbers), str(one.n), *((weighted,) if is_weighted else ()))
        rows.append(row)
    return Table("Quantities", columns, tuple(rows))


def _number(value: float) -> str:
    return f"{value:.2f}" if abs(value) < 100 else f"{value:.0f}"


def _page(found: TaskStatistics) -> str:
    return page_text(
        "statistics.html.j2",
        text_of("report.css") + plot_css(),
        has_drawings=True,
        found=found,
        plots=plot_elements(paper_plots(found)),
        others=plot_elements(other_plots(found)),
        tables=statistics_tables(found),
    )
