"""Environments on houses: tasks are generated as they are chosen, and are the same for the same seed."""

from itertools import islice
from pathlib import Path

import gymnasium
import pytest

import evonav.gym
from evonav.errors import InvalidArgumentError, TaskError
from evonav.generation.pipeline import generate_task
from evonav.gym.sources import HouseTasks
from evonav.house import House, stream_houses
from evonav.house.files import HouseTexts
from evonav.house.generated import SPLIT_SEEDS, house_maker, make_houses

SMALL = {"observations": ("depth", "pose", "category"), "width_px": 32, "height_px": 32, "max_steps": 3}


def ids(env: gymnasium.Env, count: int) -> list[str]:
    return [env.reset(seed=5 if number == 0 else None)[1]["task_id"] for number in range(count)]


def test_episodes_are_in_ever_new_houses_and_follow_from_the_seed() -> None:
    one, again = (gymnasium.make(evonav.gym.ENV_ID, houses="endless:train", **SMALL) for _ in range(2))
    found = ids(one, 4)
    assert found == ids(again, 4)
    assert len({task.split("-s")[0] for task in found}) == 4
    assert all(task.startswith("endless-train-") for task in found)
    one.close()
    again.close()


def test_a_chosen_house_gives_the_task_that_the_generator_gives_it() -> None:
    source = HouseTasks("endless:7")
    house = next(house for house in islice(stream_houses("endless:7"), 9) if len(house.rooms) > 2)
    number = source.find(house.name)
    assert source.task(number).task_id == generate_task(house, seed=number).task_id
    env = gymnasium.make(evonav.gym.ENV_ID, houses="endless:7", **SMALL)
    assert env.reset(options={"task": house.name})[1]["task_id"] == source.task(number).task_id
    for wrong in ("endless:8:1", "endless:7:0", "endless:7", "bundled-1"):
        with pytest.raises(InvalidArgumentError, match="expected a house, such as 'endless:7:3'"):
            env.reset(options={"task": wrong})
    env.close()


def test_houses_without_a_task_are_passed_over() -> None:
    source = HouseTasks("endless:7")
    single = next(number for number in range(99) if len(House(source._house(number).text).rooms) == 1)
    assert source.task(single).header.house.num_rooms > 1
    first = next(number for number in range(99) if len(House(source._house(number).text).rooms) == 1)
    only = HouseTasks(f"endless:7:{first + 1}")
    with pytest.raises(TaskError, match=r"200 houses in a row give no task.*too_few_rooms"):
        only.task(0)


def test_houses_of_a_file_are_drawn_with_ever_new_tasks(tmp_path: Path) -> None:
    make_houses(tmp_path / "houses.jsonl", 2, seed=7)
    env = gymnasium.make(evonav.gym.ENV_ID, houses=tmp_path / "houses.jsonl", **SMALL)
    assert len(set(ids(env, 4))) == 4
    env.close()


def test_splits_have_their_assets_and_floor_plans_of_their_own() -> None:
    found = {split: HouseTexts(f"endless:{split}:1") for split in SPLIT_SEEDS}
    texts = {split: next(iter(texts)) for split, texts in found.items()}
    for split, (name, text) in texts.items():
        assert name == f"endless:{split}:1"
        assert text == house_maker(f'{{"split": "{split}"}}').make(SPLIT_SEEDS[split], 0)
    assert len({texts.checksums()[0][1] for texts in found.values()}) == 3


def test_folder_and_houses_exclude_each_other() -> None:
    for other in ({"tasks": "tasks"}, {"subset": "train-90"}):
        with pytest.raises(InvalidArgumentError, match="beside houses"):
            gymnasium.make(evonav.gym.ENV_ID, houses="endless:7", **other)
    with pytest.raises(InvalidArgumentError, match=r"endless:tran: expected endless:SEED.*train, val, test"):
        gymnasium.make(evonav.gym.ENV_ID, houses="endless:tran")
