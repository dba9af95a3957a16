"""Find the processes that a process has started."""

import time
from contextlib import suppress
from pathlib import Path


def children(pid):
    """Processes that descend from one, by their names and command lines."""
    parents, lines = {}, {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with suppress(OSError, IndexError):
                parents[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
                line = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                lines[int(entry.name)] = (entry / "comm").read_text() + line
    found, fresh = {}, {pid}
    while fresh:
        fresh = {child for child, parent in parents.items() if parent in fresh}
        found |= {child: lines.get(child, "") for child in fresh}
    return found


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def have_ended(pids, timeout_s=20.0):
    """Wait for processes that are not our own."""
    until_s = time.monotonic() + timeout_s
    while pids and time.monotonic() < until_s:
        pids = [pid for pid in pids if is_running(pid)]
        time.sleep(0.05)
    return not pids
