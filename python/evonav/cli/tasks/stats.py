"""`evonav tasks stats`: compare statistics of tasks with the paper's."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.options.shared import PLOTS, Workers, num_workers_of

if TYPE_CHECKING:
    from rich.table import Table

    from evonav.tasks.statistics import Estimate, Metric, TaskStatistics, Test

NUM_NAMES = 6
"""Largest number of values of a distribution in one line."""


def stats(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(metavar="FOLDER", help="Folders of tasks, or bundled. Default: the bundled tasks."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="Folder to write statistics.json, .html and .svg to, or the plot alone (.svg, .png, .pdf).",
        ),
    ] = None,
    reweight: Annotated[
        str | None,
        typer.Option(
            metavar="DATASET",
            help="Also weight tasks so that their houses have the room counts of a dataset: procthor-10k.",
        ),
    ] = None,
    workers: Workers = None,
) -> None:
    """Print and plot statistics of tasks beside the paper's."""
    from evonav.cli.display import status
    from evonav.generation.statistics.compute import statistics_of_folders
    from evonav.report.plots.render import check_plot
    from evonav.report.tasks.dataset_page import write_dataset_report, write_statistics_plot
    from evonav.tasks.listing import BUNDLED_TASKS, task_folder

    plot = out if out is not None and out.suffix.lstrip(".") in PLOTS else None
    if plot is not None:
        check_plot(plot)
    with status("Reading tasks") as tell:
        found = statistics_of_folders(
            [task_folder(folder) for folder in folders or [BUNDLED_TASKS]],
            mix=reweight,
            num_workers=num_workers_of(workers),
            on_task=lambda done, total: tell(f"{done} of {total}") if done % 50 == 0 else None,
        )
    print_statistics(found)
    if plot is not None:
        typer.echo(f"plot: {write_statistics_plot(found, plot)}")
    elif out is not None:
        typer.echo(f"report: {write_dataset_report(found, out)}")


def print_statistics(found: "TaskStatistics") -> None:
    """Print statistics in tables and lines of 80 columns."""
    from rich.console import Console

    from evonav.counted import counted

    console = Console(highlight=False)
    counts = ((found.num_tasks, "task"), (found.num_stages, "stage"), (found.num_houses, "house"))
    what = ", ".join(counted(number, noun) for number, noun in counts)
    console.print(f"{what}; seeds {', '.join(map(str, found.seeds))}; {', '.join(found.generators)}")
    if found.weighting is not None:
        weighting = found.weighting
        console.print(
            f"reweighted to {weighting.mix} by {weighting.by}: equals {weighting.effective_num_tasks:.0f} equally "
            f"weighted tasks, covers {100 * weighting.covered_share:.0f}% of the mix, leaves out "
            f"{counted(weighting.num_left_out, 'task')}"
        )
    console.print(_metrics(found))
    for test in found.tests:
        console.print(_test_words(test), soft_wrap=False)
    for metric in found.metrics:
        if metric.accepted is not None:
            console.print(_verdict(metric))
    console.print()
    for one in found.distributions:
        total = sum(one.counts)
        parts = [f"{name} {100 * count / total:.1f}%" for name, count in zip(one.names, one.counts, strict=True)]
        is_cut = one.key not in ("num_evolutions", "relocated_ratio", "num_rooms", "failures", "outcomes")
        shown = parts[:NUM_NAMES] if is_cut else parts
        more = f" and {len(parts) - len(shown)} more" if len(parts) > len(shown) else ""
        console.print(f"{one.label} ({total}): {', '.join(shown)}{more}")
    console.print(_quantities(found))
    console.print(
        "95% intervals: Wilson where marked w, else percentile bootstrap over houses. Numbers in parentheses are not "
        "in the paper: they are derived from its text, or simulated without images and without rejected goals."
    )


def _metrics(found: "TaskStatistics") -> "Table":
    from rich.table import Table

    table = Table(box=None, padding=(0, 1, 0, 0), title="Metrics in %, unless they say otherwise", title_justify="left")
    table.add_column("", no_wrap=True)
    headings = ["paper", "here", "95%", "n"]
    if found.weighting is not None:
        headings += ["rewtd", "95%"]
    for heading in headings:
        table.add_column(heading, justify="right", no_wrap=True)
    group = ""
    for metric in found.metrics:
        if metric.raw is None:
            continue
        if metric.group != group:
            group = metric.group
            table.add_row(f"[bold]{group}[/bold]")
        mark = "w" if metric.interval == "wilson" else ""
        row = [f" {metric.label}", _paper(metric), *_shown(metric, metric.raw, mark), str(metric.n)]
        if found.weighting is not None:
            row += ["-", ""] if metric.reweighted is None else _shown(metric, metric.reweighted)
        table.add_row(*row)
    return table


def _scaled(metric: "Metric", value: float) -> str:
    return f"{100 * value:.1f}" if "share" in metric.unit else f"{value:.2f}"


def _paper(metric: "Metric") -> str:
    if metric.paper is not None:
        return _scaled(metric, metric.paper)
    if metric.accepted is not None and metric.unit == "median share":
        return "{:.0f}-{:.0f}".format(*(100 * end for end in metric.accepted))
    return "" if metric.expected is None else f"({_scaled(metric, metric.expected)})"


def _shown(metric: "Metric", estimate: "Estimate", mark: str = "") -> list[str]:
    if estimate.ci95 is None:
        return [_scaled(metric, estimate.value), ""]
    low, high = estimate.ci95
    return [_scaled(metric, estimate.value), f"{_scaled(metric, low)}-{_scaled(metric, high)}{mark}"]


def _test_words(test: "Test") -> str:
    total = sum(test.observed)
    observed = "/".join(f"{100 * count / total:.1f}" for count in test.observed)
    expected = "/".join(f"{100 * share:.1f}" for share in test.expected_shares)
    again = "" if test.reweighted_p is None else f", reweighted p {test.reweighted_p:.3f}"
    return f"{test.label}: {observed}, expected {expected}: chi-square {test.statistic:.2f}, p {test.p:.3f}{again}"


def _verdict(metric: "Metric") -> str:
    low, high = metric.accepted or (0.0, 1.0)
    parts = []
    for name, estimate in (("here", metric.raw), ("reweighted", metric.reweighted)):
        if estimate is not None:
            verdict = "inside" if low <= estimate.value <= high else "OUTSIDE"
            parts.append(f"{name} {_scaled(metric, estimate.value)}% is {verdict}")
    return f"{metric.label}: accepted range {100 * low:.0f}-{100 * high:.0f}%, {', '.join(parts)}"


def _quantities(found: "TaskStatistics") -> "Table":
    from rich.table import Table

    table = Table(box=None, padding=(0, 1, 0, 0))
    table.add_column("", no_wrap=True)
    headings = ["mean", "5%", "median", "95%", "n"] + (["rewtd"] if found.weighting is not None else [])
    for heading in headings:
        table.add_column(heading, justify="right", no_wrap=True)
    for one in found.quantities:
        if one.key == "relocated_ratio":
            continue
        row = [_number(value) for value in (one.mean, one.quantiles[1], one.quantiles[3], one.quantiles[5])]
        row.append(str(one.n))
        if found.weighting is not None:
            row.append("-" if one.reweighted_mean is None else _number(one.reweighted_mean))
        table.add_row(f"{one.label}, {one.unit}", *row)
    return table


def _number(value: float) -> str:
    return f"{value:.2f}" if abs(value) < 100 else f"{value:.0f}"
