"""`evonav tasks stats`: compare statistics of tasks with the paper's."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import show_tables, status
from evonav.cli.options.shared import PLOTS, Workers, num_workers_of

if TYPE_CHECKING:
    from evonav.tasks.statistics import TaskStatistics

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
    from evonav.report.tasks.dataset_page import statistics_tables

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
    show_tables(statistics_tables(found, is_brief=True))
    for one in found.distributions:
        total = sum(one.counts)
        parts = [f"{name} {100 * count / total:.1f}%" for name, count in zip(one.names, one.counts, strict=True)]
        is_cut = one.key not in ("num_evolutions", "relocated_ratio", "num_rooms", "failures", "outcomes")
        shown = parts[:NUM_NAMES] if is_cut else parts
        more = f" and {len(parts) - len(shown)} more" if len(parts) > len(shown) else ""
        console.print(f"{one.label} ({total}): {', '.join(shown)}{more}")
