"""Objects that intersect or float in a task's houses are found."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from damaged_task import kinds, signed, with_house

from evonav.generation.validation import validate_files
from evonav.tasks import Task, load_task


def floor_things(task: Task) -> list[str]:
    """Things of the changed room that were moved and stand on the floor."""
    return [change.id for change in task.oracle(3).evolution.changes if change.to_support_id is None]


def put(task: Task, one: str, place: Callable[[dict[str, float]], dict[str, float]]) -> Task:
    """Puts an object of the last house somewhere else, and says so in the record."""
    where: dict[str, float] = {}

    def edit(document: dict[str, Any]) -> None:
        entry = next(entry for entry in document["objects"] if entry["id"] == one)
        entry["position"] = where | place(entry["position"])

    return with_house(task, 3, edit)


def position_in(task: Task, one: str) -> dict[str, float]:
    document = json.loads(task.house_json(3))
    return dict(next(entry for entry in document["objects"] if entry["id"] == one)["position"])


def test_two_things_in_one_place_penetrate(root: Path) -> None:
    task = load_task(root)
    one, other = floor_things(task)[:2]
    there = position_in(task, other)
    signed(put(task, one, lambda here: {**there, "y": here["y"]}), root)
    problems = [problem for problem in validate_files(root).problems if problem.kind == "penetration"]
    assert any(one in problem.detail and other in problem.detail for problem in problems)


def test_a_thing_in_a_wall_is_in_it_and_out_of_its_room(root: Path) -> None:
    task = load_task(root)
    room = next(
        room for room in json.loads(task.house_json(3))["rooms"] if room["id"] == task.oracle(3).evolution.room_id
    )
    one = floor_things(task)[0]
    corners = room["floorPolygon"]
    middle = {axis: (corners[0][axis] + corners[1][axis]) / 2.0 for axis in "xz"}
    signed(put(task, one, lambda here: {**here, **middle}), root)
    assert {"in_wall", "out_of_room"} <= kinds(validate_files(root))


def test_a_thing_in_the_air_or_in_the_floor_is_found(root: Path) -> None:
    task = load_task(root)
    one = floor_things(task)[0]
    signed(put(task, one, lambda here: {**here, "y": here["y"] + 0.3}), root)
    assert "unsupported" in kinds(validate_files(root))
    signed(put(task, one, lambda here: {**here, "y": here["y"] - 0.05}), root)
    assert "in_floor" in kinds(validate_files(root))


def test_a_house_that_cannot_be_built_is_told(root: Path) -> None:
    task = load_task(root)

    def edit(document: dict[str, Any]) -> None:
        document["objects"][0]["assetId"] = "no_such_asset"

    signed(with_house(task, 2, edit), root)
    report = validate_files(root)
    assert any(problem.kind == "house" and "no_such_asset" in problem.detail for problem in report.problems)
    for text in ("[]", "{}", "not JSON"):
        signed(dataclasses.replace(task, houses_json=(*task.houses_json[:2], text)), root)
        assert "house" in kinds(validate_files(root)), text
