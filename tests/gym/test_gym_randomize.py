"""Domain randomisation: a look for each episode, decided by the seed."""

import gymnasium
import numpy as np
import pytest

from evonav.errors import InvalidArgumentError
from evonav.gym import ENV_ID, VectorEnv

SMALL = {"width_px": 32, "height_px": 24, "observations": ("rgb", "depth"), "style": "default"}
TASK = {"task": "bundled-0084-812ff1-s0"}


def _make(**settings) -> gymnasium.Env:
    return gymnasium.make(ENV_ID, **(SMALL | settings))


def _first(env: gymnasium.Env, seed: int | None) -> dict[str, np.ndarray]:
    return env.reset(seed=seed, options=TASK)[0]


@pytest.mark.parametrize("randomize", [("materials",), ("lighting",), ("colors",), ("materials", "lighting", "colors")])
def test_a_seed_gives_one_look_and_another_seed_another(randomize: tuple[str, ...]) -> None:
    env, again, plain = _make(randomize=randomize), _make(randomize=randomize), _make()
    first, other, own = _first(env, 3), _first(env, 4), _first(plain, 3)
    np.testing.assert_array_equal(_first(again, 3)["rgb"], first["rgb"])
    for frame in (other, own):
        assert (frame["rgb"] != first["rgb"]).any(axis=-1).mean() > 0.3
        np.testing.assert_array_equal(frame["depth"], first["depth"])


def test_every_episode_has_a_look_of_its_own_which_its_stages_share() -> None:
    env = _make(randomize=("materials",), max_steps=1)
    looks = [_first(env, 5)["rgb"]]
    stages = 1
    while True:
        observation, _, is_over, _, _ = env.step(3)
        if is_over:
            break
        stages += 1
        # The agent has not moved, so what did not change in the house looks the same in the next stage.
        assert (observation["rgb"] == looks[0]).all(axis=-1).mean() > 0.3
    assert stages > 1
    looks.append(_first(env, None)["rgb"])
    assert (looks[0] != looks[1]).any(axis=-1).mean() > 0.3


def test_tasks_are_drawn_as_without_looks() -> None:
    tasks = [
        [env.reset(seed=8)[1]["task_id"], *(env.reset()[1]["task_id"] for _ in range(3))]
        for env in (_make(), _make(randomize=("materials", "colors")))
    ]
    assert tasks[0] == tasks[1]


def test_an_unknown_thing_to_randomise_is_named() -> None:
    with pytest.raises(
        InvalidArgumentError,
        match=r"argument randomize\.0 = 'texture': Input should be 'materials'",
    ):
        VectorEnv(randomize=("texture",))
