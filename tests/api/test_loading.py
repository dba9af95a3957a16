"""Houses and tasks are lists, read when they are used."""

import json
from pathlib import Path

import pytest

import evonav
from evonav.errors import HouseError, InvalidArgumentError, TaskError


def test_houses_are_a_list() -> None:
    houses = evonav.load_houses("bundled", limit=5)
    assert len(houses) == 5
    assert houses[-1].name == "bundled:5"
    assert [house.name for house in houses[1:3]] == ["bundled:2", "bundled:3"]
    assert houses[0] is houses[0]
    assert repr(houses).endswith(", ... 2 more]")
    with pytest.raises(IndexError):
        houses[5]


def test_houses_come_from_files_too(tmp_path: Path) -> None:
    house = evonav.load_houses(limit=1)[0]
    (tmp_path / "one.json").write_text(house.to_json())
    assert [found.name for found in evonav.load_houses([tmp_path / "one.json", "bundled"], limit=2)] == [
        f"{tmp_path / 'one.json'}:1",
        "bundled:1",
    ]
    with pytest.raises(HouseError, match=r"bundle: no such file or folder of houses; `bundled` names those"):
        evonav.load_houses("bundle")
    (tmp_path / "bad.jsonl").write_text("{}\n")
    with pytest.raises(HouseError, match=r"bad\.jsonl:1"):
        evonav.load_houses(tmp_path / "bad.jsonl")[0]


def test_houses_that_lack_something_are_completed(tmp_path: Path) -> None:
    document = json.loads(evonav.load_houses("bundled:86")[0].to_json())
    document["objects"][0]["assetId"] = "0123456789abcdef"
    del document["metadata"]["agent"]
    (tmp_path / "house.json").write_text(json.dumps(document))
    (tmp_path / "sizes.json").write_text('{"0123456789abcdef": {"category": "DiningTable", "size_m": [1, 0.7, 1.5]}}')
    source, sizes = tmp_path / "house.json", tmp_path / "sizes.json"
    (house,) = evonav.load_houses(source, assets=sizes, start="auto")
    assert house.start is not None
    assert house.objects[0].category == "DiningTable"
    (task,) = evonav.generate_tasks(source, limit=1, workers=0, assets=sizes, start="auto")
    assert "0123456789abcdef" in json.loads(task.house_json(1))["metadata"]["evonav_assets"]


def test_tasks_are_a_list_and_each_is_one_to_evaluate_on(tmp_path: Path) -> None:
    tasks = evonav.load_tasks()
    assert len(tasks) == 24
    assert repr(tasks[1]).startswith("Task(id='bundled-0085-5f3096-s0', num_stages=3, goals=[Vase, ")
    root = tasks[1].root
    assert root is not None
    assert evonav.load_tasks(root)[0].checksums == tasks[1].checksums
    for given in (tasks[1], tasks[1:2], [tasks[1]], [root], tasks.sources[1]):
        run = evonav.evaluate("stay-still", tasks=given, out=tmp_path / "run", workers=0)
        assert set(run.stages["task_id"]) == {tasks[1].task_id}
    with pytest.raises(InvalidArgumentError, match="two tasks have the id"):
        evonav.evaluate("stay-still", tasks=[tasks[1], root])
    with pytest.raises(TaskError, match="no such folder of tasks"):
        evonav.load_tasks(tmp_path / "nowhere")


def test_tasks_are_generated_from_houses_in_memory(tmp_path: Path) -> None:
    houses = evonav.load_houses("bundled", limit=3)
    tasks = evonav.generate_tasks(houses[1:], out=tmp_path / "tasks", limit=1, workers=0)
    assert len(tasks) == 1
    again = evonav.generate_tasks(houses[1:], out=tmp_path / "tasks", limit=1, workers=0)
    assert again[0].checksums == tasks[0].checksums
    with pytest.raises(InvalidArgumentError, match=r"expected `bundled`, a path, or a list of `evonav\.House`"):
        evonav.generate_tasks([1])  # type: ignore[list-item]
