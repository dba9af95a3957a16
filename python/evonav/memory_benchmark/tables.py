"""Build the tables of the memory benchmark."""

import math
from collections.abc import Mapping, Sequence

from evonav.memory_benchmark.aggregate import BASELINE, estimates, ratios
from evonav.memory_benchmark.records import BenchmarkResult, kinds_of
from evonav.memory_benchmark.streams.spec import TITLES
from evonav.report.tables.numbers import NONE
from evonav.report.tables.table import Table
from evonav.statistics import Estimate, Interval

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
    baseline = next((one for one in result.memories if one.memory == BASELINE), None)
    found = {}
    for memory in result.memories:
        figures = estimates(memory, kind)
        ratio = None if baseline is None else ratios(memory, baseline, kind).get(P95)
        found[memory.memory] = figures if ratio is None else {**figures, RATIO: ratio}
    return found


def memory_tables(result: BenchmarkResult) -> list[Table]:
    """Build all tables: the main one, further figures, one for each kind of stream, failures, and notes."""
    found = scores(result)
    tables = [_table("Memories", result, found, COLUMNS, None, NOTES), _table("More", result, found, MORE, None)]
    kinds = kinds_of(result.memories)
    titles: dict[str, str] = {str(name): title for name, title in TITLES.items()}
    for kind in kinds if len(kinds) > 1 else ():
        title = f"{kind}: {titles[kind]}" if kind in titles else kind
        tables.append(_table(title, result, scores(result, kind), COLUMNS, kind))
    rows = tuple(
        (memory.memory, one.stream, one.failure.kind, str(one.num_frames), one.failure.message)
        for memory in result.memories
        for one in memory.failures
        if one.failure is not None
    )
    if rows:
        tables.append(Table(FAILURES, ("memory", "stream", "what", "frames", "message"), rows))
    noted = tuple(
        (memory.memory, one.stream, note) for memory in result.memories for one in memory.streams for note in one.notes
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
        heading: [text_of(found[memory.memory].get(name), scale, digits) for memory in result.memories]
        for name, heading, scale, digits in columns
    }
    shown = {heading: texts for heading, texts in cells.items() if set(texts) != {NONE}}
    streams = []
    for memory in result.memories:
        num_failed = len([one for one in memory.failures if kind in (None, one.kind)])
        streams.append(f"{len(memory.of_kind(kind))}{f' ({num_failed} failed)' if num_failed else ''}")
    rows = zip([memory.memory for memory in result.memories], streams, *shown.values(), strict=True)
    return Table(title, ("memory", "streams", *shown), tuple(rows), notes)


def text_of(estimate: Estimate | None, scale: float = 1.0, digits: int = 1) -> str:
    """Return a value with its interval: `3.0 [2.0, 5.0]`; infinite ones are `not reached` and `∞`."""
    if estimate is None or estimate.value is None:
        return NONE
    value = NOT_REACHED if math.isinf(estimate.value) else f"{scale * estimate.value:.{digits}f}"
    return f"{value} [{_ends(estimate.ci95, scale, digits)}]"


def _ends(ends: Interval | None, scale: float, digits: int) -> str:
    if ends is None:
        return NONE
    return ", ".join("∞" if math.isinf(end) else f"{scale * end:.{digits}f}" for end in ends)
