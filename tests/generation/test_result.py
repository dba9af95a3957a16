"""The core's records against Python's models of them, field by field.

The names in the core's enums are compared in `rust/evonav-core/tests/generation/schema.rs`.
"""

import json
from collections.abc import Iterator
from typing import Any, get_args

import pytest

from evonav import _core
from evonav.generation.result import Anchor, GenerationResult, GivenStage
from evonav.house import House, bundled_houses
from evonav.records import Record
from evonav.tasks.parameters import DuringStage, Extensions, GenerationParameters, Occurrence, Schedule

SMALL = {"reference_image_px": 32, "reference_min_visible_px": 1}
OFTEN = Occurrence(probability=1.0, max_count=8)
CHANGES = Extensions(insertion=OFTEN, removal=OFTEN, doors=OFTEN, openables=OFTEN, switches=OFTEN)
DURING = Extensions(during_stage=DuringStage(probability=1.0, rounds=(1, 9)))
LEFT_OUT = {"during"}
"""Fields that the core leaves out where a task has nothing of the kind."""
PEOPLE = Extensions(schedule=Schedule(num_persons=2, minutes_between_stages=90, tidiness=0.5))


def result_of(house: House, seed: int, parameters: GenerationParameters, *given: GivenStage) -> GenerationResult:
    text, _, _ = _core.generate_task(
        house,
        seed=seed,
        label="test",
        parameters_json=parameters.model_dump_json(),
        allow_unknown_assets=False,
        given_json=json.dumps({"stages": [stage.model_dump() for stage in given]}),
    )
    return GenerationResult.model_validate_json(text)


def records_in(value: object) -> Iterator[Record]:
    """Yield all records in a value."""
    if isinstance(value, Record):
        yield value
        for name in type(value).model_fields:
            yield from records_in(getattr(value, name))
    elif isinstance(value, tuple):
        for one in value:
            yield from records_in(one)


def models_in(model: Any) -> Iterator[type[Record]]:
    """Yield all types of records that a type contains."""
    if isinstance(model, type) and issubclass(model, Record):
        yield model
        for field in model.model_fields.values():
            yield from models_in(field.annotation)
    for part in get_args(model):
        yield from models_in(part)


@pytest.fixture(scope="module")
def records() -> list[Record]:
    """Records of every type, from tasks with and without extensions, and from a house without a task."""
    found: list[Record] = []
    for seed, extensions in enumerate((Extensions(), CHANGES, PEOPLE, DURING)):
        parameters = GenerationParameters(**SMALL, evolve_probability=1.0, extensions=extensions)
        for house in bundled_houses(6):
            found += records_in(result_of(house, seed, parameters))
    unreachable = GenerationParameters(**SMALL | {"reference_min_visible_px": 32 * 32 + 1})
    found += records_in(result_of(next(bundled_houses(1)), 0, unreachable))
    return found


@pytest.mark.slow
def test_the_core_writes_every_record(records: list[Record]) -> None:
    assert {type(record) for record in records} == set(models_in(GenerationResult))


def test_the_core_writes_every_field(records: list[Record]) -> None:
    """Fields that only the core has are refused when its JSON is validated."""
    for record in records:
        if not isinstance(record, GenerationResult):
            assert set(type(record).model_fields) - record.model_fields_set <= LEFT_OUT, type(record)


def test_the_core_writes_every_determiner(records: list[Record]) -> None:
    written = {record.determiner for record in records if isinstance(record, Anchor)}
    assert written == set(get_args(Anchor.model_fields["determiner"].annotation))


def test_the_parameters_have_the_cores_fields_and_defaults() -> None:
    read = GenerationParameters.model_validate_json(_core.default_generation_parameters())
    assert read.model_fields_set == set(GenerationParameters.model_fields)
    assert set(Extensions.model_fields) - read.extensions.model_fields_set == {"during_stage"}
    assert read == GenerationParameters()


def test_given_goals_reach_the_core() -> None:
    house = next(bundled_houses(1))
    parameters = GenerationParameters(**SMALL)
    task = result_of(house, 0, parameters).task
    assert task is not None
    goal_id = task.stages[1].target.id
    given = (GivenStage(goal_id=goal_id), GivenStage(is_evolved=False))
    stages = result_of(house, 0, parameters, *given).task.stages  # type: ignore[union-attr]
    assert stages[0].target.id == goal_id
    assert stages[1].evolution.outcome == "not_triggered"
