"""Find the processes that a process has started."""

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
