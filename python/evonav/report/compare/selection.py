"""Select what to compare: agents of runs, named `RUN`, `RUN:AGENT`, or `RUN` followed by names of its agents."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from evonav.errors import InvalidArgumentError
from evonav.evaluation.metrics.stage_metrics import StageMetrics
from evonav.evaluation.records.store import FILE_NAME
from evonav.json_diff import json_differences
from evonav.report.run import RecordedRun, load_run


@dataclass(frozen=True)
class ComparedAgent:
    """An agent of a run."""

    name: str
    """Name in tables: the agent, with its run where several runs are compared."""
    run: RecordedRun
    agent: str
    place: tuple[int, int] = (0, 0)
    """Place among the runs and agents that the arguments name; agents of a run that none names share a place."""

    @cached_property
    def rows(self) -> dict[tuple[str, int], StageMetrics]:
        """Recorded stages, by task and stage."""
        found = self.run.outcomes.items()
        return {(task_id, stage): one.row for (agent, task_id, stage), one in found if agent == self.agent}


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
    compared_agents: dict[tuple[Path, str], ComparedAgent] = {}
    for i, (run_dirs, agents) in enumerate(requested):
        for run_dir in run_dirs:
            for j, compared in enumerate(agents_of(load_run(run_dir), agents)):
                placed = replace(compared, place=(i, j if agents else 0))
                compared_agents.setdefault((compared.run.run_dir, compared.agent), placed)
    return _named(list(compared_agents.values()))


def _runs_of(folder: Path) -> list[Path]:
    """Return the folder itself, or the runs of a sweep."""
    if (folder / FILE_NAME).is_file():
        return [folder]
    cells = sorted(path.parent for path in folder.glob(f"runs/*/{FILE_NAME}"))
    return cells or [folder]


def agents_of(run: RecordedRun, agents: Sequence[str] = ()) -> list[ComparedAgent]:
    """Return some agents of a run, by default all.

    Raises:
        InvalidArgumentError: The run has no agent of that name.
    """
    for agent in agents:
        if agent not in run.agents:
            there = ", ".join(run.agents) or "none"
            raise InvalidArgumentError(f"{run.run_dir} has no agent {agent!r}; it has {there}")
    return [ComparedAgent(run.names[agent], run, agent) for agent in agents or run.agents]


def name_notes(compared_agents: Sequence[ComparedAgent]) -> list[str]:
    """Return a note on each agent that tables show by its class."""
    names = {one.agent: one.run.names[one.agent] for one in compared_agents}
    return [f"{short} is {agent}." for agent, short in names.items() if short != agent]


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
    folders = {compared.run.run_dir.resolve() for compared in compared_agents}
    if len(folders) < 2:
        return list(compared_agents)
    is_short = len({folder.name for folder in folders}) == len(folders)

    def name(compared: ComparedAgent) -> str:
        run_dir = compared.run.run_dir
        return f"{run_dir.resolve().name if is_short else run_dir}:{compared.name}"

    return [replace(compared, name=name(compared)) for compared in compared_agents]


def config_differences(a: ComparedAgent, b: ComparedAgent) -> dict[str, tuple[str, str]]:
    """Return the settings in which two runs differ, by dotted name."""

    def text(value: Any) -> str:  # noqa: ANN401 - JSON
        return "-" if value is None else str(value)

    differing = sorted(json_differences(a.run.config, b.run.config), key=lambda one: one.path)
    return {one.path: (text(one.left), text(one.right)) for one in differing}
