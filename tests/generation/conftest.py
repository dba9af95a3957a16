"""Fixtures of the tests of generation."""

import shutil
from pathlib import Path

import pytest
from generated_folder import OPTIONS, write_houses

from evonav.generation import GenerationParameters, generate_task
from evonav.generation.dataset import generate_dataset
from evonav.house import bundled_houses
from evonav.tasks import write_task


@pytest.fixture(scope="session")
def sound_task(tmp_path_factory: pytest.TempPathFactory) -> Path:
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
def root(sound_task: Path, tmp_path: Path) -> Path:
    """A copy of the sound task, to be damaged."""
    return Path(shutil.copytree(sound_task, tmp_path / sound_task.name))


@pytest.fixture(scope="session")
def house_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten small houses, of which two give no task."""
    return write_houses(tmp_path_factory.mktemp("houses") / "small.jsonl", 8)


@pytest.fixture(scope="session")
def clean_folder(house_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of an uninterrupted run in one process."""
    out = tmp_path_factory.mktemp("clean")
    generate_dataset(house_file, out, options=OPTIONS)
    return out


@pytest.fixture(scope="session")
def large_house_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """52 small houses, of which two give no task."""
    return write_houses(tmp_path_factory.mktemp("many") / "small.jsonl", 50)
