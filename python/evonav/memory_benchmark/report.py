"""Write the files of a run: `report.html`, `plot.svg` where matplotlib is installed, `result.json`, `summary.md`."""

import math
from pathlib import Path

import numpy as np

from evonav.memory_benchmark.metrics.staleness import durations_of, kaplan_meier
from evonav.memory_benchmark.records import BenchmarkResult
from evonav.memory_benchmark.tables import HALF_LIFE, P95, Scores, memory_tables, scores
from evonav.parallel.folders import write_atomically
from evonav.report.pages.template import page_text, text_of
from evonav.report.plots.render import has_renderer, plot_elements, write_plots
from evonav.report.plots.specs import CurvePlot, Dot, Line, Plot, ScatterPlot
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
    write_atomically(folder / JSON_NAME, result.model_dump_json() + "\n")
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


MAX_FRAMES = 30
"""Frames of evidence that the survival curves show."""


def main_plot(found: Scores) -> ScatterPlot:
    """Return the plot of latency and half-life; memories without either are left out."""
    dots = []
    for name, figures in found.items():
        latency, half_life, size = (figures.get(key) for key in (P95, HALF_LIFE, "bytes_per_entry"))
        if latency is None or half_life is None or not latency.value or half_life.value is None:
            continue
        is_reached = math.isfinite(half_life.value)
        num_bytes = None if size is None else size.value
        dots.append(
            Dot(
                name,
                latency.value,
                half_life.value if is_reached else None,
                num_bytes,
                "" if num_bytes is None else f"{num_bytes:,.0f} bytes an entry",
                latency.ci95,
                half_life.ci95 if is_reached else None,
            )
        )
    return ScatterPlot(
        "Latency and staleness",
        tuple(dots),
        "p95 of observe, CPU ms (area: bytes an entry)",
        "half-life of stale entries, frames of evidence",
        "not reached",
    )


def memory_plots(result: BenchmarkResult, found: Scores) -> list[Plot]:
    """Return the plots of a run, in reading order; those without anything to show are left out."""
    plots: list[Plot] = []
    main = main_plot(found)
    if main.dots:
        plots.append(main)
    survival = survival_plot(result)
    if survival.lines:
        plots.append(survival)
    return plots


def survival_plot(result: BenchmarkResult) -> CurvePlot:
    """Return the share of stale entries that outlast so many frames of evidence, a line a memory."""
    lines = []
    for memory in result.memories:
        spells = [spell for stream in memory.of_kind(None) for spell in stream.spells]
        durations, is_over = durations_of(spells, "evident", "evidence_frames")
        if not len(durations):
            continue
        survival = kaplan_meier(durations, is_over)
        frames = np.arange(MAX_FRAMES + 1)
        number = np.searchsorted(survival.durations, frames, side="right")
        shares = np.concatenate([[1.0], survival.shares])[number]
        points = tuple(zip(frames.astype(float).tolist(), (100.0 * shares).tolist(), strict=True))
        lines.append(Line(memory.memory, points, has_dots=False))
    return CurvePlot(
        "Stale entries that are left", tuple(lines), "frames of evidence", "% of stale entries", y_top=100.0
    )
