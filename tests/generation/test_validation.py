"""Every kind of damage is named; what is sound is not."""

import dataclasses
import json
import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, PngImagePlugin

from evonav.cli import app
from evonav.errors import TaskError
from evonav.generation import GenerationParameters, generate_task
from evonav.generation.validation import KINDS, Report, validate_files, validate_folder, validate_task
from evonav.house import bundled_houses
from evonav.tasks import Task, load_task, write_task
from evonav.tasks.dataset import DatasetRecord, entry_of, write_dataset
from evonav.tasks.records import read_gzip, sha256_of, write_gzip


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A task that changes before every stage but the first, by shuffling a room."""
    config = GenerationParameters(
        num_stages=(3,),
        evolve_probability=1.0,
        salient_object_probability=0.0,
        retain_group_probability=0.0,
        full_shuffle_probability=1.0,
    )
    house = list(bundled_houses(2))[1]
    task = generate_task(house, seed=4, config=config)
    assert all(stage.evolution.changes for stage in task.oracle_stages[1:])
    return write_task(task, tmp_path_factory.mktemp("sound"))


@pytest.fixture
def root(sound: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(sound, tmp_path / sound.name))


def signed(task: Task, root: Path) -> Path:
    """The task in its folder again, with checksums that fit, so that only the meaning can tell."""
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


def test_a_sound_task_has_no_problem(root: Path) -> None:
    report = validate_files(root)
    assert report.problems == ()
    assert report.num_stages == 3
    assert validate_task(load_task(root)) == report


def test_bundled_tasks_are_sound() -> None:
    from evonav.tasks.bundled import bundled_tasks

    with bundled_tasks() as folder:
        report = validate_folder(folder)
    assert list(report.problems) == []
    assert len(report.reports) >= 24


# Files


def test_all_that_is_wrong_is_collected_and_not_the_first_only(root: Path) -> None:
    (root / "public/stage_1.png").unlink()
    (root / "houses/stage_2.json.gz").write_bytes(b"noise")
    document = json.loads((root / "oracle/stage_3.json").read_text(encoding="utf-8"))
    document["target"]["score"] = math.nan
    document["stranger"] = 1
    (root / "oracle/stage_3.json").write_text(json.dumps(document), encoding="utf-8")
    problems = [(problem.stage, problem.kind, problem.detail) for problem in validate_files(root).problems]
    assert [(stage, kind) for stage, kind, _ in problems] == [(1, "file"), (2, "file"), (3, "schema"), (3, "schema")]
    assert "public/stage_1.png" in problems[0][2]
    assert "houses/stage_2.json.gz" in problems[1][2]
    assert {"score", "stranger"} == {
        word for _, _, detail in problems[2:] for word in ("score", "stranger") if word in detail
    }


@pytest.mark.parametrize("name", ["task.json", "public/stage_1.json", "oracle/stage_2.json", "houses/stage_3.json.gz"])
@pytest.mark.parametrize("damage", ["gone", "cut", "empty"])
def test_damaged_files_are_named(root: Path, name: str, damage: str) -> None:
    data = (root / name).read_bytes()
    (root / name).unlink()
    if damage != "gone":
        (root / name).write_bytes(data[: len(data) // 2] if damage == "cut" else b"")
    report = validate_files(root)
    assert any(name in problem.detail and problem.kind in ("file", "schema") for problem in report.problems)


@pytest.mark.parametrize("name", ["oracle/stage_1.json", "public/stage_2.json"])
def test_another_schema_version_and_unknown_keys_are_refused(root: Path, name: str) -> None:
    path = root / name
    for change in ({"schema_version": 1}, {"unknown": None}):
        path.write_text(json.dumps({**json.loads(path.read_text(encoding="utf-8")), **change}), encoding="utf-8")
        assert kinds(validate_files(root)) == {"schema"}


def test_changed_contents_do_not_match_their_checksum(root: Path) -> None:
    path = root / "houses/stage_2.json.gz"
    house = json.loads(read_gzip(path))
    house["metadata"]["note"] = "changed"
    path.write_bytes(write_gzip(json.dumps(house).encode()))
    report = validate_files(root)
    assert {(problem.stage, problem.kind) for problem in report.problems} >= {(0, "checksum"), (2, "checksum")}


def test_strange_files_are_found(root: Path) -> None:
    (root / "notes.txt").touch()
    (root / "public/solution.json").touch()
    found = {(problem.kind, problem.detail.split(":")[0]) for problem in validate_files(root).problems}
    assert found == {("stranger", "notes.txt"), ("leak", "public/solution.json")}


def test_files_that_contradict_each_other(root: Path) -> None:
    task = load_task(root)
    public = tuple(stage.model_copy(update={"category": "Bed"}) for stage in task.public_stages)
    signed(dataclasses.replace(task, public_stages=public), root)
    assert "contradiction" in kinds(validate_files(root))
    moved = root.rename(root.parent / "another")
    assert "contradiction" in kinds(validate_files(moved))


# Nothing of the oracle in public


def leaking(word: str) -> Callable[[Task], Task]:
    def change(task: Task) -> Task:
        first = task.public_stages[0]
        text = first.basic_instruction.replace(".", f" {word}.")
        public = (first.model_copy(update={"basic_instruction": text}), *task.public_stages[1:])
        return dataclasses.replace(task, public_stages=public)

    return change


@pytest.mark.parametrize("what", ["id", "room", "coordinate"])
def test_ids_and_coordinates_in_public_words_are_leaks(root: Path, what: str) -> None:
    task = load_task(root)
    target = task.oracle(1).target
    word = {"id": target.id, "room": target.room_id, "coordinate": f"at {target.position_m[0]:.2f}"}[what]
    signed(leaking(word)(task), root)
    assert kinds(validate_files(root)) == {"leak"}


def test_text_in_an_image_is_a_leak(root: Path) -> None:
    path = root / "public/stage_1.png"
    info = PngImagePlugin.PngInfo()
    info.add_text("target", "4|0|1")
    with Image.open(path) as image:
        image.save(path, pnginfo=info)
    report = validate_files(root)
    assert kinds(report) == {"leak"}
    assert "tEXt" in report.problems[0].detail


def test_bytes_after_an_image_are_a_leak(root: Path) -> None:
    path = root / "public/stage_1.png"
    path.write_bytes(path.read_bytes() + b"4|0|1")
    assert kinds(validate_files(root)) == {"leak"}


# Records against houses


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


# Views and ways


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


# Physics


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


# Folders and the command


@pytest.fixture
def folder(root: Path) -> Path:
    task = load_task(root)
    other = dataclasses.replace(task, header=task.header.model_copy(update={"task_id": "another"}))
    write_task(other, root.parent)
    write_dataset(
        DatasetRecord(
            name="evonav",
            split="none",
            generator=task.header.generator,
            sources=(),
            seed=4,
            limit=None,
            subset=None,
            allow_unknown_assets=False,
            parameters=task.header.parameters,
            num_houses=2,
            num_tasks=2,
            tasks=(entry_of(other), entry_of(task)),
            rejections=(),
        ),
        root.parent,
    )
    return root.parent


def test_a_folder_gives_the_same_report_for_any_number_of_workers(folder: Path, root: Path) -> None:
    (root / "public/stage_1.png").unlink()
    seen: list[tuple[int, int]] = []
    alone = validate_folder(folder, on_progress=lambda done, total: seen.append((done, total)))
    assert seen == [(0, 2), (1, 2), (2, 2)]
    assert [problem.kind for problem in alone.problems] == ["file"]
    assert alone.num_invalid == 1
    assert validate_folder(folder, num_workers=2) == alone
    assert len(validate_folder(folder, limit=1).reports) == 1


def test_the_dataset_record_is_checked(folder: Path, root: Path) -> None:
    shutil.rmtree(root)
    report = validate_folder(folder)
    assert [(problem.task_id, problem.kind) for problem in report.problems] == [(root.name, "dataset")]
    (folder / "dataset.json").write_text("{}", encoding="utf-8")
    assert {problem.kind for problem in validate_folder(folder).problems} == {"dataset"}


def test_an_empty_folder_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(TaskError, match="holds no task"):
        validate_folder(tmp_path)


def test_the_command_says_what_is_wrong_and_exits_with_1(
    folder: Path, root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from typer.testing import CliRunner

    arguments = ["tasks", "validate", str(folder), "--workers", "0", "--json", str(tmp_path / "found.json")]
    good = CliRunner().invoke(app, arguments)
    assert good.exit_code == 0, good.output
    assert "2 of 2 tasks valid" in good.output
    (root / "oracle/stage_1.json").write_text("{}", encoding="utf-8")
    bad = CliRunner().invoke(app, arguments)
    assert bad.exit_code == 1
    assert "1 of 2 tasks valid" in bad.output
    assert "schema" in bad.output
    found = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))
    assert found["num_invalid"] == 1
    assert {problem["kind"] for problem in found["problems"]} == {"schema"}
    assert {problem["task_id"] for problem in found["problems"]} == {root.name}


def test_every_kind_is_explained() -> None:
    from typing import get_args

    from evonav.generation.validation import ProblemKind

    assert set(KINDS) == set(get_args(ProblemKind))
