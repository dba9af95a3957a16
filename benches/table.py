"""The README that keeps the sections."""

from collections.abc import Sequence
from pathlib import Path

from evonav.report.machine import machine_name
from evonav.speed_benchmark.timing import Row

README = Path(__file__).with_name("README.md")
_INTRODUCTION = """# Benchmarks
Written by `python -m benches` (`make bench`); `python -m benches NAME` runs and rewrites one section. Figures are CPU
time on one core; evonav and its peer take turns on the same input. *Ratio*: median of peer / evonav by pairs; above 1
evonav is faster. `evonav bench speed NAME --against FILE` compares with an earlier run. Machine: below each table.
"""


def write_section(title: str, notes: str, rows: Sequence[Row] | str) -> str:
    """Replaces a section of the README, or appends it; returns the section. A string is a table of its own kind."""
    lines = [rows] if isinstance(rows, str) else []
    if not isinstance(rows, str):
        facts = list(dict.fromkeys(name for row in rows for name in row.facts))
        columns = ["operation", "evonav", "peer", "its time", "ratio", *facts]
        lines += [f"| {' | '.join(columns)} |", f"|{' --- |' * len(columns)}"]
        lines += [_line(row, facts) for row in rows]
    body = "\n".join([f"## {title}", notes.strip(), "", *lines, "", f"{machine_name()}.", ""])
    sections = _sections(README.read_text(encoding="utf-8")) if README.exists() else {}
    sections[title] = body
    README.write_text("\n".join([_INTRODUCTION, *sections.values()]), encoding="utf-8")
    return body


def _line(row: Row, facts: Sequence[str]) -> str:
    ratio = "" if row.ratio is None else f"{row.ratio:.1f}"
    peer_time = "" if row.peer_ms is None else f"{row.peer_ms:.3g} ms"
    figures = [f"{row.facts[name]:.4g}" if name in row.facts else "" for name in facts]
    return f"| {' | '.join([row.operation, f'{row.ms:.3g} ms', row.peer or '', peer_time, ratio, *figures])} |"


def _sections(text: str) -> dict[str, str]:
    parts = text.split("\n## ")[1:]
    return {part.split("\n", 1)[0]: f"## {part.rstrip()}\n" for part in parts}
