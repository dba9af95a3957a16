"""Θ from files and options."""

import json
from pathlib import Path

import pytest

from evonav.errors import InvalidArgumentError, TaskError
from evonav.generation.config import read_parameters
from evonav.tasks.extensions import Extensions, Occurrence, Schedule
from evonav.tasks.manifest import GenerationParameters

EXTENSIONS = {
    "insertion": {"probability": 0.5, "max_count": 3},
    "schedule": {"num_persons": 2, "minutes_between_stages": 90, "tidiness": 0.8},
}


def test_without_anything_it_is_the_papers() -> None:
    assert read_parameters() == GenerationParameters()
    assert GenerationParameters().extensions == Extensions()
    assert not any(Extensions().model_dump().values())


def test_a_file_gives_some_fields_and_options_win(tmp_path: Path) -> None:
    path = tmp_path / "theta.json"
    path.write_text(json.dumps({"evolve_probability": 0.25, "num_stages": [6], "extensions": EXTENSIONS}))
    read = read_parameters(path)
    assert (read.evolve_probability, read.num_stages) == (0.25, (6,))
    assert read.extensions.insertion == Occurrence(probability=0.5, max_count=3)
    assert read.extensions.schedule == Schedule(num_persons=2, minutes_between_stages=90, tidiness=0.8)
    assert read.extensions.removal is None
    assert read.visited_factor == GenerationParameters().visited_factor
    won = read_parameters(path, evolve_probability=1.0, num_stages="6,8")
    assert (won.evolve_probability, won.num_stages, won.extensions) == (1.0, (6, 8), read.extensions)


def test_toml_says_the_same_as_json(tmp_path: Path) -> None:
    path = tmp_path / "theta.toml"
    path.write_text(
        "evolve_probability = 0.25\nnum_stages = [6]\n"
        "[extensions.insertion]\nprobability = 0.5\nmax_count = 3\n"
        "[extensions.schedule]\nnum_persons = 2\nminutes_between_stages = 90\ntidiness = 0.8\n"
    )
    twin = tmp_path / "theta.json"
    twin.write_text(json.dumps({"evolve_probability": 0.25, "num_stages": [6], "extensions": EXTENSIONS}))
    assert read_parameters(path) == read_parameters(twin)
    path.write_text("evolve_probability = = 1")
    with pytest.raises(TaskError, match=r"theta\.toml: no TOML"):
        read_parameters(path)


@pytest.mark.parametrize(
    ("fields", "place"),
    [
        ({"evolve_probability": 2.0}, "evolve_probability"),
        ({"evolve_probabilty": 0.5}, "evolve_probabilty"),
        ({"num_stages": []}, "num_stages"),
        ({"extensions": {"removal": {"probability": 0.5, "max_count": 0}}}, r"extensions\.removal\.max_count"),
        ({"extensions": {"doors": {"probability": -0.5, "max_count": 1}}}, r"extensions\.doors\.probability"),
        ({"extensions": {"people": None}}, r"extensions\.people"),
    ],
)
def test_bad_values_are_named(tmp_path: Path, fields: dict[str, object], place: str) -> None:
    path = tmp_path / "theta.json"
    path.write_text(json.dumps(fields))
    with pytest.raises(TaskError, match=rf"theta\.json: field `{place}`"):
        read_parameters(path)


@pytest.mark.parametrize("options", [{"evolve_probability": 1.5}, {"num_stages": "3,x"}, {"num_stages": "0"}])
def test_bad_options_are_named(options: dict[str, object]) -> None:
    with pytest.raises(InvalidArgumentError, match=next(iter(options))):
        read_parameters(**options)  # type: ignore[arg-type]


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(TaskError, match=r"nothing\.json: cannot be read"):
        read_parameters(tmp_path / "nothing.json")
