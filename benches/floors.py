"""Where aims are missed: what a part of the work takes alone, in the same turns as the whole."""

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from benches.alone.round_trip import BarePair
from benches.alone.row import HEAD
from evonav.tasks.bundled import bundled_tasks

NOTES = """What stands between a figure and its aim (*Before and after*): each part was measured alone, in turn with the
figure and in the same process or run. Times are CPU time, medians; where the text says wall clock, wall time. *aim /
now*: the share of the present time that the aim leaves, where this run can tell (it needs a time, or the peer's turns).
*alone / now*: the share that the part takes, median of turns. If that is above *aim / now*, the aim needs another way
to do this part; if it is below, the rest stands between, of which the last column says what it is. A share is no proof
that the rest can go. *The core's calls again*: every call of a stage into the core is recorded, and made once more in
one process with nothing around it, checked to end with the same object maps; its images come from memory, where a
stage finds them in caches. Were Python free, a stage would gain now / alone. *Two bare processes*: a fork over a
socket, bytes of the sizes that rounds have, both on one core. It takes some minutes.
Again: `python -m benches floors [--houses FILE] [--tasks NUMBER] [--parts stages,kernels,commands]`.
"""


@dataclass
class Options:
    """Options that the command line sets."""

    houses: Path | None = None
    tasks: int = 6
    parts: str = "stages,kernels,commands"


options = Options()


def configure(arguments: Sequence[str]) -> None:
    """Takes the options of the command line."""
    parser = argparse.ArgumentParser(prog="python -m benches floors")
    parser.add_argument("--houses", type=Path, help="file of hard houses; default: the bundled ones")
    parser.add_argument("--tasks", type=int, default=options.tasks, help="number of tasks of `fu`")
    parser.add_argument("--parts", default=options.parts, help="of stages,kernels,commands")
    parser.parse_args(arguments, namespace=options)


def run() -> str:
    """The table."""
    load = os.getloadavg()[0]
    lines = [HEAD]
    for line in _rows():
        sys.stderr.write(f"{line}\n")
        lines.append(line)
    said = f"{os.cpu_count()} cores; load {load:.1f} before it began, {os.getloadavg()[0]:.1f} at its end."
    return "\n".join([*lines, "", said])


def _rows() -> Iterator[str]:
    # Imported by part: each needs libraries of its own, and the fork of a bare pair should be small.
    if "stages" in options.parts:
        yield from _stages()
    if "kernels" in options.parts:
        from benches.alone import kernels

        yield from kernels.rows()
    if "commands" in options.parts:
        from benches.alone import commands

        yield from commands.rows(options.houses)


def _stages() -> Iterator[str]:
    with BarePair() as pair, bundled_tasks() as folder, tempfile.TemporaryDirectory() as made:
        from benches.alone import stages

        bundled = _in(folder)
        tasks, houses = bundled, "bundled tasks"
        if options.houses is not None:
            tasks, houses = _generated(options.houses, Path(made)), "hard houses"
        yield from stages.rows(f"`fu` on {houses}", ["fu"], tasks[: options.tasks], "2.4 times a82ecdf", pair)
        agents, some = ["fu", "ftu", "stage-reset"], bundled[:: len(bundled) // 2][:2]
        yield from stages.rows("three heuristics on bundled tasks", agents, some, "2.8 times a82ecdf", None)


def _generated(houses: Path, out: Path) -> list[Path]:
    limit = ["--limit", str(options.tasks), "--workers", "1"]
    command = [sys.executable, "-m", "evonav", "generate", "--houses", houses, "--out", out, *limit]
    subprocess.run(command, check=True, capture_output=True)
    return _in(out)


def _in(folder: Path) -> list[Path]:
    return sorted(one.parent for one in folder.glob("*/task.json"))
