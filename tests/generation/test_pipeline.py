import json
import re
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from importlib.resources import as_file, files
from pathlib import Path

import pytest
from build_tasks import build_tasks
from generated_tasks import generated_tasks

from evonav.errors import HouseError, InvalidArgumentError, TaskError
from evonav.generation import (
    GenerationParameters,
    TaskRejectedError,
    generate_task,
    write_task,
)
from evonav.house import House, bundled_houses
from evonav.tasks import Task, load_tasks
from evonav.tasks.language import COLOURS, MATERIALS, SHAPES, SIZES, noun_of, plural_of, with_article


@pytest.fixture(scope="module")
def houses() -> list[House]:
    return list(bundled_houses(16))


@pytest.fixture(scope="module")
def tasks(houses: list[House]) -> list[Task]:
    return list(generated_tasks(houses, 0))


def bytes_of(directory: Path) -> dict[str, bytes]:
    return {str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def test_the_same_seed_writes_the_same_bytes_on_any_number_of_threads(houses: list[House], tmp_path: Path) -> None:
    for num_threads in (1, 3):
        with ThreadPoolExecutor(num_threads) as pool:
            # Other order of work, same files.
            ordered = houses if num_threads == 1 else houses[::-1]
            for task in pool.map(partial(generate_task, seed=7), ordered):
                write_task(task, tmp_path / str(num_threads))
    assert bytes_of(tmp_path / "1") == bytes_of(tmp_path / "3")


def test_the_draws_follow_contents_and_seed_not_the_name(houses: list[House]) -> None:
    one, other = houses[0], House(houses[0].to_json(), name="elsewhere.json")
    assert generate_task(one, seed=1).oracle_stages == generate_task(other, seed=1).oracle_stages
    assert generate_task(one, seed=1).oracle_stages != generate_task(one, seed=2).oracle_stages


def test_a_house_without_a_task_says_why(houses: list[House]) -> None:
    document = json.loads(houses[0].to_json())
    without_start = {**document, "metadata": {}}
    unknown = json.loads(json.dumps(document))
    unknown["objects"][0]["assetId"] = "no_such_asset"
    broken = [House(json.dumps(wrong), name=name) for name, wrong in (("a", without_start), ("b", unknown))]
    with pytest.raises(TaskRejectedError, match=r"a: no_start at stage 0") as caught:
        generate_task(broken[0], seed=0)
    assert isinstance(caught.value, TaskError)
    assert caught.value.reason == "no_start"
    with pytest.raises(HouseError, match="no_such_asset"):
        generate_task(broken[1], seed=0)


def test_goal_rooms_within_the_window_are_less_likely(houses: list[House]) -> None:
    config = GenerationParameters(num_stages=(5,), previous_goal_room_multiplier=0.0, goal_room_window=2)
    large = [house for house in houses if len(house.rooms) >= 4]
    tasks = []
    for house in large:
        with suppress(TaskRejectedError):
            tasks.append(generate_task(house, seed=0, config=config))
    assert len(tasks) >= 3
    for task in tasks:
        rooms = [stage.target.room_id for stage in task.oracle_stages]
        assert all(room not in rooms[max(0, k - 2) : k] for k, room in enumerate(rooms)), rooms


def test_a_bad_parameter_is_named(houses: list[House]) -> None:
    config = GenerationParameters(reference_min_m=3.0)
    with pytest.raises(InvalidArgumentError, match="reference_max_m"):
        generate_task(houses[0], seed=0, config=config)


NOUN = r"[a-zA-Z]+(?: [a-zA-Z]+)*?"
THING = rf"(?:the|an?|some) {NOUN}"
PLACE = (
    rf"(?: in (?:the (?P<room>{NOUN})|one of the (?P<rooms>{NOUN})))?"
    rf"(?: (?P<how>on|in) (?P<support>(?!a corner){THING}))?"
    rf"(?: next to (?P<first>{THING})(?: and (?P<second>{THING}))?)?"
    rf",?(?: (?P<where>near the window|near a window|near the doorway|near a doorway|in a corner))?"
    rf"(?: ?and)?(?: (?P<below>below|near))?(?: (?P<wall>{THING}))?\."
)
GRAMMAR = re.compile(rf"Please navigate to the (?P<target>{NOUN}){PLACE}")


def test_instructions_follow_the_grammar_and_are_true(tasks: list[Task]) -> None:
    num_supported = num_looks = 0
    for task in tasks:
        for stage in range(1, task.num_stages + 1):
            public, target = task.public(stage), task.oracle(stage).target
            house = House(task.house_json(stage), name="stage")
            objects = {entry.id: entry for entry in house.objects}
            parsed = GRAMMAR.fullmatch(public.basic_instruction)
            assert parsed, public.basic_instruction
            noun = noun_of(target.category)
            assert parsed["target"] == noun
            is_unique = [entry.category for entry in house.objects].count(target.category) == 1
            room_type = next(room for room in house.rooms if room.id == target.room_id).room_type
            is_only_room = [room.room_type for room in house.rooms].count(room_type) == 1
            assert parsed["room"] == (noun_of(room_type) if is_only_room and not is_unique else None)
            assert parsed["rooms"] == (None if is_only_room or is_unique else plural_of(noun_of(room_type)))
            in_room = Counter(
                noun_of(entry.category or "") for entry in house.objects if entry.room_id == target.room_id
            )
            words = [plural_of(other) if form == "some" else other for other in in_room for form in ("the", "some")]
            if target.support_id is None:
                assert parsed["support"] is None
            else:
                num_supported += 1
                support = noun_of(objects[target.support_id].category or "")
                assert parsed["support"] == (f"the {support}" if in_room[support] == 1 else with_article(support))
            for anchor in (parsed["first"], parsed["second"], parsed["wall"]):
                if anchor is None:
                    continue
                article, other = anchor.split(" ", 1)
                assert other in words
                assert article != "the" or in_room[other] == 1
                assert other != noun
            looks = public.appearance_instruction.removeprefix("Please navigate to the ").removesuffix(".")
            place = public.basic_instruction.removeprefix(f"Please navigate to the {noun}").removesuffix(".")
            assert public.unified_instruction == f"Please navigate to the {looks}{place}."
            before, details = re.fullmatch(rf"(?:(.*) )?{noun}(?: with (.*))?", looks).groups()
            said = (before or "").replace(" and ", " ").split()
            num_looks += bool(said)
            assert set(said) <= {*SIZES, *SHAPES, *COLOURS, *MATERIALS.values()}
            assert details is None or not re.search(r"[^a-z ,-]", details)
    assert num_supported > 10
    assert num_looks > 40


@pytest.mark.slow
def test_transitions_and_modes_are_drawn_as_the_paper_says(houses: list[House]) -> None:
    """About 500 transitions: 50% evolve; of these 50/40/10% by mode; bounds of three standard deviations and more."""
    outcomes: Counter[str] = Counter()
    modes: Counter[str] = Counter()
    lengths: Counter[int] = Counter()
    small = sorted(houses, key=lambda house: len(house.objects))[:9]
    for seed in range(20):
        for task in generated_tasks(small, seed):
            lengths[task.num_stages] += 1
            for stage in task.oracle_stages[1:]:
                outcomes[stage.evolution.outcome] += 1
                if stage.evolution.mode is not None:
                    modes[stage.evolution.mode] += 1
    num_transitions = sum(outcomes.values())
    assert num_transitions > 450
    assert abs(outcomes["not_triggered"] / num_transitions - 0.5) < 0.07
    assert outcomes["no_room"] + outcomes["no_placement"] <= 0.01 * num_transitions
    num_modes = sum(modes.values())
    for mode, share in {"SALIENT_OBJECT": 0.5, "RETAIN_GROUP": 0.4, "FULL_SHUFFLE": 0.1}.items():
        assert abs(modes[mode] / num_modes - share) < 0.1, modes
    assert set(lengths) == {3, 4, 5}
    assert min(lengths.values()) > 0.25 * sum(lengths.values())


def test_bundled_tasks_are_what_the_script_makes() -> None:
    """Headers hold the checksums of all else."""
    made = {task.task_id: task for task in build_tasks()}
    with as_file(files("evonav") / "data" / "tasks") as directory:
        there = {task.task_id: task for task in load_tasks(directory)}
        assert made.keys() == there.keys()
        assert len(there) >= 24
        differing = [task_id for task_id, task in there.items() if task.header != made[task_id].header]
        assert not differing, "run scripts/data/build_tasks.py"
        assert {task.header.house.num_rooms for task in there.values()} >= {2, 3, 4, 5, 6, 7, 8, 10}


def test_bundled_tasks_are_small() -> None:
    with as_file(files("evonav") / "data" / "tasks") as directory:
        assert sum(path.stat().st_size for path in directory.rglob("*") if path.is_file()) < 7_500_000
