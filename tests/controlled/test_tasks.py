"""Arms of a controlled analysis: the same goal, the same walk, and nothing but the evolution between them."""

import dataclasses
import gzip
import json
import shutil
from itertools import pairwise

import pytest
from typer.testing import CliRunner

from evonav.cli import app
from evonav.controlled.dataset import generate_controlled
from evonav.controlled.generate import generate_arms
from evonav.controlled.layout import ControlledOptions, read_controlled, tasks_of
from evonav.errors import InvalidArgumentError, StoreError, TaskError
from evonav.generation import TaskRejectedError, generate_task
from evonav.generation.validation import validate_files, validate_task
from evonav.house import bundled_houses
from evonav.tasks import load_task, write_task
from evonav.tasks.listing import task_roots
from evonav.tasks.parameters import GenerationParameters

SMALL = GenerationParameters(reference_image_px=64, reference_min_visible_px=10)
PAIRS = ControlledOptions(parameters=SMALL)
RATES = ControlledOptions(kind="rates", rates=(0.0, 0.5, 1.0), parameters=SMALL)


def several(options, num_houses):
    made = []
    for house in bundled_houses(num_houses):
        try:
            made.append(generate_arms(house, options, seed=3))
        except TaskRejectedError:
            continue
    assert len(made) > num_houses / 2
    return made


@pytest.fixture(scope="module")
def pairs():
    return several(PAIRS, 8)


def test_arms_of_a_pair_are_equal_up_to_the_change(pairs):
    for arms in pairs:
        fixed, evolved = arms["fixed"], arms["evolved"]
        assert fixed.task_id == evolved.task_id
        assert fixed.start_pose == evolved.start_pose
        for stage in (1, 2):
            assert fixed.oracle(stage) == evolved.oracle(stage)
            assert fixed.house_json(stage) == evolved.house_json(stage) == fixed.house_json(1)
        assert fixed.public_stages == evolved.public_stages
        for stage in (1, 2, 3):
            assert (fixed.public(stage).reference_image == evolved.public(stage).reference_image).all()
        assert fixed.oracle(3).start_pose == evolved.oracle(3).start_pose == fixed.oracle(2).reference_pose
        assert fixed.oracle(3).target.id == evolved.oracle(3).target.id == fixed.oracle(1).target.id


def test_the_second_stages_goal_is_seen_first_and_lies_outside_of_the_room_where_the_walk_ends(pairs):
    for arms in pairs:
        task = arms["evolved"]
        assert task.header.control.guided_stages == (1, 2)
        assert task.public(3).unified_instruction == task.public(1).unified_instruction
        assert task.oracle(1).reference_visible_px >= SMALL.reference_min_visible_px
        assert task.oracle(3).state.transition_room_id == task.oracle(2).target.room_id
        assert task.oracle(1).target.room_id != task.oracle(2).target.room_id


def test_one_arm_stays_as_it_was_and_the_other_evolves_outside_of_the_agents_room(pairs):
    for arms in pairs:
        fixed, evolved = arms["fixed"], arms["evolved"]
        assert fixed.oracle(3).evolution.outcome == "not_triggered"
        assert fixed.house_json(3) == fixed.house_json(2)
        evolution = evolved.oracle(3).evolution
        assert evolution.outcome == "evolved"
        assert evolution.room_id != evolved.oracle(3).state.transition_room_id
        assert evolved.house_json(3) != evolved.house_json(2)
        weights = {weight.room_id: weight for weight in evolution.room_weights}
        assert weights[evolved.oracle(3).state.transition_room_id].weight == 0.0
        assert weights[evolved.oracle(1).target.room_id].is_visited


def test_every_arm_is_a_valid_task(pairs, tmp_path):
    for arms in pairs[:3]:
        for name, task in arms.items():
            assert validate_task(task).problems == ()
            root = write_task(task, tmp_path / name)
            assert validate_files(root).problems == ()
            assert load_task(root).header == task.header


def test_a_sweep_has_the_same_goals_and_nested_changes():
    num_changed = 0
    for arms in several(RATES, 6):
        tasks = [arms[arm.name] for arm in RATES.arms]
        goals = [[stage.target.id for stage in task.oracle_stages] for task in tasks]
        assert goals[0] == goals[1] == goals[2]
        evolved = [
            [s.evolution.outcome not in ("not_triggered", "first_stage") for s in t.oracle_stages] for t in tasks
        ]
        assert not any(evolved[0])
        assert all(a <= b for few, many in pairwise(evolved) for a, b in zip(few, many, strict=True))
        assert evolved[2] == [False] + [True] * (len(evolved[2]) - 1)
        assert [task.guided_stages for task in tasks] == [()] * 3
        num_changed += sum(evolved[1])
    assert num_changed


def test_tasks_of_other_kinds_have_no_guided_stages():
    task = generate_task(next(bundled_houses(1)), seed=0, config=SMALL)
    assert task.header.control is None
    assert task.guided_stages == ()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"guided_stages": (1, 2, 3)}, "not all of them"),
        ({"guided_stages": (1, 9)}, "expected guided_stages of 1 to 3"),
        ({"shown_goals": (1, 2)}, "expected shown_goals of 3 stages"),
        ({"shown_goals": (1, 2, 4)}, "expected shown_goals of 3 stages"),
        ({"shown_goals": (1, 1, 1)}, "expected stage 2 to have the instructions and image of stage 1"),
    ],
)
def test_a_header_that_the_stages_contradict_is_refused(pairs, tmp_path, change, message):
    task = pairs[0]["evolved"]
    control = task.header.control.model_copy(update=change)
    bad = dataclasses.replace(task, header=task.header.model_copy(update={"control": control}))
    root = write_task(bad, tmp_path)
    with pytest.raises(TaskError, match=message) as error:
        load_task(root)
    assert "task.json" in str(error.value)
    assert any(message in problem.detail for problem in validate_files(root).problems)


def test_options_outside_their_domain_are_refused():
    for options in ({"per_house": 0}, {"rates": (0.5,)}, {"rates": (0.5, 0.1)}, {"rates": (0.0, 1.5)}):
        with pytest.raises(InvalidArgumentError, match=next(iter(options))):
            ControlledOptions(**options)


def _bytes(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_a_folder_is_resumed_and_comes_out_the_same(tmp_path):
    houses = tmp_path / "houses.jsonl"
    houses.write_text("\n".join(house.to_json() for house in bundled_houses(3)) + "\n", encoding="utf-8")
    options = PAIRS.model_copy(update={"per_house": 2})
    record, num_new = generate_controlled(houses, tmp_path / "whole", options=options)
    assert num_new == 6
    assert len(record.task_ids) + len(record.rejections) == 6
    assert read_controlled(tmp_path / "whole") == record
    for arm in ("fixed", "evolved"):
        assert tuple(root.name for root in task_roots(tasks_of(tmp_path / "whole", arm))) == record.task_ids
    shutil.copytree(tmp_path / "whole", tmp_path / "part")
    shutil.rmtree(tasks_of(tmp_path / "part", "evolved") / record.task_ids[0])
    (tmp_path / "part" / "controlled.json").unlink()
    assert generate_controlled(houses, tmp_path / "part", options=options) == (record, 1)
    assert _bytes(tmp_path / "part") == _bytes(tmp_path / "whole")
    with pytest.raises(StoreError, match="another configuration"):
        generate_controlled(houses, tmp_path / "part", options=PAIRS)


def test_the_houses_of_tasks_give_the_same_pairs(tmp_path):
    house = next(bundled_houses(1))
    houses = tmp_path / "houses.jsonl"
    houses.write_text(house.to_json() + "\n", encoding="utf-8")
    loaded, _ = generate_controlled(houses, tmp_path / "of-houses", options=PAIRS, limit=1)
    write_task(generate_task(next(bundled_houses(1)), seed=0, config=SMALL), tmp_path / "tasks")
    of_tasks, _ = generate_controlled(tmp_path / "tasks", tmp_path / "of-tasks", options=PAIRS)
    for arm in ("fixed", "evolved"):
        one, other = (
            load_task(tasks_of(tmp_path / name, arm) / record.task_ids[0])
            for name, record in (("of-houses", loaded), ("of-tasks", of_tasks))
        )
        assert one.oracle_stages == other.oracle_stages
        assert one.houses_json == other.houses_json


def test_the_command_says_what_it_made_and_what_is_missing(tmp_path):
    """The house lacks a start and the size of an asset, which options of the command give."""
    runner = CliRunner()
    houses, sizes = tmp_path / "houses.jsonl", tmp_path / "sizes.json"
    document = json.loads(next(bundled_houses(1)).to_json())
    del document["metadata"]["agent"]
    first = document["objects"][0]
    first["assetId"] = "0123456789abcdef"
    houses.write_text(json.dumps(document) + "\n", encoding="utf-8")
    sizes.write_text('{"0123456789abcdef": {"category": "DiningTable", "size_m": [1, 0.7, 1.5]}}')
    config = tmp_path / "small.toml"
    config.write_text("reference_image_px = 64\nreference_min_visible_px = 10\n")
    out = tmp_path / "out"
    command = [
        "controlled",
        "generate",
        "--houses",
        str(houses),
        "--out",
        str(out),
        "--config",
        str(config),
        "--workers",
        "0",
        "--start",
        "auto",
        "--assets",
        str(sizes),
    ]
    made = runner.invoke(app, command, catch_exceptions=False)
    assert "1 task in each arm (fixed, evolved)" in made.output
    for arm in ("fixed", "evolved"):
        (root,) = task_roots(out / "tasks" / arm)
        metadata = json.loads(gzip.decompress((root / "houses/stage_1.json.gz").read_bytes()))["metadata"]
        assert set(metadata["evonav_assets"]) == {"0123456789abcdef"}
        assert metadata["evonav_start"] == "auto"
    with pytest.raises(StoreError, match="another folder"):
        runner.invoke(app, command[:-2], catch_exceptions=False)
    with pytest.raises(StoreError, match="evonav controlled evaluate"):
        runner.invoke(app, ["controlled", "report", str(out)], catch_exceptions=False)
    with pytest.raises(TaskError, match="evonav controlled generate"):
        runner.invoke(app, ["controlled", "evaluate", str(tmp_path)], catch_exceptions=False)
