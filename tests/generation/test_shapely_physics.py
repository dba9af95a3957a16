"""The physics of stage houses, checked independently by `shapely_physics.py`: bundled tasks and real houses."""

import dataclasses
import json
import math
from collections import Counter
from importlib.resources import as_file, files
from itertools import islice

import pytest
from recorded_data import data_path, needs_data
from shapely_physics import Plan, problems_of

from evonav.generation import GenerationParameters, TaskRejectedError, generate_task
from evonav.house import bundled_houses, stream_houses
from evonav.tasks import Task, load_tasks

REAL_SETS = {
    "ram81-procthor-100k-history/uniform-hard-val-75.jsonl.gz": 16,
    "ram81-procthor-100k-history/attr-onav-1k-val-100.jsonl.gz": 32,
}
"""Houses taken of each file."""
MODES = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]


def parameters(mode: int) -> GenerationParameters:
    salient, group, shuffle = MODES[mode]
    return GenerationParameters(
        num_stages=(3,),
        evolve_probability=1.0,
        salient_object_probability=salient,
        retain_group_probability=group,
        full_shuffle_probability=shuffle,
    )


@pytest.fixture(scope="module")
def shuffled() -> Task:
    return generate_task(next(iter(bundled_houses(1))), seed=1, config=parameters(2))


@pytest.mark.slow
def test_bundled_tasks_are_possible() -> None:
    with as_file(files("evonav") / "data" / "tasks") as folder:
        found = [problem for task in load_tasks(folder) for problem in problems_of(task)]
    assert found == []


@pytest.mark.parametrize("mode", range(3))
def test_bundled_houses_stay_possible(mode: int) -> None:
    found = []
    num_moved = 0
    for house in islice(bundled_houses(), mode, 9, 3):
        task = generate_task(house, seed=mode, config=parameters(mode))
        num_moved += sum(len(stage.evolution.changes) for stage in task.oracle_stages)
        found += problems_of(task)
    assert found == []
    assert num_moved >= 3


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(name, marks=needs_data(name)) for name in REAL_SETS])
def test_real_houses_stay_possible(name: str) -> None:
    found = []
    num_tasks = 0
    houses = stream_houses(data_path(name))
    for i, house in enumerate(houses):
        if num_tasks == REAL_SETS[name]:
            break
        try:
            task = generate_task(house, seed=0, config=parameters(i % 3))
        except TaskRejectedError:
            continue
        num_tasks += 1
        found += problems_of(task)
    assert found == []
    assert num_tasks == REAL_SETS[name]


def changed(task: Task, stage: int, edit: dict[str, dict[str, float]]) -> Task:
    """The task with some objects of a stage, and what stands on them, moved by hand."""
    document = json.loads(task.house_json(stage))
    for root in document["objects"]:
        if root["id"] in edit:
            for entry in [root, *(root.get("children") or [])]:
                for axis, by_m in edit[root["id"]].items():
                    entry["position"][axis] += by_m
    houses = list(task.houses_json)
    houses[stage - 1] = json.dumps(document)
    return dataclasses.replace(task, houses_json=tuple(houses))


def kinds(task: Task, stage: int) -> Counter[str]:
    return Counter(problem.kind for problem in problems_of(task) if problem.stage == stage)


def moved_roots(task: Task, stage: int) -> list[str]:
    changes = task.oracle(stage).evolution.changes
    return [change.id for change in changes if change.from_support_id is None and change.to_support_id is None]


@pytest.mark.slow
def test_what_is_wrong_is_found(shuffled: Task) -> None:
    """Each of the faults that the tests above say there are none of, made by hand."""
    task, stage = shuffled, 2
    assert problems_of(task) == []
    plan = Plan(task.house_json(stage))
    roots = [plan.things[name] for name in moved_roots(task, stage)]
    assert len(roots) >= 3
    first, second = sorted(roots, key=lambda thing: thing.shadow.area)[-2:]
    # Into the nearest wall.
    room = plan.rooms[plan.room_of(first.shadow) or ""]
    sides = [
        ("x", room.bounds[0] - first.shadow.bounds[0]),
        ("x", room.bounds[2] - first.shadow.bounds[2]),
        ("z", room.bounds[1] - first.shadow.bounds[1]),
        ("z", room.bounds[3] - first.shadow.bounds[3]),
    ]
    axis, to_wall_m = min(sides, key=lambda side: abs(side[1]))
    deeper_m = to_wall_m + math.copysign(0.05, to_wall_m)
    assert kinds(changed(task, stage, {first.id: {axis: deeper_m}}), stage)["in wall"] >= 1
    assert kinds(changed(task, stage, {first.id: {"x": 100.0}}), stage)["outside"] >= 1
    # Into each other.
    a, b = first.shadow.centroid, second.shadow.centroid
    onto = {"x": b.x - a.x, "z": b.y - a.y}
    assert kinds(changed(task, stage, {first.id: onto}), stage)["overlap"] >= 1
    # Into the air.
    assert kinds(changed(task, stage, {first.id: {"y": 0.1}}), stage)["floats"] >= 1
    # Onto the reference pose.
    pose_m = task.oracle(stage).reference_pose.position_m
    there = {"x": pose_m[0] - a.x, "z": pose_m[2] - a.y}
    assert kinds(changed(task, stage, {first.id: there}), stage)["reference pose"] == 1


def test_a_room_that_is_walled_off_is_found(shuffled: Task) -> None:
    document = json.loads(shuffled.house_json(2))
    # A doorway that is shut where it stood open cuts something off.
    for door in document["doors"]:
        door["openable"], door["openness"] = True, 0.0
    for wall in document["walls"]:
        wall["empty"] = False
    houses = (shuffled.houses_json[0], json.dumps(document), *shuffled.houses_json[2:])
    found = kinds(dataclasses.replace(shuffled, houses_json=houses), 2)
    assert found["cut off"] >= 1
