"""Fuzz a reader of files that others may have made: `PYTHONPATH=tests/helpers python tests/fuzzing/fuzz.py packs`.

Each case is made from the seed and its number alone, so one case can be run again with `--first N --cases 1`. A case
that crashes, hangs or takes too much memory is written to `--out`, and the exit code is 1.
"""

import argparse
import faulthandler
import random
import resource
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import readers
from packs import Packs

MAX_CASE_S = 20.0
"""Longest time of one case; the process ends with a traceback after it."""


class Target(Protocol):
    """A reader, and mutated inputs for it."""

    def case(self, draws: random.Random) -> bytes:
        """Make an input."""
        ...

    def run(self, data: bytes) -> str:
        """Read an input, and return how it ended in one word; other errors than the reader's own are raised."""
        ...


TARGETS: dict[str, Callable[[Path], Target]] = {
    "house_files": readers.house_files,
    "houses": readers.houses,
    "messages": readers.messages,
    "packs": Packs.made_in,
    "responses": readers.responses,
    "sweeps": readers.sweeps,
    "tasks": readers.tasks,
}


def fuzz(target: Target, numbers: range, seed: int, out: Path | None = None) -> tuple[Counter[str], list[int]]:
    """Run cases, and return how they ended, and the numbers of those that failed."""
    ends: Counter[str] = Counter()
    failed: list[int] = []
    for number in numbers:
        data = target.case(random.Random(f"{seed}/{number}"))
        faulthandler.dump_traceback_later(MAX_CASE_S, exit=True)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                ends[target.run(data)] += 1
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            ends[f"FAILED {type(error).__name__}"] += 1
            failed.append(number)
            if out is not None:
                out.mkdir(parents=True, exist_ok=True)
                (out / f"{seed}-{number}.bin").write_bytes(data)
                (out / f"{seed}-{number}.txt").write_text(traceback.format_exc())
        finally:
            faulthandler.cancel_dump_traceback_later()
    return ends, failed


def peak_mb() -> float:
    """Return the largest resident memory of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1 << 20 if sys.platform == "darwin" else 1 << 10)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("target", choices=sorted(TARGETS))
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--max-mb", type=float, default=500.0)
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"))
    given = parser.parse_args()
    began = time.monotonic()
    totals: Counter[str] = Counter()
    failed: list[int] = []
    with tempfile.TemporaryDirectory() as folder:
        target = TARGETS[given.target](Path(folder))
        end = given.first + given.cases
        for first in range(given.first, end, 1000):
            ends, new = fuzz(target, range(first, min(first + 1000, end)), given.seed, given.out / given.target)
            totals += ends
            failed += new
            print(
                f"{sum(totals.values())} cases, {time.monotonic() - began:.0f} s, {peak_mb():.0f} MB: {dict(totals)}",
                flush=True,
            )
    if failed:
        print(f"failed: {failed[:20]}, see {given.out}")
    if peak_mb() > given.max_mb:
        print(f"{peak_mb():.0f} MB, more than {given.max_mb:g}")
    return int(bool(failed) or peak_mb() > given.max_mb)


if __name__ == "__main__":
    sys.exit(main())
