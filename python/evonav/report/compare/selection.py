"""Select what to compare: agents of runs, named `RUN`, `RUN:AGENT`, or `RUN` followed by names of its agents."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from evonav.errors import InvalidArgumentError
from evonav.evaluation.metrics.stage_metrics import StageMetrics, read_stage_metrics
from evonav.evaluation.records.store import FILE_NAME, RunStore
from evonav.json_diff import json_differences
from evonav.report.run import agents_in_order


@dataclass(frozen=True, slots=True)
class ComparedAgent:
    """An agent of a run."""

    name: str
    """Name in tables: the agent, with its run where several runs are compared."""
    run_dir: Path
    agent: str
    config: Mapping[str, Any]
    num_stages: Mapping[str, int]
    """Number of stages of every task of the run, by task id."""
    rows: Mapping[tuple[str, int], StageMetrics]
    """Recorded stages, by task and stage."""


def read_compared_agents(arguments: Sequence[str]) -> list[ComparedAgent]:
    """Return the agents that the arguments name.

    Args:
        arguments: Each a run's folder (all of its agents, unless names follow), `FOLDER:AGENT`, or the name of an agent
            of the folder before it. A sweep's folder stands for the runs of its cells.

    Raises:
        InvalidArgumentError: An argument names nothing.
        StoreError: A run cannot be read.
    """
    requested: list[tuple[list[Path], list[str]]] = []
    before = ""
    for argument in arguments:
        folder, agent = _split(argument)
        if folder is not None:
            requested.append((_runs_of(folder), [agent] if agent else []))
            before = argument if agent else ""
        elif not requested:
            raise InvalidArgumentError(f"{argument!r} is no folder of a run: name a run first, then agents of it")
        elif before:
            raise InvalidArgumentError(f"{argument!r} after {before!r}: write RUN:AGENT for it, too")
        else:
            requested[-1][1].append(argument)
    compared_agents: list[ComparedAgent] = []
    for run_dir, agents in ((run_dir, agents) for run_dirs, agents in requested for run_dir in run_dirs):
        for compared in _agents_of(run_dir, agents):
            if not any(
                compared.run_dir == other.run_dir and compared.agent == other.agent for other in compared_agents
            ):
                compared_agents.append(compared)
    return _named(compared_agents)


def _runs_of(folder: Path) -> list[Path]:
    """Return the folder itself, or the runs of a sweep."""
    if (folder / FILE_NAME).is_file():
        return [folder]
    cells = sorted(path.parent for path in folder.glob(f"runs/*/{FILE_NAME}"))
    return cells or [folder]


def _agents_of(folder: Path, agents: Sequence[str]) -> list[ComparedAgent]:
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
        ComparedAgent(
            name=agent,
            run_dir=folder,
            agent=agent,
            config=config,
            num_stages=num_stages,
            rows={(row.task_id, row.stage): row for row in rows if row.agent == agent},
        )
        for agent in chosen
    ]


def _split(argument: str) -> tuple[Path | None, str]:
    """Split a folder and the agent after its colon; an agent's name may contain colons, slashes and dots itself."""
    if Path(argument).is_dir():
        return Path(argument), ""
    for i, character in enumerate(argument):
        if character == ":" and i and Path(argument[:i]).is_dir():
            return Path(argument[:i]), argument[i + 1 :]
    return None, argument


def _named(compared_agents: Sequence[ComparedAgent]) -> list[ComparedAgent]:
    """Give names that are unique: the agent, the run before it where runs differ, the whole path where those agree."""
    folders = {compared.run_dir.resolve() for compared in compared_agents}
    if len(folders) < 2:
        return list(compared_agents)
    is_short = len({folder.name for folder in folders}) == len(folders)
    return [
        replace(compared, name=f"{compared.run_dir.resolve().name if is_short else compared.run_dir}:{compared.agent}")
        for compared in compared_agents
    ]


def config_differences(a: ComparedAgent, b: ComparedAgent) -> dict[str, tuple[str, str]]:
    """Return the settings in which two runs differ, by dotted name."""

    def text(value: Any) -> str:  # noqa: ANN401 - JSON
        return "-" if value is None else str(value)

    found = sorted(json_differences(a.config, b.config), key=lambda one: one.path)
    return {one.path: (text(one.left), text(one.right)) for one in found}
