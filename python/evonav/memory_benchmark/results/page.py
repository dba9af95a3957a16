"""Write the files of a run: `report.html`, `plot.svg` where matplotlib is installed, `result.json`, `summary.md`."""

from pathlib import Path

from evonav.memory_benchmark.records import BenchmarkResult, write_result
from evonav.memory_benchmark.results.plots import main_plot, memory_plots
from evonav.memory_benchmark.results.tables import memory_tables, scores
from evonav.parallel.folders import write_atomically
from evonav.report.pages.template import page_text, text_of
from evonav.report.plots.render import has_renderer, plot_elements, write_plots
from evonav.report.plots.style import plot_css
from evonav.report.tables.table import markdown_tables

PAGE_NAME, JSON_NAME, MARKDOWN_NAME, PLOT_NAME = "report.html", "result.json", "summary.md", "plot.svg"


def write_memory_report(result: BenchmarkResult, folder: Path, *, num_missing: int = 0) -> Path:
    """Write the files of a result into a folder.

    Args:
        num_missing: Number of streams that were asked for and have no record.

    Returns:
        The page.

    Raises:
        StoreError: A file cannot be written.
    """
    found, tables = scores(result), memory_tables(result)
    folder.mkdir(parents=True, exist_ok=True)
    write_result(result, folder / JSON_NAME)
    write_atomically(folder / MARKDOWN_NAME, markdown_tables(tables))
    plot = main_plot(found)
    if plot.dots and has_renderer():
        write_plots([plot], folder / PLOT_NAME)
    streams = {stream.stream: stream for memory in result.memories for stream in memory.streams}
    text = page_text(
        "memory.html.j2",
        text_of("report.css") + plot_css() + text_of("perception.css"),
        machine=result.machine,
        version=result.evonav_version,
        names=[memory.memory for memory in result.memories],
        num_streams=len(streams),
        num_houses=len({stream.house for stream in streams.values()}),
        missing=num_missing,
        tables=tables,
        plots=plot_elements(memory_plots(result, found)),
    )
    return write_atomically(folder / PAGE_NAME, text)
