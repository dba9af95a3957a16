"""Rows of a section, and the README that keeps them."""

import gc
import platform
import statistics
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

README = Path(__file__).with_name("README.md")
_INTRODUCTION = """# Benchmarks
Written by `python -m benches` (`make bench`); `python -m benches NAME` runs and rewrites one section. Every figure is
CPU time of this process on one core, evonav and its peer in turn on the same input in the same run. *Ratio* is the
median of the pairwise ratios peer / evonav: above 1 evonav is faster. Machines differ and drift; the ratios say more
than the milliseconds.
"""


@dataclass(frozen=True)
class Row:
    """One operation against one peer."""

    operation: str
    peer: str
    evonav_ms: float
    """Median."""
    peer_ms: float | None
    """Median; `None` where the peer cannot be run, which `peer` then explains."""
    ratio: float | None = None


def compare(
    operation: str,
    ours: Callable[[int], object],
    peers: Mapping[str, Callable[[int], object]],
    num_inputs: int,
    *,
    repeats: int = 1,
    prepare: Callable[[int], None] | None = None,
) -> list[Row]:
    """Times `ours` and the peers on inputs `0 .. num_inputs - 1`, in turn.

    Args:
        operation: What is done, with its size.
        ours: Called with the input's number.
        peers: The same by others, by name.
        num_inputs: How many inputs there are; the first tenth is run once more before, as a warm-up.
        repeats: Calls of `ours` that make one measurement, where a single one is too short for the clock.
        prepare: Called with an input's number before it is measured; not timed.
    """

    def once(call: Callable[[int], object], number: int, calls: int) -> float:
        start_s = time.process_time()
        for _ in range(calls):
            call(number)
        return (time.process_time() - start_s) / calls

    prepare = prepare or (lambda _: None)
    for number in range(max(1, num_inputs // 10)):
        prepare(number)
        for call in (ours, *peers.values()):
            call(number)
    ours_s: list[float] = []
    peers_s: dict[str, list[float]] = {name: [] for name in peers}
    gc.disable()
    try:
        for number in range(num_inputs):
            prepare(number)
            ours_s.append(once(ours, number, repeats))
            for name, call in peers.items():
                peers_s[name].append(once(call, number, 1))
    finally:
        gc.enable()
    return [
        Row(
            operation,
            name,
            1e3 * statistics.median(ours_s),
            1e3 * statistics.median(times_s),
            statistics.median(peer_s / our_s for peer_s, our_s in zip(times_s, ours_s, strict=True)),
        )
        for name, times_s in peers_s.items()
    ]


def write_section(title: str, notes: str, rows: Sequence[Row] | str) -> str:
    """Replaces a section of the README, or appends it; returns the section. A string is a table of its own kind."""
    lines = [rows] if isinstance(rows, str) else []
    if not isinstance(rows, str):
        lines += ["| operation | evonav | peer | its time | ratio |", "| --- | --- | --- | --- | --- |"]
        lines += [_line(row) for row in rows]
    body = "\n".join([f"## {title}", notes.strip(), "", *lines, "", f"Measured on {_machine()}.", ""])
    sections = _sections(README.read_text(encoding="utf-8")) if README.exists() else {}
    sections[title] = body
    README.write_text("\n".join([_INTRODUCTION, *sections.values()]), encoding="utf-8")
    return body


def _line(row: Row) -> str:
    if row.peer_ms is None or row.ratio is None:
        return f"| {row.operation} | {row.evonav_ms:.3g} ms | {row.peer} | not run | |"
    return f"| {row.operation} | {row.evonav_ms:.3g} ms | {row.peer} | {row.peer_ms:.3g} ms | {row.ratio:.1f} |"


def _sections(text: str) -> dict[str, str]:
    parts = text.split("\n## ")[1:]
    return {part.split("\n", 1)[0]: f"## {part.rstrip()}\n" for part in parts}


def _machine() -> str:
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names: Iterable[str] = (line for line in cpuinfo.read_text().splitlines() if line.startswith("model name"))
        model = next(iter(names), f": {model}").split(":", 1)[1].strip()
    return f"{model}, {platform.system()}, Python {platform.python_version()}"
