import dataclasses
import gzip
import json
import random
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evonav.errors import TaskError
from evonav.tasks import Task, load_task, load_tasks, write_task
from evonav.tasks.manifest import PublicStage
from evonav.tasks.records import read_gzip, record_bytes, write_gzip


def files_of(root: Path) -> dict[str, bytes]:
    return {str(path.relative_to(root)): path.read_bytes() for path in sorted(root.rglob("*")) if path.is_file()}


def test_a_task_reads_back_as_it_was_written(task: Task, root: Path, tmp_path: Path) -> None:
    read = load_task(root)
    assert read.header == task.header
    assert read.public_stages == task.public_stages
    assert read.oracle_stages == task.oracle_stages
    assert read.houses_json == task.houses_json
    for stage in range(1, task.num_stages + 1):
        assert read.house_json(stage) == task.house_json(stage)
        np.testing.assert_array_equal(read.public(stage).reference_image, task.public(stage).reference_image)
    again = write_task(read, tmp_path / "again")
    assert files_of(again) == files_of(root)


def test_stages_are_counted_from_one(task: Task) -> None:
    assert task.public(1).stage == 1
    for stage in (0, task.num_stages + 1, -1):
        for get in (task.public, task.oracle, task.house_json):
            with pytest.raises(IndexError):
                get(stage)


def test_tasks_come_in_order_of_their_ids(task: Task, tmp_path: Path) -> None:
    for name in ("b-0010", "b-0002", "a"):
        write_task(dataclasses.replace(task, header=task.header.model_copy(update={"task_id": name})), tmp_path)
    assert [found.task_id for found in load_tasks(tmp_path)] == ["a", "b-0002", "b-0010"]
    assert [found.task_id for found in load_tasks(tmp_path, limit=1)] == ["a"]
    with pytest.raises(TaskError, match="is a task itself: name the folder that holds it"):
        list(load_tasks(tmp_path / "a"))


def test_images_cannot_be_changed_by_an_agent(root: Path) -> None:
    image = load_task(root).public(1).reference_image
    with pytest.raises(ValueError, match="read-only"):
        image[0, 0, 0] = 1


def strings_in(value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        yield from value
        for part in value.values():
            yield from strings_in(part)
    elif isinstance(value, list | tuple):
        for part in value:
            yield from strings_in(part)
    else:
        yield str(value)


def test_public_files_contain_no_oracle_data(task: Task, root: Path) -> None:
    house = json.loads(task.house_json(1))
    ids = {entry["id"] for entry in house["objects"]} | {room["id"] for room in house["rooms"]}
    for parent in house["objects"]:
        ids |= {child["id"] for child in parent.get("children", [])}
    for stage in range(1, task.num_stages + 1):
        text = (root / f"public/stage_{stage}.json").read_text(encoding="utf-8")
        public = json.loads(text)
        assert set(public) == set(PublicStage.model_fields)
        # No id, no number but stage and schema version, none of the oracle's field names.
        values = list(strings_in(public))
        assert not ids & set(values)
        assert not [value for value in values if any(name in value for name in ids)]
        numbers = [value for value in public.values() if not isinstance(value, str)]
        assert numbers == [1, stage]
        oracle = json.loads((root / f"oracle/stage_{stage}.json").read_text(encoding="utf-8"))
        assert set(oracle) & set(public) == {"schema_version", "stage"}
        image = (root / f"public/stage_{stage}.png").read_bytes()
        assert b"tEXt" not in image
        assert b"iTXt" not in image
        assert b"eXIf" not in image
        given = task.public(stage)
        assert {field.name for field in dataclasses.fields(given)} == {
            "stage",
            "category",
            "basic_instruction",
            "appearance_instruction",
            "unified_instruction",
            "reference_image",
        }


def mutations(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Copies of a JSON value with one thing wrong in each."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield f"{path}.{key} gone", {k: v for k, v in value.items() if k != key}
            for place, wrong in mutations(part, f"{path}.{key}"):
                yield place, {**value, key: wrong}
        yield f"{path} with a stranger", {**value, "stranger": 1}
    elif isinstance(value, list):
        for index, part in list(enumerate(value))[:2]:
            for place, wrong in mutations(part, f"{path}[{index}]"):
                yield place, [*value[:index], wrong, *value[index + 1 :]]
        yield f"{path} as text", "text"
    else:
        for wrong in (None, [], {}, "text", -7, 0.5, True, 10**400, float("nan"), float("inf"), "x" * 5000):
            if type(wrong) is not type(value) or wrong != value:
                yield f"{path} = {wrong!r:.20}", wrong


def resigned(root: Path) -> None:
    """Makes checksums of whatever is there, so that the schema alone has to tell."""
    header = json.loads((root / "task.json").read_text(encoding="utf-8"))
    try:
        task = load_without_checks(root)
    except TaskError:
        return
    header["checksums"] = task.checksums
    (root / "task.json").write_text(json.dumps(header), encoding="utf-8")


def load_without_checks(root: Path) -> Task:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("evonav.tasks.files.inconsistencies", lambda *_: ())
        return load_task(root)


def outcome_of(root: Path) -> tuple[str, Task | None]:
    """A task, or the message with which it was refused; any other exception is a bug."""
    try:
        return "", load_task(root)
    except TaskError as error:
        return str(error), None


def test_hundreds_of_mutated_files_are_each_refused_by_name(task: Task, root: Path) -> None:
    """Every single change to any JSON file is a `TaskError` that names the file, or harmless: what loads is whole."""
    num_refused = 0
    for name in ("task.json", "public/stage_1.json", "oracle/stage_2.json", "houses/stage_2.json.gz"):
        path = root / name
        good = path.read_bytes()
        is_packed = name.endswith(".gz")
        document = json.loads(gzip.decompress(good) if is_packed else good)
        cases = list(mutations(document))
        for place, wrong in random.Random(name).sample(cases, min(len(cases), 160)):
            data = json.dumps(wrong).encode()
            path.write_bytes(gzip.compress(data, 1) if is_packed else data)
            message, loaded = outcome_of(root)
            if loaded is None:
                assert str(root) in message, place
                num_refused += 1
            else:  # A header's free text, or a number written in another way.
                assert name == "task.json" or record_bytes(loaded.header) == record_bytes(task.header), place
                assert loaded.checksums == task.checksums, place
        path.write_bytes(good)
    assert num_refused > 400


def test_mutated_oracles_with_matching_checksums_are_refused_or_consistent(root: Path, tmp_path: Path) -> None:
    name = "oracle/stage_2.json"
    document = json.loads((root / name).read_text(encoding="utf-8"))
    cases = list(mutations(document))
    num_refused = 0
    for number, (place, wrong) in enumerate(random.Random(0).sample(cases, 150)):
        copy = tmp_path / f"copy_{number}" / root.name
        shutil.copytree(root, copy)
        (copy / name).write_text(json.dumps(wrong), encoding="utf-8")
        resigned(copy)
        try:
            task = load_task(copy)
            houses = [task.house_json(stage) for stage in range(1, task.num_stages + 1)]
        except TaskError:
            num_refused += 1
        else:
            assert len(houses) == task.num_stages, place
        shutil.rmtree(copy)
    assert num_refused > 100


def refused(root: Path, match: str) -> None:
    with pytest.raises(TaskError, match=match):
        load_task(root)


@pytest.mark.parametrize("name", ["task.json", "public/stage_1.json", "oracle/stage_1.json", "houses/stage_1.json.gz"])
@pytest.mark.parametrize("damage", ["missing", "empty", "cut", "noise", "directory", "not utf-8"])
def test_damaged_files_are_named(root: Path, name: str, damage: str) -> None:
    path = root / name
    data = path.read_bytes()
    path.unlink()
    if damage == "directory":
        path.mkdir()
    elif damage != "missing":
        damaged: dict[str, Callable[[], bytes]] = {
            "empty": lambda: b"",
            "cut": lambda: data[: len(data) // 2],
            "noise": lambda: random.Random(1).randbytes(len(data)),
            "not utf-8": lambda: write_gzip(b'{"\xff": 1}') if name.endswith("gz") else b'{"\xff": 1}',
        }
        path.write_bytes(damaged[damage]())
    refused(root, str(path.name))


@pytest.mark.parametrize("seed", range(60))
def test_damaged_images_are_refused(root: Path, seed: int) -> None:
    path = root / "public/stage_2.png"
    data = bytearray(path.read_bytes())
    draw = random.Random(seed)
    if seed % 3 == 0:
        del data[draw.randrange(len(data)) :]
    else:
        for _ in range(draw.choice((1, 20))):
            data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
    path.write_bytes(data)
    message, task = outcome_of(root)
    if task is None:
        assert "stage_2.png" in message
    else:  # A flipped bit that no pixel depends on.
        assert task.checksums == task.header.checksums


def test_an_image_of_another_size_is_not_decoded(root: Path) -> None:
    path = root / "public/stage_1.png"
    data = bytearray(path.read_bytes())
    data[16:24] = (60_000).to_bytes(4, "big") * 2
    path.write_bytes(data)
    refused(root, r"stage_1\.png.*IHDR.*300x300")


def test_a_house_that_unpacks_beyond_the_limit_is_refused(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = root / "houses/stage_1.json.gz"
    path.write_bytes(gzip.compress(b" " * 3_000_000))
    monkeypatch.setattr("evonav.tasks.records.MAX_FILE_BYTES", 2_000_000)
    refused(root, r"stage_1\.json\.gz: uncompressed, larger than")


@pytest.mark.parametrize("stage", [1, 3])
def test_a_house_other_than_the_oracles_is_refused(root: Path, stage: int) -> None:
    path = root / f"houses/stage_{stage}.json.gz"
    house = json.loads(read_gzip(path))
    house["objects"][0]["position"]["x"] += 0.25
    path.write_bytes(write_gzip(json.dumps(house).encode()))
    refused(root, rf"oracle/stage_{stage}\.json: house_sha256 = ")


def test_a_task_in_a_directory_of_another_name_is_refused(root: Path) -> None:
    moved = root.rename(root.parent / "another")
    refused(moved, "task_id")


def test_stages_of_another_number_are_refused(root: Path) -> None:
    for kind in ("public", "oracle"):
        shutil.copy(root / f"{kind}/stage_2.json", root / f"{kind}/stage_1.json")
        refused(root, rf"{kind}/stage_1\.json: stage = 2: expected 1")
        break


def test_an_unwritable_directory_is_a_task_error(task: Task, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    with pytest.raises(TaskError, match="cannot be written"):
        write_task(task, tmp_path / "file")
