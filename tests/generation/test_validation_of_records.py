"""A task's records are checked against its houses, views and paths."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damaged_task import kinds, signed, with_house, with_stage

from evonav.generation.validation import validate_files
from evonav.tasks import Task, load_task


def first_change(task: Task, stage: int, **changes: Any) -> Task:
    evolution = task.oracle(stage).evolution
    changed = (evolution.changes[0].model_copy(update=changes), *evolution.changes[1:])
    return with_stage(task, stage, evolution=evolution.model_copy(update={"changes": changed}))


def without_first_change(task: Task) -> Task:
    evolution = task.oracle(2).evolution
    return with_stage(task, 2, evolution=evolution.model_copy(update={"changes": evolution.changes[1:]}))


def moved_by_nobody(document: dict[str, Any]) -> None:
    walls = [one for one in document["objects"] if one["position"]["y"] > 1.2]
    walls[0]["position"]["y"] += 0.01


def door_opened(document: dict[str, Any]) -> None:
    document["doors"][0]["openness"] = 0.25


def material_changed(document: dict[str, Any]) -> None:
    document["objects"][0]["material"] = "Gold"


def room_renamed(document: dict[str, Any]) -> None:
    document["rooms"][0]["roomType"] = "Kitchen" if document["rooms"][0]["roomType"] != "Kitchen" else "Bedroom"


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(without_first_change, id="a move is not recorded"),
        pytest.param(lambda task: first_change(task, 2, from_position_m=(0.0, 0.0, 0.0)), id="old place"),
        pytest.param(lambda task: first_change(task, 2, to_position_m=(0.0, 0.0, 0.0)), id="new place"),
        pytest.param(lambda task: first_change(task, 2, to_rotation_deg=(0.0, 1.0, 0.0)), id="new turn"),
        pytest.param(lambda task: first_change(task, 2, to_support_id="nobody"), id="new support"),
        pytest.param(lambda task: first_change(task, 2, id="nobody"), id="a stranger moved"),
        pytest.param(lambda task: first_change(task, 2, cause="RETAIN_GROUP"), id="another cause"),
        pytest.param(lambda task: with_house(task, 3, moved_by_nobody), id="moved by nobody"),
        pytest.param(lambda task: with_house(task, 3, door_opened), id="a door opened by nobody"),
        pytest.param(lambda task: with_house(task, 3, material_changed), id="another field of an object"),
        pytest.param(lambda task: with_house(task, 3, room_renamed), id="another part of the house"),
    ],
)
def test_the_change_record_is_the_difference_of_the_houses(root: Path, change: Callable[[Task], Task]) -> None:
    signed(change(load_task(root)), root)
    assert "change_record" in kinds(validate_files(root))


def test_a_move_that_is_listed_for_another_room_is_found(root: Path) -> None:
    task = load_task(root)
    evolution = task.oracle(2).evolution
    rooms = {weight.room_id for weight in evolution.room_weights} - {evolution.room_id}
    signed(with_stage(task, 2, evolution=evolution.model_copy(update={"room_id": rooms.pop()})), root)
    assert {"change_record", "state"} <= kinds(validate_files(root))


@pytest.mark.parametrize("flag", ["displacement_m", "is_relocated", "ever", "ever order", "target now", "target ever"])
def test_relocation_is_counted_again(root: Path, flag: str) -> None:
    task = load_task(root)
    change, oracle = task.oracle(2).evolution.changes[0], task.oracle(3)
    wrong = {
        "displacement_m": lambda: first_change(task, 2, displacement_m=change.displacement_m + 1e-3),
        "is_relocated": lambda: first_change(task, 2, is_relocated=not change.is_relocated),
        "ever": lambda: with_stage(task, 3, ever_relocated_ids=oracle.ever_relocated_ids[1:]),
        "ever order": lambda: with_stage(task, 3, ever_relocated_ids=oracle.ever_relocated_ids[::-1]),
        "target now": lambda: with_stage(
            task,
            3,
            target=oracle.target.model_copy(update={"is_relocated_now": not oracle.target.is_relocated_now}),
        ),
        "target ever": lambda: with_stage(
            task,
            3,
            target=oracle.target.model_copy(update={"is_relocated_ever": not oracle.target.is_relocated_ever}),
        ),
    }
    signed(wrong[flag](), root)
    assert kinds(validate_files(root)) == {"relocation"}


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("visited_room_ids", ()),
        ("changed_room_ids", (None, None)),
        ("goal_room_ids", ()),
        ("transition_room_id", None),
    ],
)
def test_the_state_is_what_went_before(root: Path, field: str, value: Any) -> None:
    task = load_task(root)
    state = task.oracle(3).state.model_copy(update={field: value})
    signed(with_stage(task, 3, state=state), root)
    assert kinds(validate_files(root)) == {"state"}


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
    task = load_task(root)
    target = task.oracle(2).target.model_copy(update={field: value})
    signed(with_stage(task, 2, target=target), root)
    assert "target" in kinds(validate_files(root))


def test_a_pose_elsewhere_is_not_the_reference_pose(root: Path) -> None:
    task = load_task(root)
    pose = task.oracle(3).reference_pose
    turned = pose.model_copy(update={"yaw_deg": (pose.yaw_deg + 40.0) % 360.0})
    signed(with_stage(task, 3, reference_pose=turned), root)
    assert {"reference_pose", "reference_image"} <= kinds(validate_files(root))
    x_m, y_m, z_m = pose.position_m
    away = pose.model_copy(update={"position_m": (x_m + 3.0, y_m, z_m)})
    signed(with_stage(task, 3, reference_pose=away), root)
    assert {"reference_pose", "reference_image", "path"} <= kinds(validate_files(root))


def test_pixels_of_the_target_are_counted_again(root: Path) -> None:
    task = load_task(root)
    signed(with_stage(task, 2, reference_visible_px=task.oracle(2).reference_visible_px + 1), root)
    assert kinds(validate_files(root)) == {"visibility"}


def test_one_pixel_of_another_colour_is_found(root: Path) -> None:
    task = load_task(root)
    image = np.array(task.reference_images[1])
    image[10, 10] ^= 1
    signed(
        dataclasses.replace(task, reference_images=(task.reference_images[0], image, *task.reference_images[2:])), root
    )
    report = validate_files(root)
    assert kinds(report) == {"reference_image"}
    assert report.problems[0].detail.startswith("1 pixels")


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
