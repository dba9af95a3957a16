"""Show a result: its tables and plots, and the files of a run.

They are `report.html`, `plot.svg` where matplotlib is installed, `result.json` and `summary.md`.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from evonav.memory_benchmark.aggregate import BASELINE, estimates, ratios
from evonav.memory_benchmark.metrics.spells import durations_of, kaplan_meier
from evonav.memory_benchmark.records import BenchmarkResult, judged
from evonav.memory_benchmark.streams.spec import TITLES
from evonav.parallel.folders import write_atomically
from evonav.report.pages.template import page_text
from evonav.report.pages.template import text_of as file_text
from evonav.report.plots.render import has_renderer, plot_elements, write_plots
from evonav.report.plots.specs import CurvePlot, Dot, Line, Plot, ScatterPlot
from evonav.report.plots.style import plot_css
from evonav.report.tables.numbers import NONE
from evonav.report.tables.table import Table, markdown_tables
from evonav.statistics import Estimate

PAGE_NAME, JSON_NAME, MARKDOWN_NAME, PLOT_NAME = "report.html", "result.json", "summary.md", "plot.svg"

NOT_REACHED = "not reached"
FAILURES, REMARKS = "Failures", "Notes"
"""Titles of tables that are there only if they have rows."""
P95 = "observe_cpu_p95_ms"
HALF_LIFE = "half_life_evidence_frames"
RATIO = "p95_over_baseline"

Column = tuple[str, str, float, int]
"""Name of a figure, heading, factor and digits."""
COLUMNS: tuple[Column, ...] = (
    (P95, "p95 ms", 1.0, 2),
    (RATIO, f"/ {BASELINE}", 1.0, 2),
    ("slope_per_100_entries_ms", "ms per 100 entries", 1.0, 2),
    (HALF_LIFE, "half-life, frames", 1.0, 1),
    ("false_forgets", "false forgets %", 1.0, 2),
    ("removal_f1", "removal F1 %", 100.0, 1),
    ("change_f1", "change F1 %", 100.0, 1),
    ("hit_at_1_before", "hit@1 before %", 1.0, 1),
    ("hit_at_1_after_evidence", "hit@1 after %", 1.0, 1),
    ("bytes_per_entry", "bytes an entry", 1.0, 0),
)
MORE: tuple[Column, ...] = (
    ("observe_wall_p95_ms", "p95 wall ms", 1.0, 2),
    ("locate_cpu_p95_ms", "locate p95 ms", 1.0, 3),
    ("real_time_factor", "x real time", 1.0, 0),
    ("slope_per_1000_frames_ms", "ms per 1,000 frames", 1.0, 2),
    ("rss_growth_mb_per_minute", "RSS MB/min", 1.0, 1),
    ("precision", "entries right %", 100.0, 1),
    ("recall", "seen and remembered %", 100.0, 1),
    ("duplicates", "duplicates %", 1.0, 1),
    ("removal_recall", "removals %", 100.0, 1),
    ("addition_recall", "additions %", 100.0, 1),
    ("move_recall", "moves as one entry %", 100.0, 1),
    ("half_life_s", "half-life, s", 1.0, 1),
    ("half_life_m", "half-life, m", 1.0, 1),
    ("half_life_unseen_frames", "unseen, frames", 1.0, 0),
    ("never_cleared", "never cleared %", 1.0, 1),
    ("hit_at_1_after", "hit@1 unaware %", 1.0, 1),
    ("brier", "Brier", 1.0, 3),
    ("nll", "NLL", 1.0, 3),
    ("ece", "ECE", 1.0, 3),
)
NOTES = (
    f"p95: 95th percentile of observe in CPU ms, mean over streams; / {BASELINE}: over that of the memory {BASELINE} "
    "in the same streams. Half-life: frames with evidence after which half of the stale entries are gone (Kaplan and "
    "Meier). Hit@1 before: of labels of which no object has changed; after: of which one has, and was seen to.",
    "Intervals: 95%, houses resampled; – where one house or equal houses give none.",
)

Scores = Mapping[str, Mapping[str, Estimate]]
"""Figures by memory and name."""


def scores(result: BenchmarkResult, kind: str | None = None) -> dict[str, dict[str, Estimate]]:
    """Return the figures of all memories, and the ratio of each to the baseline.

    Args:
        kind: Kind of streams; default: all.
    """
    baseline, found = result.memories.get(BASELINE, ()), {}
    for memory, streams in result.memories.items():
        ratio = ratios(streams, baseline, kind).get(P95)
        found[memory] = {**estimates(streams, kind), **({} if ratio is None else {RATIO: ratio})}
    return found


def memory_tables(result: BenchmarkResult) -> list[Table]:
    """Build all tables: the main one, further figures, one for each kind of stream, failures, and notes."""
    found = scores(result)
    tables = [_table("Memories", result, found, COLUMNS, None, NOTES), _table("More", result, found, MORE, None)]
    titles = {str(kind): f"{kind}: {title}" for kind, title in TITLES.items()}
    kinds = sorted({one.kind for streams in result.memories.values() for one in streams})
    for kind in kinds if len(kinds) > 1 else ():
        tables.append(_table(titles.get(kind, kind), result, scores(result, kind), COLUMNS, kind))
    rows = tuple(
        (memory, one.stream, one.failure.kind, str(one.num_frames), one.failure.message)
        for memory, streams in result.memories.items()
        for one in streams
        if one.failure is not None
    )
    if rows:
        tables.append(Table(FAILURES, ("memory", "stream", "what", "frames", "message"), rows))
    noted = tuple(
        (memory, one.stream, note)
        for memory, streams in result.memories.items()
        for one in streams
        for note in one.notes
    )
    return [*tables, Table(REMARKS, ("memory", "stream", "note"), noted)] if noted else tables


def _table(
    title: str,
    result: BenchmarkResult,
    found: Scores,
    columns: Sequence[Column],
    kind: str | None,
    notes: tuple[str, ...] = (),
) -> Table:
    cells = {
        heading: [text_of(found[memory].get(name), scale, digits) for memory in result.memories]
        for name, heading, scale, digits in columns
    }
    shown = {heading: texts for heading, texts in cells.items() if set(texts) != {NONE}}
    streams = []
    for every in result.memories.values():
        num_failed = sum(one.failure is not None and kind in (None, one.kind) for one in every)
        streams.append(f"{len(judged(every, kind))}{f' ({num_failed} failed)' if num_failed else ''}")
    rows = zip(result.memories, streams, *shown.values(), strict=True)
    return Table(title, ("memory", "streams", *shown), tuple(rows), notes)


def text_of(estimate: Estimate | None, scale: float = 1.0, digits: int = 1) -> str:
    """Return a value with its interval: `3.0 [2.0, 5.0]`; infinite ones are `not reached` and `∞`."""
    if estimate is None or estimate.value is None:
        return NONE
    value = NOT_REACHED if math.isinf(estimate.value) else f"{scale * estimate.value:.{digits}f}"
    ends = ", ".join("∞" if math.isinf(end) else f"{scale * end:.{digits}f}" for end in estimate.ci95 or ())
    return f"{value} [{ends or NONE}]"


def write_memory_report(result: BenchmarkResult, folder: Path, *, num_missing: int = 0) -> Path:
    """Write the files of a result into a folder.

    Args:
        num_missing: Number of streams that were asked for and have no record.

    Returns:
        The page.

    Raises:
        StoreError: A file cannot be written.
    """
    tables = memory_tables(result)
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / JSON_NAME, result.model_dump_json() + "\n")
    write_atomically(folder / MARKDOWN_NAME, markdown_tables(tables))
    latency, survival = latency_plot(scores(result)), survival_plot(result)
    plots: list[Plot] = [*([latency] if latency.dots else []), *([survival] if survival.lines else [])]
    if latency.dots and has_renderer():
        write_plots([latency], folder / PLOT_NAME)
    streams = {one.stream: one for streams in result.memories.values() for one in streams}
    text = page_text(
        "memory.html.j2",
        file_text("report.css") + plot_css() + file_text("perception.css"),
        machine=result.machine,
        version=result.evonav_version,
        names=list(result.memories),
        num_streams=len(streams),
        num_houses=len({stream.house for stream in streams.values()}),
        missing=num_missing,
        tables=tables,
        plots=plot_elements(plots),
    )
    return write_atomically(folder / PAGE_NAME, text)


MAX_FRAMES = 30
"""Frames of evidence that the survival curves show."""


def latency_plot(found: Scores) -> ScatterPlot:
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


def survival_plot(result: BenchmarkResult) -> CurvePlot:
    """Return the share of stale entries that outlast so many frames of evidence, a line a memory."""
    lines = []
    for memory, streams in result.memories.items():
        spells = [spell for stream in judged(streams) for spell in stream.spells]
        durations, is_over = durations_of(spells, "evident", "evidence_frames")
        if not len(durations):
            continue
        ends, left = kaplan_meier(durations, is_over)
        frames = np.arange(MAX_FRAMES + 1)
        shares = np.concatenate([[1.0], left])[np.searchsorted(ends, frames, side="right")]
        points = tuple(zip(frames.astype(float).tolist(), (100.0 * shares).tolist(), strict=True))
        lines.append(Line(memory, points, has_dots=False))
    return CurvePlot(
        "Stale entries that are left", tuple(lines), "frames of evidence", "% of stale entries", y_top=100.0
    )
