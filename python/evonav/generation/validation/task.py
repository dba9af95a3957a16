"""Validate one task completely."""

import json
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from evonav.errors import EvonavError
from evonav.generation.validation.changes import Found, check_changes, check_relocation
from evonav.generation.validation.integrity import leaks, read_all
from evonav.generation.validation.problems import Problem, Report
from evonav.generation.validation.world import (
    check_path,
    check_physics,
    check_reference,
    check_state,
    check_target,
    rooms_reached,
    simulator_of,
)
from evonav.house import House
from evonav.tasks.manifest import Task


def validate_files(root: Path | str, *, allow_unknown_assets: bool = False) -> Report:
    """Read a task's folder and report all its problems.

    Args:
        root: The task's own folder.
        allow_unknown_assets: The option with which the task was generated.
    """
    root = Path(root)
    task, problems = read_all(root)
    if task is None:
        return Report(task_id=root.name, num_stages=0, problems=tuple(problems), source_counts={})
    report = validate_task(task, allow_unknown_assets=allow_unknown_assets)
    return report.model_copy(update={"task_id": root.name, "problems": (*problems, *report.problems)})


def validate_task(task: Task, *, allow_unknown_assets: bool = False) -> Report:
    """Check a task's records against its houses.

    Args:
        task: A generated or loaded task.
        allow_unknown_assets: The option with which the task was generated.
    """
    check = _TaskCheck(task, allow_unknown_assets)
    for stage in range(1, task.num_stages + 1):
        try:
            check.check_stage(stage)
        except EvonavError as error:
            check.add(stage, [("house", str(error))])
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
            check.add(stage, [("house", f"not a ProcTHOR house: {type(error).__name__}: {error}")])
    source_counts = dict(sorted(check.source_counts.items()))
    return Report(
        task_id=task.task_id, num_stages=task.num_stages, problems=tuple(check.problems), source_counts=source_counts
    )


class _TaskCheck:
    """The checks of a task's stages, and their problems."""

    def __init__(self, task: Task, allow_unknown_assets: bool) -> None:
        self.task = task
        self.problems: list[Problem] = []
        self.source_counts: Counter[str] = Counter()
        self._allow = allow_unknown_assets
        self._simulator = simulator_of(task, allow_unknown_assets=allow_unknown_assets)
        self._houses: dict[int, House] = {}
        self._documents: dict[int, dict[str, Any]] = {}

    def add(self, stage: int, found: Iterable[Found]) -> None:
        for kind, detail in found:
            self.problems.append(Problem(task_id=self.task.task_id, stage=stage, kind=kind, detail=detail))

    def check_stage(self, stage: int) -> None:
        task, oracle, simulator = self.task, self.task.oracle(stage), self._simulator
        document = self._document(stage)
        self.add(stage, (("leak", detail) for detail in leaks(task, stage, document)))
        house = self._house(stage)
        is_changed = stage > 1 and task.house_json(stage) != task.house_json(stage - 1)
        before = self._document(stage - 1) if stage > 1 else document
        self.add(stage, check_changes(before, document, oracle, house))
        self.add(stage, check_relocation(task, stage))
        self.add(stage, check_state(task, stage, house))
        rooms_before = rooms_reached(house, simulator, oracle) if is_changed else set()
        if is_changed or stage == 1:
            simulator.reset(task.house_json(stage), name=f"stage {stage}")
            found = check_physics(self._house(1), house, self.source_counts, allow_unknown_assets=self._allow)
            self.add(stage, found)
        self.add(stage, check_target(task, house, simulator, oracle))
        self.add(stage, check_reference(task, stage, house, simulator))
        self.add(stage, check_path(oracle, simulator))
        if is_changed:
            cut_off = sorted(rooms_before - rooms_reached(house, simulator, oracle))
            self.add(stage, (("room_cut_off", f"{room} can no longer be reached") for room in cut_off))

    def _house(self, stage: int) -> House:
        if stage not in self._houses:
            self._houses[stage] = House(self.task.house_json(stage), name=f"stage {stage}")
        return self._houses[stage]

    def _document(self, stage: int) -> dict[str, Any]:
        if stage not in self._documents:
            document = json.loads(self.task.house_json(stage))
            if not isinstance(document, dict):
                raise TypeError(f"expected an object, found {type(document).__name__}")
            self._documents[stage] = document
        return self._documents[stage]
