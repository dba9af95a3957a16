"""Tasks with changed contents, whose checksums fit."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from evonav.generation.validation import Report
from evonav.tasks import Task, write_task
from evonav.tasks.records import sha256_of


def signed(task: Task, root: Path) -> Path:
    """Write the task into its folder again, with checksums that fit."""
    stages = tuple(
        stage.model_copy(update={"house_sha256": sha256_of(house.encode())})
        for stage, house in zip(task.oracle_stages, task.houses_json, strict=True)
    )
    source = task.header.house.model_copy(update={"sha256": stages[0].house_sha256})
    task = dataclasses.replace(task, oracle_stages=stages, header=task.header.model_copy(update={"house": source}))
    header = task.header.model_copy(update={"checksums": task.checksums})
    return write_task(dataclasses.replace(task, header=header), root.parent)


def with_stage(task: Task, stage: int, **changes: Any) -> Task:
    stages = list(task.oracle_stages)
    stages[stage - 1] = stages[stage - 1].model_copy(update=changes)
    return dataclasses.replace(task, oracle_stages=tuple(stages))


def with_house(task: Task, stage: int, edit: Callable[[dict[str, Any]], None]) -> Task:
    houses = list(task.houses_json)
    document = json.loads(houses[stage - 1])
    edit(document)
    houses[stage - 1] = json.dumps(document)
    return dataclasses.replace(task, houses_json=tuple(houses))


def kinds(report: Report) -> set[str]:
    return {problem.kind for problem in report.problems}
