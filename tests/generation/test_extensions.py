"""What goes beyond the paper, from options to tasks that validate and can be evaluated."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from evonav.cli import app
from evonav.evaluation.records.oracle import transition_record
from evonav.generation import GenerationParameters, generate_task
from evonav.generation.validation import validate_task
from evonav.house import House, bundled_houses
from evonav.tasks import Task, load_tasks

OFTEN = {"probability": 1.0, "max_count": 4}
ALL: dict[str, object] = dict.fromkeys(("insertion", "removal", "doors", "openables", "switches"), OFTEN)
PEOPLE: dict[str, object] = {"schedule": {"num_persons": 4, "minutes_between_stages": 240, "tidiness": 0.8}}


@pytest.fixture(scope="module")
def house() -> House:
    return next(house for house in bundled_houses() if len(house.rooms) >= 5)


def task_of(house: House, extensions: dict[str, object], seed: int = 3) -> Task:
    values = {"num_stages": [7], "evolve_probability": 0.5, "extensions": extensions}
    return generate_task(house, seed=seed, config=GenerationParameters.model_validate_json(json.dumps(values)))


@pytest.mark.parametrize("extensions", [ALL, PEOPLE], ids=["all", "people"])
def test_extended_tasks_are_valid_and_say_what_happened(house: House, extensions: dict[str, object]) -> None:
    task = task_of(house, extensions)
    assert len(task.oracle_stages) == 7
    assert set(task.header.parameters.extensions.model_dump(exclude_none=True)) == set(extensions)
    report = validate_task(task)
    assert not report.problems, report.problems[:3]
    kinds = [transition_record(oracle.evolution).kind for oracle in task.oracle_stages]
    assert kinds[0] == "static"
    expected = "activities" if extensions is PEOPLE else "extensions"
    assert expected in kinds[1:]
    before = {entry.id for entry in house.objects}
    for oracle in task.oracle_stages:
        evolution = oracle.evolution
        before = before | {one.id for one in evolution.additions}
        before = before - {one.id for one in evolution.removals}
        assert {entry.id for entry in House(task.house_json(oracle.stage), name=task.task_id).objects} == before
        assert oracle.target.id in before
        assert (evolution.clock_min is not None) == (extensions is PEOPLE)


def test_without_extensions_nothing_of_them_is_recorded(house: House) -> None:
    for oracle in task_of(house, {}).oracle_stages:
        evolution = oracle.evolution
        assert evolution.additions == evolution.removals == evolution.states == evolution.activities == ()
        assert {change.cause for change in evolution.changes} <= {evolution.mode}


def test_the_command_takes_parameters_from_a_file_and_options(tmp_path: Path, house: House) -> None:
    houses, config, out = tmp_path / "houses.json", tmp_path / "theta.toml", tmp_path / "tasks"
    houses.write_text(house.to_json())
    config.write_text("evolve_probability = 0.25\nextensions.removal = {probability = 1.0, max_count = 3}\n")
    arguments = ["tasks", "generate", "--houses", str(houses), "--config", str(config), "--workers", "0"]
    done = CliRunner().invoke(app, [*arguments, "--num-stages", "6", "--out", str(out)])
    assert done.exit_code == 0, done.output
    (task,) = load_tasks(out)
    parameters = task.header.parameters
    assert (parameters.evolve_probability, parameters.num_stages) == (0.25, (6,))
    assert parameters.extensions.removal is not None
    assert len(task.oracle_stages) == 6
    refused = CliRunner().invoke(app, [*arguments, "--num-stages", "0", "--out", str(tmp_path / "none")])
    assert refused.exit_code != 0
    assert "num_stages" in refused.output + str(refused.exception)
