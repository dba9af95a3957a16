"""Runs the sections named on the command line, or all, and writes `benches/README.md`.

What follows the names, from the first option on, is the sections' own (`configure`).
"""

import importlib
import subprocess
import sys
from contextlib import nullcontext
from itertools import takewhile

from benches.table import write_section
from evonav.speed_benchmark.timing import Sampling, one_core

PRODUCT = {"agents", "generation", "gym", "mapping", "navigation", "rendering"}
"""Sections of `evonav bench`, modules of `evonav.speed_benchmark`; the other modules are beside this one."""
ON_ALL_CORES = {"gym"}
SECTIONS = {
    "agent_process": "Agents in processes of their own",
    "agents": "Agents",
    "evaluation": "Evaluation",
    "generation": "Task generation",
    "gym": "Gymnasium",
    "mapping": "Mapping",
    "memory": "Memory",
    "navigation": "Navigation",
    "perception": "Perception",
    "rendering": "Rendering",
    "thor": "AI2-THOR engine",
    "waiting": "Many episodes at once",
}
"""Title by module. A module has `NOTES` (Markdown) and `run()`, which gives a list of `Row` or a table, or
`measure(Sampling)`, which yields rows."""


def main() -> None:
    """See the module."""
    names = list(takewhile(lambda argument: not argument.startswith("-"), sys.argv[1:]))
    options = sys.argv[len(names) + 1 :]
    if not set(names) <= SECTIONS.keys() or (options and not names):
        known = "\n".join(f"  {name:14} {title}" for name, title in sorted(SECTIONS.items()))
        sys.exit(f"usage: python -m benches [NAME ... [OPTION ...]]\n{known}")
    if len(names) == 1:
        _run(names[0], options)
        return
    # Each in a process of its own, or a section's memory would be that of the peers of those before it.
    for name in names or sorted(SECTIONS):
        subprocess.run([sys.executable, "-m", "benches", name, *options], check=True)


def _run(name: str, options: list[str]) -> None:
    module = importlib.import_module(f"{'evonav.speed_benchmark' if name in PRODUCT else 'benches'}.{name}")
    if options and not hasattr(module, "configure"):
        sys.exit(f"{name} takes no options")
    if options:
        module.configure(options)
    # Or peers with threads of their own would be charged for all of them.
    with nullcontext() if name in ON_ALL_CORES else one_core():
        rows = list(module.measure(Sampling())) if name in PRODUCT else module.run()
    sys.stdout.write(write_section(SECTIONS[name], module.NOTES, rows) + "\n")


if __name__ == "__main__":
    main()
