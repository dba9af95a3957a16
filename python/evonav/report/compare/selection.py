"""What is compared: agents of runs, named `RUN`, `RUN:AGENT`, or `RUN` and then names of its agents."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from evonav.errors import InvalidArgumentError
from evonav.evaluation.metrics.stage_metrics import StageMetrics, read_stage_metrics
from evonav.evaluation.records.store import FILE_NAME, RunStore
from evonav.report.run import agents_in_order


@dataclass(frozen=True, slots=True)
class Side:
    """An agent of a run."""

    name: str
    """As tables call it: the agent, with its run where several are compared."""
    run_dir: Path
    agent: str
    config: Mapping[str, Any]
    num_stages: Mapping[str, int]
    """By task id, of all that the run consists of."""
    rows: Mapping[tuple[str, int], StageMetrics]
    """By task and stage."""


def read_sides(words: Sequence[str]) -> list[Side]:
    """The agents that these words name.

    Args:
        words: Each a run's folder (all of its agents, unless names follow), `FOLDER:AGENT`, or the name of an agent of
            the folder before it. A sweep's folder stands for the runs of its cells.

    Raises:
        InvalidArgumentError: A word names nothing.
        StoreError: A run cannot be read.
    """
    asked: list[tuple[list[Path], list[str]]] = []
    before = ""
    for word in words:
        folder, agent = _split(word)
        if folder is not None:
            asked.append((_runs_of(folder), [agent] if agent else []))
            before = word if agent else ""
        elif not asked:
            raise InvalidArgumentError(f"{word!r} is no folder of a run: name a run first, then agents of it")
        elif before:
            raise InvalidArgumentError(f"{word!r} after {before!r}: write RUN:AGENT for it, too")
        else:
            asked[-1][1].append(word)
    sides: list[Side] = []
    for run_dir, agents in ((run_dir, agents) for run_dirs, agents in asked for run_dir in run_dirs):
        for side in _sides_of(run_dir, agents):
            if not any(side.run_dir == other.run_dir and side.agent == other.agent for other in sides):
                sides.append(side)
    return _named(sides)


def _runs_of(folder: Path) -> list[Path]:
    """The folder itself, or the runs of a sweep."""
    if (folder / FILE_NAME).is_file():
        return [folder]
    cells = sorted(path.parent for path in folder.glob(f"runs/*/{FILE_NAME}"))
    return cells or [folder]


def _sides_of(folder: Path, agents: Sequence[str]) -> list[Side]:
    with RunStore(folder) as store:
        config = store.meta("config") or {}
        num_stages = store.meta("num_stages") or {}
        recorded = {agent for agent, _, _ in store.states()}
        known = agents_in_order(store.meta("agents"), sorted(recorded))
        for agent in agents:
            if agent not in known:
                raise InvalidArgumentError(f"{folder} has no agent {agent!r}; it has {', '.join(known) or 'none'}")
        chosen = list(agents or known)
        rows = read_stage_metrics(store, chosen)
    return [
        Side(
            name=agent,
            run_dir=folder,
            agent=agent,
            config=config,
            num_stages=num_stages,
            rows={(row.task_id, row.stage): row for row in rows if row.agent == agent},
        )
        for agent in chosen
    ]


def _split(word: str) -> tuple[Path | None, str]:
    """A folder and the agent after its colon; an agent's name may hold colons, slashes and dots itself."""
    if Path(word).is_dir():
        return Path(word), ""
    for i, character in enumerate(word):
        if character == ":" and i and Path(word[:i]).is_dir():
            return Path(word[:i]), word[i + 1 :]
    return None, word


def _named(sides: Sequence[Side]) -> list[Side]:
    """Names that tell sides apart: the agent, the run before it where runs differ, the whole path where those agree."""
    folders = {side.run_dir.resolve() for side in sides}
    if len(folders) < 2:
        return list(sides)
    is_short = len({folder.name for folder in folders}) == len(folders)
    return [
        replace(side, name=f"{side.run_dir.resolve().name if is_short else side.run_dir}:{side.agent}")
        for side in sides
    ]


def config_differences(a: Side, b: Side) -> dict[str, tuple[str, str]]:
    """Settings in which two runs differ, by dotted name."""
    flat_a, flat_b = _flat(a.config), _flat(b.config)
    return {
        key: (flat_a.get(key, "-"), flat_b.get(key, "-"))
        for key in sorted(flat_a.keys() | flat_b.keys())
        if flat_a.get(key) != flat_b.get(key)
    }


def _flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    flat: dict[str, str] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            flat.update(_flat(value, f"{prefix}{key}."))
        else:
            flat[f"{prefix}{key}"] = str(value)
    return flat
