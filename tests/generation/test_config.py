"""Θ from files and options."""

from pathlib import Path

import pytest

from evonav.errors import InvalidArgumentError, TaskError
from evonav.generation.config import read_parameters
from evonav.tasks.parameters import Extensions, GenerationParameters, Occurrence, Schedule

THETA = """
evolve_probability = 0.25
num_stages = [6]
[extensions]
insertion = {probability = 0.5, max_count = 3}
schedule = {num_persons = 2, minutes_between_stages = 90, tidiness = 0.8}
"""


def test_without_anything_it_is_the_papers() -> None:
    assert read_parameters() == GenerationParameters()
    assert GenerationParameters().extensions == Extensions()
    assert not any(Extensions().model_dump().values())


def test_a_file_gives_some_fields_and_options_win(tmp_path: Path) -> None:
    path = tmp_path / "theta.toml"
    path.write_text(THETA)
    read = read_parameters(path)
    assert (read.evolve_probability, read.num_stages) == (0.25, (6,))
    assert read.extensions.insertion == Occurrence(probability=0.5, max_count=3)
    assert read.extensions.schedule == Schedule(num_persons=2, minutes_between_stages=90, tidiness=0.8)
    assert read.extensions.removal is None
    assert read.visited_factor == GenerationParameters().visited_factor
    won = read_parameters(path, evolve_probability=1.0, num_stages="6,8")
    assert (won.evolve_probability, won.num_stages, won.extensions) == (1.0, (6, 8), read.extensions)


def test_the_literal_reading_differs_in_four_values() -> None:
    literal, ours = read_parameters(Path(__file__).parents[2] / "examples" / "literal.toml"), GenerationParameters()
    values = {name: (getattr(ours, name), getattr(literal, name)) for name in GenerationParameters.model_fields}
    differing = {name: pair for name, pair in values.items() if pair[0] != pair[1]}
    assert differing == {
        "changed_room_window": (1, 2),
        "goal_room_window": (1, 2),
        "moved_children_multiplier": (9.0, 1.0),
        "goals_on_walls": (False, True),
    }


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("evolve_probability = 2.0", "evolve_probability"),
        ("evolve_probability = inf", "evolve_probability"),
        ("evolve_probability = 2020-01-01", "evolve_probability"),
        ("evolve_probabilty = 0.5", "evolve_probabilty"),
        ("num_stages = []", "num_stages"),
        ("extensions.removal = {probability = 0.5, max_count = 0}", r"extensions\.removal\.max_count"),
        ("extensions.doors = {probability = -0.5, max_count = 1}", r"extensions\.doors\.probability"),
        ("extensions.people = 1", r"extensions\.people"),
    ],
)
def test_bad_values_are_named(tmp_path: Path, text: str, place: str) -> None:
    path = tmp_path / "theta.toml"
    path.write_text(text)
    with pytest.raises(TaskError, match=rf"theta\.toml: {place} = "):
        read_parameters(path)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("theta.toml", r"theta\.toml: not TOML"),
        ("theta.json", r"theta\.json: expected TOML"),
        ("nothing.toml", r"nothing\.toml: cannot be read: No such file"),
    ],
)
def test_a_file_that_is_not_toml_is_named(tmp_path: Path, name: str, message: str) -> None:
    if name.startswith("theta"):
        (tmp_path / name).write_text("evolve_probability = = 1")
    with pytest.raises(InvalidArgumentError, match=message):
        read_parameters(tmp_path / name)


@pytest.mark.parametrize("options", [{"evolve_probability": 1.5}, {"num_stages": "3,x"}, {"num_stages": "0"}])
def test_bad_options_are_named(options: dict[str, object]) -> None:
    with pytest.raises(InvalidArgumentError, match=next(iter(options))):
        read_parameters(**options)  # type: ignore[arg-type]
