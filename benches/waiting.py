"""Many episodes at once: what asking a slow model costs, and how little an episode needs that waits for it."""

import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from evonav.decision.vlm.mock_answers import mock_answer
from evonav.decision.vlm.mock_server import FAULTS, MockReply, MockServer, serving

NOTES = """\
`evonav evaluate --decision vlm` on the bundled tasks; the model answers after 1 s, 5% of the questions meet an error
of the server. CPU and memory are those of driver, workers and agents.
"""
LATENCY_S = 1.0
WINDOW_S = 30.0
LONGEST_START_S = 200.0
AGENTS = "fu,ftu,stage-reset,3d-mem,msgnav"
NUMBERS = ((1, 1), (2, 12), (2, 50))
"""Workers, and episodes that each runs at once."""
_FAULTS = ("server_error", "malformed", "truncated", "refusal", "broken_json")


def run() -> str:
    """The table."""
    os.sched_setaffinity(0, range(os.cpu_count() or 1))
    load = os.getloadavg()[0]
    lines = [
        "| episodes at once | workers | questions/s | CPU, cores | CPU a question | memory | an episode more |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    alone_mb = None
    for num_workers, at_once in NUMBERS:
        num_episodes = num_workers * at_once
        asked_per_s, cores, memory_mb = measured(num_workers, at_once)
        more = "" if alone_mb is None else f"{(memory_mb - alone_mb) / (num_episodes - 1):.0f} MB"
        alone_mb = memory_mb if alone_mb is None else alone_mb
        each = f"{1e3 * cores / asked_per_s:.0f} ms" if asked_per_s else ""
        lines.append(
            f"| {num_episodes} | {num_workers} | {asked_per_s:.1f} | {cores:.2f} | {each} "
            f"| {memory_mb:.0f} MB | {more} |"
        )
    return "\n".join([*lines, "", f"{os.cpu_count()} cores, load before it began: {load:.1f}."])


def reply(request: dict[str, Any]) -> MockReply:
    """Answers late, or fails: by the request alone, so that every run has the same answers."""
    number = int(hashlib.sha256(json.dumps(request, sort_keys=True).encode()).hexdigest()[:8], 16)
    answer: MockReply = FAULTS[_FAULTS[number // 20 % 5]] if number % 20 == 0 else {"text": mock_answer(request)}
    return {**answer, "hang_s": LATENCY_S}


def measured(num_workers: int, at_once: int) -> tuple[float, float, float]:
    """Questions a second, cores in use, and memory of a run in the middle of it."""
    num_episodes = num_workers * at_once
    server = MockServer(reply)
    server.requests = None
    with (
        tempfile.TemporaryDirectory() as folder,
        serving(server),
        _running(command(server.url, Path(folder) / "run", num_workers, at_once)) as pid,
    ):
        began_s = time.monotonic()
        while len(_tree(pid)) <= num_episodes or server.num_requests < 2 * num_episodes:
            if time.monotonic() - began_s > LONGEST_START_S:
                raise AssertionError(f"{len(_tree(pid))} processes, {server.num_requests} questions so far")
            time.sleep(0.5)
        before, cpu_s, from_s = server.num_requests, _cpu_s(pid), time.monotonic()
        memory_mb = []
        while time.monotonic() - from_s < WINDOW_S:
            time.sleep(WINDOW_S / 6)
            memory_mb.append(sum(map(_pss_mb, _tree(pid))))
        passed_s = time.monotonic() - from_s
        return (server.num_requests - before) / passed_s, (_cpu_s(pid) - cpu_s) / passed_s, max(memory_mb)


def command(url: str, out: Path, num_workers: int, at_once: int) -> list[str]:
    """The run: five agents on the bundled tasks."""
    asked = ["--decision", "vlm", "--model", "mock", "--base-url", url, "--set", "decision.max_retries=0"]
    how_many = ["--workers", str(num_workers), "--set", f"episodes_at_once={at_once}"]
    return [sys.executable, "-m", "evonav", "evaluate", "--agent", AGENTS, *asked, "--out", str(out), *how_many]


@contextmanager
def _running(command: Sequence[str]) -> Iterator[int]:
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process.pid
    finally:
        process.terminate()
        process.wait()


def _tree(pid: int) -> list[int]:
    """A process and all that descend from it."""
    parents: dict[int, int] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with suppress(OSError):
                parents[int(entry.name)] = int(_stat(int(entry.name))[1])
    found, fresh = [pid], {pid}
    while fresh:
        fresh = {child for child, parent in parents.items() if parent in fresh}
        found += sorted(fresh)
    return found


def _stat(pid: int) -> list[str]:
    """Fields of `/proc/PID/stat` from the state on."""
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()


def _cpu_s(pid: int) -> float:
    """CPU time of all processes, those that have ended included."""
    total = 0
    for one in _tree(pid):
        with suppress(OSError):
            total += sum(map(int, _stat(one)[11:15]))
    return total / os.sysconf("SC_CLK_TCK")


def _pss_mb(pid: int) -> float:
    with suppress(OSError, StopIteration):
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
        return int(next(line for line in lines if line.startswith("Pss:")).split()[1]) / 1024
    return 0.0
