"""A task's records are checked against its houses, views and paths; objects that intersect or float are found."""

import dataclasses
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damaged_task import kinds, signed, with_house, with_stage

from evonav.generation.validation import validate_files
from evonav.tasks import Task, load_task

Json = dict[str, Any]
Damage = Callable[[Task], Task]


def part(stage: int, name: str, **changes: Any) -> Damage:
    """Change fields of a stage's `evolution`, `target` or `state`."""
    return lambda task: with_stage(task, stage, **{name: getattr(task.oracle(stage), name).model_copy(update=changes)})


def first_change(**changes: Any) -> Damage:
    """Change fields of the first change of stage 2."""

    def damage(task: Task) -> Task:
        first, *rest = task.oracle(2).evolution.changes
        return part(2, "evolution", changes=(first.model_copy(update=changes), *rest))(task)

    return damage


def house(edit: Callable[[Json], None], stage: int = 3) -> Damage:
    return lambda task: with_house(task, stage, edit)


def moved_by_nobody(document: Json) -> None:
    next(one for one in document["objects"] if one["position"]["y"] > 1.2)["position"]["y"] += 0.01


def room_renamed(document: Json) -> None:
    room = document["rooms"][0]
    room["roomType"] = "Bedroom" if room["roomType"] == "Kitchen" else "Kitchen"


def another_pixel(task: Task) -> Task:
    images = list(task.reference_images)
    images[1] = np.array(images[1])
    images[1][10, 10] ^= 1
    return dataclasses.replace(task, reference_images=tuple(images))


def flipped(field: str) -> Damage:
    return lambda task: part(3, "target", **{field: not getattr(task.oracle(3).target, field)})(task)


@pytest.mark.parametrize(
    "damage",
    [
        pytest.param(
            lambda task: part(2, "evolution", changes=task.oracle(2).evolution.changes[1:])(task),
            id="a move is not recorded",
        ),
        pytest.param(first_change(from_position_m=(0.0, 0.0, 0.0)), id="old place"),
        pytest.param(first_change(to_position_m=(0.0, 0.0, 0.0)), id="new place"),
        pytest.param(first_change(to_rotation_deg=(0.0, 1.0, 0.0)), id="new turn"),
        pytest.param(first_change(to_support_id="nobody"), id="new support"),
        pytest.param(first_change(id="nobody"), id="a stranger moved"),
        pytest.param(first_change(cause="RETAIN_GROUP"), id="another cause"),
        pytest.param(house(moved_by_nobody), id="moved by nobody"),
        pytest.param(house(lambda document: document["doors"][0].update(openness=0.25)), id="a door opened by nobody"),
        pytest.param(
            house(lambda document: document["objects"][0].update(material="Gold")), id="another field of an object"
        ),
        pytest.param(house(room_renamed), id="another part of the house"),
    ],
)
def test_the_change_record_is_the_difference_of_the_houses(root: Path, damage: Damage) -> None:
    signed(damage(load_task(root)), root)
    assert "change_record" in kinds(validate_files(root))


@pytest.mark.parametrize(
    ("damage", "kind"),
    [
        (
            lambda task: first_change(displacement_m=task.oracle(2).evolution.changes[0].displacement_m + 1e-3)(task),
            "relocation",
        ),
        (
            lambda task: first_change(is_relocated=not task.oracle(2).evolution.changes[0].is_relocated)(task),
            "relocation",
        ),
        (lambda task: with_stage(task, 3, ever_relocated_ids=task.oracle(3).ever_relocated_ids[1:]), "relocation"),
        (lambda task: with_stage(task, 3, ever_relocated_ids=task.oracle(3).ever_relocated_ids[::-1]), "relocation"),
        (flipped("is_relocated_now"), "relocation"),
        (flipped("is_relocated_ever"), "relocation"),
        (part(3, "state", visited_room_ids=()), "state"),
        (part(3, "state", changed_room_ids=(None, None)), "state"),
        (part(3, "state", goal_room_ids=()), "state"),
        (part(3, "state", transition_room_id=None), "state"),
        (
            lambda task: with_stage(task, 2, reference_visible_px=task.oracle(2).reference_visible_px + 1),
            "visibility",
        ),
        (another_pixel, "reference_image"),
    ],
)
def test_what_is_counted_and_seen_is_found_again(root: Path, damage: Damage, kind: str) -> None:
    signed(damage(load_task(root)), root)
    assert kinds(validate_files(root)) == {kind}


def test_a_move_that_is_listed_for_another_room_is_found(root: Path) -> None:
    task = load_task(root)
    evolution = task.oracle(2).evolution
    rooms = {weight.room_id for weight in evolution.room_weights} - {evolution.room_id}
    signed(part(2, "evolution", room_id=rooms.pop())(task), root)
    assert {"change_record", "state"} <= kinds(validate_files(root))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("id", "nobody"),
        ("room_id", "room|99"),
        ("score", 1.25),
        ("same_category_ids", ("nobody",)),
        ("support_id", "nobody"),
        ("position_m", (1.0, 1.0, 1.0)),
    ],
)
def test_the_target_is_as_in_the_house(root: Path, field: str, value: Any) -> None:
    signed(part(2, "target", **{field: value})(load_task(root)), root)
    assert "target" in kinds(validate_files(root))


def test_a_pose_elsewhere_is_not_the_reference_pose(root: Path) -> None:
    task = load_task(root)
    pose = task.oracle(3).reference_pose
    signed(part(3, "reference_pose", yaw_deg=(pose.yaw_deg + 40.0) % 360.0)(task), root)
    assert {"reference_pose", "reference_image"} <= kinds(validate_files(root))
    x_m, y_m, z_m = pose.position_m
    signed(part(3, "reference_pose", position_m=(x_m + 3.0, y_m, z_m))(task), root)
    assert {"reference_pose", "reference_image", "path"} <= kinds(validate_files(root))


def test_paths_are_measured_again(root: Path) -> None:
    task = load_task(root)
    stage = max(range(1, 4), key=lambda number: task.oracle(number).reference_path_length_m)
    oracle = task.oracle(stage)
    signed(with_stage(task, stage, reference_path_length_m=oracle.reference_path_length_m + 1e-4), root)
    assert kinds(validate_files(root)) == {"path"}
    corners = (oracle.reference_path_m[0], (0.0, 0.0), oracle.reference_path_m[-1])
    length_m = math.dist(corners[0], corners[1]) + math.dist(corners[1], corners[2])
    signed(with_stage(task, stage, reference_path_m=corners, reference_path_length_m=length_m), root)
    assert "path" in kinds(validate_files(root))


def floor_things(task: Task) -> list[str]:
    """Things of the changed room that were moved and stand on the floor."""
    return [change.id for change in task.oracle(3).evolution.changes if change.to_support_id is None]


def entry_of(document: Json, one: str) -> Json:
    return next(entry for entry in document["objects"] if entry["id"] == one)


def put(task: Task, one: str, **place: float) -> Task:
    """Put an object of the last house somewhere else, and leave the record as it is."""
    return with_house(task, 3, lambda document: entry_of(document, one)["position"].update(place))


def test_two_things_in_one_place_penetrate(root: Path) -> None:
    task = load_task(root)
    one, other = floor_things(task)[:2]
    there = entry_of(json.loads(task.house_json(3)), other)["position"]
    signed(put(task, one, x=there["x"], z=there["z"]), root)
    problems = [problem for problem in validate_files(root).problems if problem.kind == "penetration"]
    assert any(one in problem.detail and other in problem.detail for problem in problems)


def test_a_thing_in_a_wall_is_in_it_and_out_of_its_room(root: Path) -> None:
    task = load_task(root)
    rooms = {room["id"]: room for room in json.loads(task.house_json(3))["rooms"]}
    first, second, *_ = rooms[task.oracle(3).evolution.room_id]["floorPolygon"]
    middle = {axis: (first[axis] + second[axis]) / 2.0 for axis in "xz"}
    signed(put(task, floor_things(task)[0], **middle), root)
    assert {"in_wall", "out_of_room"} <= kinds(validate_files(root))


@pytest.mark.parametrize(("rise_m", "kind"), [(0.3, "unsupported"), (-0.05, "in_floor")])
def test_a_thing_in_the_air_or_in_the_floor_is_found(root: Path, rise_m: float, kind: str) -> None:
    task = load_task(root)
    one = floor_things(task)[0]
    signed(put(task, one, y=entry_of(json.loads(task.house_json(3)), one)["position"]["y"] + rise_m), root)
    assert kind in kinds(validate_files(root))


def test_a_house_that_cannot_be_built_is_told(root: Path) -> None:
    task = load_task(root)
    signed(house(lambda document: document["objects"][0].update(assetId="no_such_asset"), 2)(task), root)
    report = validate_files(root)
    assert any(problem.kind == "house" and "no_such_asset" in problem.detail for problem in report.problems)
    for text in ("[]", "{}", "not JSON"):
        signed(dataclasses.replace(task, houses_json=(*task.houses_json[:2], text)), root)
        assert "house" in kinds(validate_files(root)), text
