"""Run a sweep: every combination of its settings is a cell, and every cell an ordinary run in one folder.

    OUT/sweep.json      settings, cells, and the identity of their runs
    OUT/runs/CELL/      a run like any other: `evonav report`, `view`, `compare` work on it
    OUT/spending.sqlite what models cost, over all cells
    OUT/summary.*       every cell and agent, see `evonav.sweeps.summary`

A cell's name depends on the cell alone, so that a file may gain agents and values, and the folder goes on.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from fnmatch import fnmatchcase
from itertools import product
from pathlib import Path
from typing import Any

from evonav._core import __version__
from evonav.decision.vlm.account import LEDGER_NAME
from evonav.errors import EvonavError, InvalidArgumentError, StoreError
from evonav.evaluation.records.store import FILE_NAME, RunStore
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate_all
from evonav.evaluation.run.run import Evaluation, Progress, RunConfig
from evonav.evaluation.run.run_settings import DecisionResources
from evonav.json_diff import json_differences
from evonav.parallel.folders import write_atomically, writing
from evonav.sweeps import RUNS_NAME, SWEEP_NAME
from evonav.sweeps.file import SEPARATOR, Pattern, SweepFile
from evonav.tasks.listing import TaskFile, task_files, task_folder

SCHEMA_VERSION = 1
_HOW = {"out", "workers", "engine", "ray_address", "worker_gpus", "episodes_at_once", "num_retries"}
_HOW |= {"stage_timeout_s", "agent_timeout_s"}
"""Entries of a sweep file that do not decide records."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One combination of settings, by their names in the file, with the agents that run in it."""

    name: str
    simulator: str
    perception: str
    decision: str
    tasks: str
    seed: int
    agents: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CellRun:
    """A cell with its run."""

    cell: Cell
    evaluation: Evaluation

    @property
    def num_stages(self) -> int:
        """Number of stages of all agents."""
        return len(self.cell.agents) * sum(task.num_stages for task in self.evaluation.tasks)


def cells_of(sweep: SweepFile) -> list[Cell]:
    """Return the cells of a sweep, in the order of the file.

    Raises:
        InvalidArgumentError: A pattern fits nothing, or nothing is left.
    """
    cells = []
    patterns = [(which, i, one) for which in ("include", "exclude") for i, one in enumerate(getattr(sweep, which))]
    used = set()
    axes = (sweep.simulators, sweep.perceptions, sweep.decisions, sweep.tasks, sweep.seeds)
    for simulator, perception, decision, tasks, seed in product(*axes):
        parts = (*((simulator,) if simulator != "embedded" else ()), perception, decision, tasks, f"s{seed}")
        cell = Cell(SEPARATOR.join(parts), simulator, perception, decision, tasks, seed, ())
        agents = []
        for agent in sweep.agents:
            fitting = [(which, i) for which, i, pattern in patterns if _fits(pattern, agent, cell)]
            used.update(fitting)
            kinds = {which for which, _ in fitting}
            if "exclude" not in kinds and ("include" in kinds or not sweep.include):
                agents.append(agent)
        if agents:
            cells.append(replace(cell, agents=tuple(agents)))
    for which, i, pattern in patterns:
        if (which, i) not in used:
            values = pattern.model_dump(exclude_defaults=True).items()
            shown = ", ".join(f"{axis} {' or '.join(map(str, globs))}" for axis, globs in values)
            raise InvalidArgumentError(f"{which}.{i} fits no combination: there is none of {shown}")
    if not cells:
        raise InvalidArgumentError("the sweep has no cell: `exclude` leaves nothing")
    return cells


def chosen(cells: Sequence[Cell], patterns: Sequence[str]) -> list[Cell]:
    """Return the cells whose name matches one of the patterns; without patterns, all.

    Raises:
        InvalidArgumentError: A pattern fits none.
    """
    for pattern in patterns:
        if not any(fnmatchcase(cell.name, pattern) for cell in cells):
            names = ", ".join(cell.name for cell in cells[:4]) + (", ..." if len(cells) > 4 else "")
            raise InvalidArgumentError(f"--only {pattern}: fits no cell; there are {names}")
    return [cell for cell in cells if not patterns or any(fnmatchcase(cell.name, each) for each in patterns)]


def task_sets(sweep: SweepFile) -> dict[str, list[TaskFile]]:
    """Return the tasks of every set.

    Raises:
        TaskError: There are none, too few, or malformed ones.
    """
    return {name: task_files(task_folder(one.folder), one.limit, one.subset) for name, one in sweep.tasks.items()}


def config_of(sweep: SweepFile, cell: Cell, resources: DecisionResources | None) -> RunConfig:
    """Return the configuration of a cell; without resources its model cannot be asked, which is enough for estimates.

    Raises:
        EvonavError: A model's settings make no sense, or its exchanges cannot be opened.
    """
    decision = sweep.decisions[cell.decision]
    backend = Backend(
        simulator=sweep.simulators[cell.simulator].component(),
        perception=sweep.perceptions[cell.perception].component(),
        decision=decision.component(cell.seed, resources),
    )
    return sweep.config(cell.seed, backend, sweep.protocol, **decision.time_limits)


def cell_runs(sweep: SweepFile, cells: Sequence[Cell], tasks: Mapping[str, list[TaskFile]], out: Path) -> list[CellRun]:
    """Return the runs of cells, whose models cannot be asked yet."""
    return [
        CellRun(
            cell,
            Evaluation(
                cell.agents, tuple(tasks[cell.tasks]), out / RUNS_NAME / cell.name, config_of(sweep, cell, None)
            ),
        )
        for cell in cells
    ]


def with_resources(sweep: SweepFile, out: Path, run: CellRun) -> CellRun:
    """Return a run whose agents can ask their model, after a check that it can be reached."""
    if sweep.decisions[run.cell.decision].asks_rules:
        return run
    resources = DecisionResources(
        run.evaluation.run_dir, out / LEDGER_NAME, sweep, account=run.cell.name, num_askers=sweep.num_episodes
    )
    try:
        config = config_of(sweep, run.cell, resources)
        config.backend.decision.create(run.cell.seed).check()
    except EvonavError as error:
        raise type(error)(f"decisions.{run.cell.decision}: {error}") from error
    return replace(run, evaluation=replace(run.evaluation, config=config))


def claim(out: Path, sweep: SweepFile, runs: Sequence[CellRun]) -> None:
    """Make the folder this sweep's, or check that it is.

    Cells and agents may be added; of what has begun, none may be changed or left out.

    Raises:
        StoreError: The folder holds another sweep, or cannot be written; it says what differs.
    """
    requested = {run.cell.name: _content(run) for run in runs}
    path = out / SWEEP_NAME
    if path.exists():
        cells = read_claim(out)["cells"]
        there = {name: cell for name, cell in cells.items() if (out / RUNS_NAME / name / FILE_NAME).exists()}
        differing = [*_differences(there, requested)]
        if differing:
            shown = "; ".join(differing[:3]) + (f"; and {len(differing) - 3} more" if len(differing) > 3 else "")
            raise StoreError(f"{out} holds another sweep ({shown}); use another folder")
    settings = sweep.model_dump(mode="json", exclude=_HOW)
    for decision in settings["decisions"].values():
        decision.pop("base_url")  # an address may hold a password
    content = {"schema_version": SCHEMA_VERSION, "evonav": __version__, "settings": settings, "cells": requested}
    write_atomically(path, json.dumps(content, indent=2) + "\n")


def read_claim(out: Path) -> dict[str, Any]:
    """Read `sweep.json`.

    Raises:
        StoreError: There is none, or it is no such file.
    """
    path = out / SWEEP_NAME
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise StoreError(f"{out}: no sweep here ({SWEEP_NAME}: {error.strerror or error})") from None
    except ValueError as error:
        raise StoreError(f"{path}: no JSON: {error}") from None
    if not isinstance(content, dict) or not isinstance(content.get("cells"), dict):
        raise StoreError(f"{path}: not a sweep's: it names no cells")
    found = content.get("schema_version")
    if type(found) is not int or found != SCHEMA_VERSION:
        raise StoreError(f"{path}: schema version {found}, this evonav reads {SCHEMA_VERSION}")
    return content


def run_sweep(
    sweep: SweepFile,
    out: Path,
    runs: Sequence[CellRun],
    *,
    only: Sequence[str] = (),
    retry_errored: bool = False,
    on_progress: Callable[[Cell, Progress], None] = lambda _, __: None,
) -> None:
    """Run the missing stages of a sweep, with one set of workers.

    Args:
        only: Patterns of cells' names; others are left as they are.
        retry_errored: Run errored stages again, and those that were not run because of them.
        on_progress: Called as a cell begins and after each of its recorded stages.
    """
    names = {cell.name for cell in chosen([run.cell for run in runs], only)}
    todo = [run for run in runs if run.cell.name in names]
    with writing(out):
        claim(out, sweep, runs)
        todo = [run for run in todo if retry_errored or not _is_recorded(run)]
        todo = [with_resources(sweep, out, run) for run in todo]
        for name in dict.fromkeys(run.cell.simulator for run in todo):
            _check_simulator(next(run for run in todo if run.cell.simulator == name))
        evaluate_all(
            [run.evaluation for run in todo],
            sweep.workforce(),
            num_retries=sweep.num_retries,
            retry_errored=retry_errored,
            on_progress=lambda index, progress: on_progress(todo[index].cell, progress),
        )


def _fits(pattern: Pattern, agent: str, cell: Cell) -> bool:
    """Return true if the agent and each axis of the cell match the pattern, which may leave axes open."""
    values = {**asdict(cell), "agent": agent}
    return all(not globs or any(fnmatchcase(str(values[axis]), str(glob)) for glob in globs) for axis, globs in pattern)


def _content(run: CellRun) -> dict[str, Any]:
    """Return a cell's entry in `sweep.json`."""
    axes = {key: value for key, value in asdict(run.cell).items() if key not in ("name", "agents")}
    return {
        "agents": list(run.cell.agents),
        "axes": axes,
        "num_stages": run.num_stages,
        "run": json.loads(json.dumps(run.evaluation.identity)),
    }


def _differences(there: Mapping[str, Any], requested: Mapping[str, Any]) -> Iterator[str]:
    """Yield how the stored cells differ from those of the file."""
    for name, cell in there.items():
        if name not in requested:
            yield f"cell {name} is not in the file: put it back, `--only` runs a part"
            continue
        gone = [agent for agent in cell["agents"] if agent not in requested[name]["agents"]]
        if gone:
            yield f"cell {name} is without agent {', '.join(gone)}: put it back"
        for one in sorted(json_differences(cell["run"], requested[name]["run"]), key=lambda one: one.path):
            yield f"cell {name}: {one.path}: there {one.left!r}, asked {one.right!r}"


def _is_recorded(run: CellRun) -> bool:
    """Return true if every stage of a cell is recorded, in a run of the same identity."""
    try:
        with RunStore(run.evaluation.run_dir) as store:
            if store.meta("config") != _content(run)["run"]:
                return False  # `evaluate_all` says what differs
            states = store.states()
    except StoreError:
        return False
    return all(
        (agent, task.task_id, stage) in states
        for agent in run.cell.agents
        for task in run.evaluation.tasks
        for stage in range(1, task.num_stages + 1)
    )


def _check_simulator(run: CellRun) -> None:
    """Start the simulator once, before anything is written for a cell."""
    try:
        run.evaluation.config.backend.check()
    except EvonavError as error:
        raise type(error)(f"simulators.{run.cell.simulator}: {error}") from error
