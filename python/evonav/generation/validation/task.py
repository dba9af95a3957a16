"""Validate one task completely."""

import json
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from evonav.errors import EvonavError
from evonav.generation.validation.changes import Found, check_changes, check_displacements, check_relocation
from evonav.generation.validation.integrity import leaks, read_all
from evonav.generation.validation.problems import Problem, Report
from evonav.generation.validation.world import (
    check_moved_target,
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
from evonav.tasks.oracle import DuringRecord


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
        before_json = task.house_json_at_end(stage - 1) if stage > 1 else task.house_json(stage)
        is_changed = task.house_json(stage) != before_json
        self.add(stage, check_changes(_document_of(before_json), document, oracle.evolution, house))
        self.add(stage, check_relocation(task, stage))
        self.add(stage, check_state(task, stage, house))
        rooms_before = rooms_reached(house, simulator, oracle.start_pose) if is_changed else set()
        if is_changed or stage == 1:
            simulator.reset(task.house_json(stage), name=f"stage {stage}")
            found = check_physics(self._house(1), house, self.source_counts, allow_unknown_assets=self._allow)
            self.add(stage, found)
        self.add(stage, check_target(task, house, simulator, oracle))
        self.add(stage, check_reference(task, stage, house, simulator))
        self.add(stage, check_path(oracle, simulator))
        if is_changed:
            cut_off = sorted(rooms_before - rooms_reached(house, simulator, oracle.start_pose))
            self.add(stage, (("room_cut_off", f"{room} can no longer be reached") for room in cut_off))
        if oracle.during is not None:
            self._check_during(stage, oracle.during)

    def _check_during(self, stage: int, during: DuringRecord) -> None:
        """Check the change during a stage; the simulator holds the stage's house, and the changed one afterwards."""
        task, oracle, simulator = self.task, self.task.oracle(stage), self._simulator
        parameters = task.header.parameters
        house_json = task.house_json_at_end(stage)
        house = House(house_json, name=f"end of stage {stage}")
        self.add(stage, check_changes(self._document(stage), _document_of(house_json), during.evolution, house))
        self.add(stage, check_displacements(during.evolution, parameters.relocated_min_m))
        if stage in task.guided_stages:
            self.add(stage, [("contradiction", "the house changes during a guided stage")])
        rooms_before = rooms_reached(house, simulator, oracle.reference_pose)
        simulator.reset(house_json, name=f"end of stage {stage}")
        found = check_physics(self._house(1), house, self.source_counts, allow_unknown_assets=self._allow)
        self.add(stage, found)
        self.add(stage, check_moved_target(oracle, during, parameters, house, simulator))
        cut_off = sorted(rooms_before - rooms_reached(house, simulator, oracle.reference_pose))
        self.add(stage, (("room_cut_off", f"{room} can no longer be reached") for room in cut_off))

    def _house(self, stage: int) -> House:
        if stage not in self._houses:
            self._houses[stage] = House(self.task.house_json(stage), name=f"stage {stage}")
        return self._houses[stage]

    def _document(self, stage: int) -> dict[str, Any]:
        if stage not in self._documents:
            self._documents[stage] = _document_of(self.task.house_json(stage))
        return self._documents[stage]


def _document_of(house_json: str) -> dict[str, Any]:
    document = json.loads(house_json)
    if not isinstance(document, dict):
        raise TypeError(f"expected an object, found {type(document).__name__}")
    return document
