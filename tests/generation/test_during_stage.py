"""Changes during stages, in generation: valid tasks that stay feasible, and nothing else changes."""

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from evonav.controlled.layout import ControlledOptions
from evonav.errors import InvalidArgumentError
from evonav.evaluation.records.oracle import during_record, target_record
from evonav.generation import GenerationParameters, generate_task
from evonav.generation.statistics.compute import statistics_of
from evonav.generation.statistics.task_summary import TaskSummary, summary_of
from evonav.generation.validation import validate_task
from evonav.gym.sources import FolderTasks
from evonav.house import House, bundled_houses
from evonav.tasks import Task
from evonav.tasks.files import load_task, write_task

ALWAYS = {"probability": 1.0, "rounds": [2, 9]}


@pytest.fixture(scope="module")
def house() -> House:
    return next(house for house in bundled_houses() if len(house.rooms) >= 5)


def task_of(house: House, seed: int = 3, **extensions: object) -> Task:
    values = {"num_stages": [4], "evolve_probability": 0.5, "extensions": extensions}
    return generate_task(house, seed=seed, config=GenerationParameters.model_validate_json(json.dumps(values)))


@pytest.fixture(scope="module")
def changing(house: House) -> Task:
    return task_of(house, during_stage=ALWAYS)


def test_the_house_changes_in_a_round_of_the_range_and_the_task_is_valid(changing: Task) -> None:
    report = validate_task(changing)
    assert not report.problems, report.problems[:3]
    during = [stage.during for stage in changing.oracle_stages if stage.during is not None]
    assert len(during) == 4
    assert all(2 <= one.round <= 9 and one.evolution.outcome == "evolved" for one in during)
    assert len({one.round for one in during}) > 1


def _summary(task: Task) -> TaskSummary:
    return summary_of(task.header, task.oracle_stages, task.public_stages, task.house_json(1))


def test_statistics_count_changes_during_stages(house: House, changing: Task) -> None:
    tasks = (changing, task_of(house, during_stage={"probability": 0.0, "rounds": [2, 9]}))
    found = statistics_of(map(_summary, tasks))
    during = [stage.during for stage in changing.oracle_stages if stage.during is not None]
    num_moved = sum(one.is_target_relocated for one in during)
    assert (found.metric("during").n, found.metric("during_target").n) == (8, 4)
    shares = [found.metric(key).raw for key in ("during", "during_target")]
    assert [None if one is None else one.value for one in shares] == [0.5, num_moved / 4]
    modes, rounds = found.distribution("during_modes"), found.quantity("during_round")
    assert modes is not None
    assert dict(zip(modes.names, modes.counts, strict=True)) == Counter(one.evolution.mode for one in during)
    assert rounds is not None
    assert rounds.mean == pytest.approx(sum(one.round for one in during) / 4)
    never = statistics_of([_summary(task_of(house))])
    assert never.metric("during").raw is None
    assert never.distribution("during_modes") is None


def test_later_stages_start_from_the_house_after_the_change(changing: Task) -> None:
    for stage in changing.oracle_stages[1:]:
        if stage.evolution.outcome != "evolved":
            assert changing.house_json(stage.stage) == changing.house_json_at_end(stage.stage - 1)
            assert changing.house_json(stage.stage) != changing.house_json(stage.stage - 1)


def test_an_object_that_moved_during_a_stage_has_been_relocated_in_later_ones(changing: Task) -> None:
    moved = {i for stage in changing.oracle_stages[:2] for i in stage.during.evolution.relocated_ids if stage.during}
    assert moved <= set(changing.oracle(3).ever_relocated_ids)
    for stage in changing.oracle_stages:
        was_moved = stage.target.id in {i for one in changing.evolutions_before(stage.stage) for i in one.relocated_ids}
        assert target_record(changing, stage.stage).is_relocated == was_moved


def test_with_the_extension_off_a_task_is_what_it_was(house: House) -> None:
    off, never = task_of(house), task_of(house, during_stage={"probability": 0.0, "rounds": [2, 9]})
    assert off.header.parameters.extensions.during_stage is None
    assert off.contents == never.contents
    assert all(off.oracle(stage).during is None for stage in range(1, off.num_stages + 1))
    for name, data in off.contents.items():
        told = [line.strip() for line in data.splitlines() if b"during" in line]
        assert told == ([b'"during": null'] if name.startswith("oracle/") else []), name


def test_the_first_stage_and_its_goal_do_not_depend_on_it(house: House, changing: Task) -> None:
    off = task_of(house)
    assert off.public_stages[0] == changing.public_stages[0]
    assert off.oracle(1) == changing.oracle(1).model_copy(update={"during": None})


def test_it_goes_together_with_the_other_extensions(house: House) -> None:
    often = {"probability": 1.0, "max_count": 3}
    names = ("insertion", "removal", "doors", "openables", "switches")
    task = task_of(house, during_stage=ALWAYS, **dict.fromkeys(names, often))
    report = validate_task(task)
    assert not report.problems, report.problems[:3]
    during = [stage.during for stage in task.oracle_stages if stage.during is not None]
    assert any(one.evolution.additions for one in during)
    assert any(one.evolution.states for one in during)
    for stage in task.oracle_stages:
        assert stage.target.id not in {one.id for one in stage.during.evolution.removals if stage.during}
        record = during_record(stage)
        assert record is not None
        assert record.at_round is None


def test_it_is_read_as_it_was_written(changing: Task, tmp_path: Path) -> None:
    found = load_task(write_task(changing, tmp_path))
    assert found.oracle_stages == changing.oracle_stages
    assert found.contents == changing.contents


def test_another_delta_or_target_is_a_problem(changing: Task) -> None:
    stage = changing.oracle(1)
    during = stage.during
    assert during is not None
    first, *rest = during.evolution.changes
    x_m, y_m, z_m = first.to_position_m
    shifted = first.model_copy(update={"to_position_m": (x_m + 0.3, y_m, z_m)})
    evolution = during.evolution.model_copy(update={"changes": (shifted, *rest)})
    forgeries = {
        "evolution": evolution,
        "target_position_m": (x_m + 1.0, y_m, z_m),
        "reference_pose": stage.start_pose,
    }
    for field, value in forgeries.items():
        forged = stage.model_copy(update={"during": during.model_copy(update={field: value})})
        task = replace(changing, oracle_stages=(forged, *changing.oracle_stages[1:]))
        assert [problem for problem in validate_task(task).problems if problem.stage == 1], field


@pytest.mark.parametrize(
    ("extensions", "field"),
    [
        ({"during_stage": {"probability": 0.5, "rounds": [9, 2]}}, r"during_stage\.rounds\[1\]"),
        (
            {
                "during_stage": ALWAYS,
                "schedule": {"num_persons": 2, "minutes_between_stages": 60, "tidiness": 0.5},
            },
            r"extensions\.during_stage` is on, expected no schedule",
        ),
    ],
)
def test_bad_parameters_are_named(house: House, extensions: dict[str, object], field: str) -> None:
    with pytest.raises(InvalidArgumentError, match=field):
        task_of(house, **extensions)


def test_gymnasium_and_controlled_arms_say_that_they_do_not_take_it(changing: Task, tmp_path: Path) -> None:
    write_task(changing, tmp_path)
    with pytest.raises(InvalidArgumentError, match=r"extension `during_stage`\), which Gymnasium does not play"):
        FolderTasks(tmp_path).task(0)
    with pytest.raises(InvalidArgumentError, match=r"parameters\.extensions\.during_stage is on"):
        ControlledOptions(parameters=changing.header.parameters)
