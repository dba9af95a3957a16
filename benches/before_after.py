"""Two versions of evonav in turn on one machine, and the best peer of each operation."""

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benches.versions import kernels, runs
from benches.versions.lines import HEAD, Line
from benches.versions.version import ROOT, Version

NOTES = """Two checkouts, each with its core built in release mode, run in turn: operations call by call in a process
each, on one core and on the same inputs, the fastest of up to four calls after a first; evaluations eight tasks a turn,
on tasks that the earlier version made. Times are CPU time, medians; *gain* is the median of the ratios of pairs (of
sums where stages are counted): above 1 the later version is better. *Peer's*: how many times better each version is
than the best peer, which takes its turn in the same loop. A dash: the earlier version has no such thing. An agent's own
process: the least of four turns of each stage, and the median of eight tasks each.
Again: `python -m benches before_after --before FOLDER [--houses FILE]`.
"""


@dataclass
class Options:
    """Options that the command line sets."""

    before: Path | None = None
    houses: Path | None = None
    limit: int | None = None
    parts: str = "kernels,runs"


options = Options()


def configure(arguments: Sequence[str]) -> None:
    """Takes the options of the command line."""
    parser = argparse.ArgumentParser(prog="python -m benches before_after")
    parser.add_argument("--before", type=Path, required=True, help="checkout of the earlier version, its core built")
    parser.add_argument("--houses", type=Path, help="file of hard houses")
    parser.add_argument("--limit", type=int, help="number of tasks")
    parser.add_argument("--parts", default=options.parts, help="of kernels,runs")
    parser.parse_args(arguments, namespace=options)  # type: ignore[type-var]


def run() -> str:
    """The table."""
    if options.before is None:
        raise SystemExit("give the checkout of an earlier version: python -m benches before_after --before FOLDER")
    load = os.getloadavg()[0]
    rows: list[Line] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        inputs = folder / "inputs.npz"
        kernels.write_inputs(inputs)
        old_words = {"--agent": "--agents"}
        new_words = {"--agents": "--agent", "--in-process": "--isolation=none"}
        with Version(options.before, inputs, old_words) as before, Version(ROOT, inputs, new_words) as after:
            sizes = [version.answer(("size",), 0) for version in (before, after)]
            if "kernels" in options.parts:
                rows += map(_told, kernels.lines(before, after))
            if "runs" in options.parts:
                rows += map(_told, runs.lines(before, after, options.houses, folder, options.limit))
    said = f"{os.cpu_count()} cores; load {load:.1f} before it began, {os.getloadavg()[0]:.1f} at its end."
    houses = f"The {kernels.NUM_HOUSES} houses have {sizes[0]:,} triangles before, {sizes[1]:,} after."
    return "\n".join([HEAD, *map(str, rows), "", f"{said} {houses}"])


def _told(line: Line) -> Line:
    """Says on the way what was measured."""
    sys.stderr.write(f"{line}\n")
    return line
