"""One task, from all sides."""

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
    """Reads a task's folder and says all that is wrong with it.

    Args:
        root: The task's own folder.
        allow_unknown_assets: As the task was generated.
    """
    root = Path(root)
    task, problems = read_all(root)
    if task is None:
        return Report(task_id=root.name, num_stages=0, problems=tuple(problems), own={})
    report = validate_task(task, allow_unknown_assets=allow_unknown_assets)
    return report.model_copy(update={"task_id": root.name, "problems": (*problems, *report.problems)})


def validate_task(task: Task, *, allow_unknown_assets: bool = False) -> Report:
    """Checks what a task's records say against its houses.

    Args:
        task: Made or loaded.
        allow_unknown_assets: As the task was generated.
    """
    check = _Check(task, allow_unknown_assets)
    for stage in range(1, task.num_stages + 1):
        try:
            check.check_stage(stage)
        except EvonavError as error:
            check.note(stage, [("house", str(error))])
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
            check.note(stage, [("house", f"not a ProcTHOR house: {type(error).__name__}: {error}")])
    own = dict(sorted(check.own.items()))
    return Report(task_id=task.task_id, num_stages=task.num_stages, problems=tuple(check.problems), own=own)


class _Check:
    """What the checks of a task's stages share."""

    def __init__(self, task: Task, allow_unknown_assets: bool) -> None:
        self.task = task
        self.problems: list[Problem] = []
        self.own: Counter[str] = Counter()
        self._allow = allow_unknown_assets
        self._simulator = simulator_of(task, allow_unknown_assets=allow_unknown_assets)
        self._houses: dict[int, House] = {}
        self._documents: dict[int, dict[str, Any]] = {}

    def note(self, stage: int, found: Iterable[Found]) -> None:
        for kind, detail in found:
            self.problems.append(Problem(task_id=self.task.task_id, stage=stage, kind=kind, detail=detail))

    def check_stage(self, stage: int) -> None:
        task, oracle, simulator = self.task, self.task.oracle(stage), self._simulator
        document = self._document(stage)
        self.note(stage, (("leak", detail) for detail in leaks(task, stage, document)))
        house = self._house(stage)
        is_changed = stage > 1 and task.house_json(stage) != task.house_json(stage - 1)
        before = self._document(stage - 1) if stage > 1 else document
        self.note(stage, check_changes(before, document, oracle, house))
        self.note(stage, check_relocation(task, stage))
        self.note(stage, check_state(task, stage, house))
        rooms_before = rooms_reached(house, simulator, oracle) if is_changed else set()
        if is_changed or stage == 1:
            simulator.reset(task.house_json(stage), name=f"stage {stage}")
            found = check_physics(self._house(1), house, self.own, allow_unknown_assets=self._allow)
            self.note(stage, found)
        self.note(stage, check_target(task, house, simulator, oracle))
        self.note(stage, check_reference(task, stage, house, simulator))
        self.note(stage, check_path(oracle, simulator))
        if is_changed:
            cut_off = sorted(rooms_before - rooms_reached(house, simulator, oracle))
            self.note(stage, (("room_cut_off", f"{room} can no longer be reached") for room in cut_off))

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
