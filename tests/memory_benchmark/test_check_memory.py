"""What `check_memory` says of memories that keep the contract, or break it in one way."""

from pathlib import Path
from typing import Any

import bad_memories
import pytest

from evonav.memory_benchmark.check import check_memory
from evonav.memory_benchmark.references import NumpyList

FILE = Path(bad_memories.__file__)


class Bare(NumpyList):
    """Has only the methods that a memory must have."""

    locate = None  # type: ignore[assignment]
    num_bytes = None  # type: ignore[assignment]


class Writes(Bare):
    def observe(self, frame: Any) -> None:
        super().observe(frame)
        frame.view.depth_m[:] = 1.0


def verdicts(report: Any) -> dict[str, str]:
    return {check.name: check.verdict for check in report.checks}


def test_plain_list_keeps_the_contract() -> None:
    report = check_memory(Bare)
    assert report.is_ok, report
    assert verdicts(report) == {
        "importable": "pass",
        "calls": "pass",
        "entries": "pass",
        "remembers": "pass",
        "updates": "warn",
        "locate": "skip",
        "num_bytes": "skip",
        "determinism": "pass",
        "reset": "pass",
        "frames": "pass",
        "time": "pass",
    }
    assert repr(report).startswith("Bare: keeps the contract\npass  importable   it has reset")


def test_example_keeps_the_contract() -> None:
    report = check_memory(f"{FILE.parents[2] / 'examples' / 'own_memory.py'}:OwnMemory")
    assert report.is_ok, report
    assert verdicts(report)["remembers"] == "pass"


def test_named_memory_that_keeps_an_entry_over_a_reset() -> None:
    report = check_memory(f"{FILE}:Good")
    assert not report.is_ok
    found = verdicts(report)
    assert (found["remembers"], found["reset"], found["locate"], found["num_bytes"]) == ("warn", "fail", "warn", "pass")
    assert "1 entry left after `reset`" in repr(report)


def test_memory_that_writes_into_its_frames() -> None:
    report = check_memory(Writes)
    assert verdicts(report)["frames"] == "warn"


@pytest.mark.parametrize(
    ("name", "point", "finding"),
    [
        ("Dies", "calls", "the memory's process died (exit code 7) (frame 3 of the check)"),
        ("Hangs", "calls", "no answer to `observe` within 1 s (frame 3 of the check)"),
        ("NanBoxes", "answers", "entries()[1].centre_m = (1.0, nan, 0.0): must be finite (frame 0 of the check)"),
        ("Raising", "importable", "cannot be made: OSError: no weights"),
    ],
)
def test_breach_is_one_sentence(name: str, point: str, finding: str) -> None:
    report = check_memory(f"{FILE}:{name}", timeout_s=1.0)
    (check,) = report.checks
    assert (check.name, check.verdict) == (point, "fail")
    assert finding in check.finding
    verdict = "cannot be checked" if point == "importable" else "breaks the contract"
    assert repr(report).splitlines()[0].endswith(f"{name}: {verdict}")
