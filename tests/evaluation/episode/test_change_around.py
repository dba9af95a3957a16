"""Changes of a house around an agent, wherever it stands: it is never touched or shut in, and the target in reach."""

import json
import math

import numpy as np
import pytest

from evonav import _core
from evonav.evaluation.episode.stage_house import change_around
from evonav.generation import GenerationParameters, generate_task
from evonav.house import House, bundled_houses
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import SimulatorConfig

EXTENSIONS = {
    "during_stage": {"probability": 1.0, "rounds": [1, 9]},
    **{name: {"probability": 0.5, "max_count": 4} for name in ("insertion", "removal", "doors", "openables")},
}
PARAMETERS = {"num_stages": [2], "full_shuffle_probability": 0.5, "extensions": EXTENSIONS}
TOUCH_M = 0.0025


def changing_stages(num_houses):
    """House, change and target of stages during which much moves."""
    config = GenerationParameters.model_validate_json(json.dumps(PARAMETERS))
    houses = [house for house in bundled_houses() if 2 <= len(house.rooms) <= 4][:num_houses]
    for seed, house in enumerate(houses):
        task = generate_task(house, seed=seed, config=config)
        for stage in task.oracle_stages:
            if stage.during is not None:
                yield task.house_json(stage.stage), json.dumps(stage.during.evolution.delta()), stage.target.id


def entries(house_json):
    return {one.id: (one.position_m, one.rotation_deg, one.parent_id) for one in House(house_json).objects}


def placed_ids(delta_json):
    delta = json.loads(delta_json)
    return [one["id"] for name in ("moves", "added") for one in delta[name]] + delta["removed"]


@pytest.fixture(scope="module")
def stages():
    return list(changing_stages(4))


def test_wherever_the_agent_stands_it_stays_free_and_the_target_in_reach(stages):
    config, generator = SimulatorConfig(), np.random.default_rng(0)
    num_skipped, num_whole = 0, 0
    simulator = EmbeddedSimulator(config)
    for house_json, delta_json, target_id in stages:
        before = entries(house_json)
        whole = entries(House(house_json).apply(delta_json).to_json())
        simulator.reset(house_json)
        places_m = simulator.reachable_positions()
        for x_m, y_m, z_m in generator.permutation(places_m)[:12].tolist():
            pose = Pose(x_m, y_m, z_m, 0.0)
            changed_json, skipped = change_around(house_json, delta_json, config, pose, target_id)
            num_skipped, num_whole = num_skipped + bool(skipped), num_whole + (not skipped)
            assert simulator.reset(changed_json, pose) == config.standing(pose)
            found = entries(changed_json)
            for one in placed_ids(delta_json):
                assert found.get(one) == (before if one in skipped else whole).get(one), one
            target = next(body for body in simulator.objects if body.id == target_id)
            reached = simulator.reachable_positions()
            assert min(math.dist((x, z), target.centre_m[::2]) for x, _, z in reached.tolist()) < 1.6
    assert num_skipped >= 3
    assert num_whole > 20


def test_what_stays_overlaps_nothing_that_moves(stages):
    """The house is as sound as with the whole change or with none."""
    config, num_skipped = SimulatorConfig(), 0
    simulator = EmbeddedSimulator(config)
    for house_json, delta_json, target_id in stages[:4]:
        simulator.reset(house_json)
        for x_m, y_m, z_m in simulator.reachable_positions()[::17].tolist():
            changed_json, skipped = change_around(house_json, delta_json, config, Pose(x_m, y_m, z_m, 0.0), target_id)
            if not skipped:
                continue
            num_skipped += 1
            found = json.loads(
                _core.inspect_house(
                    House(house_json), House(changed_json), touch_m=TOUCH_M, rest_m=0.02, allow_unknown_assets=False
                )
            )
            assert not [one for one in found if not one["is_own"]]
    assert num_skipped


def test_nothing_changes_where_the_agent_is_in_the_way_of_all():
    house = next(house for house in bundled_houses() if len(house.rooms) >= 3)
    simulator = EmbeddedSimulator()
    pose = simulator.reset(house)
    item = next(one for one in house.objects if one.parent_id is None and not one.child_ids and one.room_id)
    move = {"id": item.id, "position_m": (pose.x_m, item.position_m[1], pose.z_m), "rotation_deg": item.rotation_deg}
    delta_json = json.dumps({"moves": [{**move, "parent": None}]})
    changed_json, skipped = change_around(house.to_json(), delta_json, simulator.config, pose, item.id)
    assert skipped == (item.id,)
    assert entries(changed_json) == entries(house.to_json())
