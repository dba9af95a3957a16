"""Complete words in the shell; heavy imports happen only when the shell asks for words."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

MAX_FOLDERS = 1000
"""Folders that a completion looks at: the shell waits for it."""


def agents(incomplete: str) -> list[str]:
    """Names of agents; after a comma, further ones."""
    from evonav.agents.registry import agent_descriptions
    from evonav.evaluation.baselines import ORACLE_BASELINE_NAMES

    return _further((*agent_descriptions(), *ORACLE_BASELINE_NAMES), incomplete)


def run_agents(ctx: Any, incomplete: str) -> list[str]:  # noqa: ANN401 - click's context, or typer's copy
    """Names of the agents of the run that the command line names before; after a comma, further ones."""
    import json

    try:
        summary = json.loads((Path(ctx.params["run"]) / "summary.json").read_text(encoding="utf-8"))
        known = list(summary["agents"])
    except (OSError, ValueError, KeyError, TypeError):
        return []
    return _further(known, incomplete)


def _further(known: Iterable[str], incomplete: str) -> list[str]:
    """Complete the last of the names that are typed, which commas separate."""
    before, comma, last = incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in known if name.startswith(last) and name not in before.split(",")]


def sweep_keys(incomplete: str) -> list[str]:
    """Keys of sweep files."""
    from evonav.evaluation.run.run_settings import keys_of
    from evonav.sweeps.file import SweepFile

    return [f"{key}=" for key in keys_of(SweepFile) if key.startswith(incomplete)]


def runs(incomplete: str) -> list[str]:
    """Folders of runs, and folders on the way to some."""
    return _folders(incomplete, "records.sqlite")


def task_folders(incomplete: str) -> list[str]:
    """Folders of tasks, folders on the way to some, and `bundled`."""
    return [*(["bundled"] if "bundled".startswith(incomplete) else []), *_folders(incomplete, "dataset.json")]


def subsets(ctx: Any, incomplete: str) -> list[str]:  # noqa: ANN401 - click's context, or typer's copy
    """Named subsets of the tasks that the command line names before."""
    import json

    folder = ctx.params.get("tasks") or ctx.params.get("folder")
    try:
        dataset = json.loads((Path(folder) / "dataset.json").read_text(encoding="utf-8"))
        split, num_tasks = str(dataset["split"]), int(dataset["num_tasks"])
    except (OSError, ValueError, KeyError, TypeError):
        return []
    sizes = sorted({size for size in (10, 30, 90, 300, num_tasks) if size <= num_tasks})
    return [name for size in sizes if (name := f"{split}-{size}").startswith(incomplete)]


def _folders(incomplete: str, name: str) -> list[str]:
    """Folders that begin as typed: without a slash where the file is in it, with one where it is further below."""
    typed = Path(incomplete)
    parent, start = (typed, "") if incomplete.endswith("/") or not incomplete else (typed.parent, typed.name)
    shown = []
    for path in _subfolders(parent, start):
        if (path / name).is_file():
            shown.append(str(path))
        elif _is_below(path, name):
            shown.append(f"{path}/")
    return shown


def _subfolders(parent: Path, start: str = "") -> list[Path]:
    """Folders in a folder, without hidden ones unless these are asked for."""
    try:
        found = sorted(path for path in parent.iterdir() if path.name.startswith(start) and path.is_dir())
    except OSError:
        return []
    return [path for path in found if start.startswith(".") or not path.name.startswith(".")]


def _is_below(folder: Path, name: str) -> bool:
    """Return whether the file is at most three levels down, or there are too many folders to look at."""
    level = [folder]
    num_left = MAX_FOLDERS
    for _ in range(3):
        below: list[Path] = []
        for path in level:
            below += _subfolders(path)
            if len(below) > num_left:
                return True
        if any((path / name).is_file() for path in below):
            return True
        num_left -= len(below)
        level = below
    return False
