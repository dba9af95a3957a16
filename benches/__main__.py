"""Runs the sections named on the command line, or all, and writes `benches/README.md`.

What follows the names, from the first option on, is the sections' own (`configure`).
"""

import importlib
import os
import sys
from itertools import takewhile

from benches.table import write_section

SECTIONS = {
    "agent_process": "Agents in processes of their own",
    "agents": "Agents",
    "evaluation": "Evaluation",
    "generation": "Task generation",
    "gym": "Gymnasium",
    "memory": "Memory",
    "navigation": "Navigation",
    "perception": "Perception",
    "rendering": "Rendering",
    "thor": "AI2-THOR engine",
}
"""Module by title. A module has `NOTES` (Markdown) and `run()`, which gives a list of `Row` or a table."""


def main() -> None:
    """See the module."""
    names = list(takewhile(lambda argument: not argument.startswith("-"), sys.argv[1:]))
    options = sys.argv[len(names) + 1 :]
    if not set(names) <= SECTIONS.keys() or (options and not names):
        known = "\n".join(f"  {name:14} {title}" for name, title in sorted(SECTIONS.items()))
        sys.exit(f"usage: python -m benches [NAME ... [OPTION ...]]\n{known}")
    if hasattr(os, "sched_setaffinity"):  # or peers with threads of their own would be charged for all of them
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    for name in names or SECTIONS:
        module = importlib.import_module(f"benches.{name}")
        if options and not hasattr(module, "configure"):
            sys.exit(f"{name} takes no options")
        if options:
            module.configure(options)
        sys.stdout.write(write_section(SECTIONS[name], module.NOTES, module.run()) + "\n")


if __name__ == "__main__":
    main()
