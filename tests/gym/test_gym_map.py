"""The map of `render`: what it shows, that it is fast and the same every time, and that only it shows the target."""

import time
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env, data_equivalence

from evonav.errors import InvalidArgumentError
from evonav.gym import ENV_ID, OBSERVATIONS, LifelongNavEnv, VectorEnv
from evonav.gym.map_view import BLUE, GOLD

MAP = {"render_mode": "rgb_array", "render_view": "map", "width_px": 32, "height_px": 24}
AHEAD, LEFT, STOP = 0, 1, 3


def _map_env(**settings):
    return LifelongNavEnv(**({"observations": ("pose",)} | MAP | settings))


def _num_pixels(picture, colour):
    return int((picture == colour).all(axis=2).sum())


def _centre(picture, colour):
    """Column and row of the middle of all pixels of a colour."""
    rows, cols = np.nonzero((picture == colour).all(axis=2))
    return cols.mean(), rows.mean()


def test_gymnasiums_checker_finds_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(ENV_ID, **MAP).unwrapped)


def test_gymnasiums_wrappers_take_the_map():
    env = gymnasium.make(ENV_ID, **(MAP | {"render_mode": "rgb_array_list", "map_px": 64}))
    env.reset(seed=0)
    env.step(LEFT)
    assert [picture.shape for picture in env.render()] == [(64, 64, 3)] * 2
    seen, _ = gymnasium.wrappers.AddRenderObservation(_map_env(map_px=64)).reset(seed=0)
    assert (seen.shape, seen.dtype) == ((64, 64, 3), np.uint8)


def test_the_map_shows_the_agent_and_the_target_where_they_are():
    env = _map_env(oracle_info=True, observations=("pose",), hfov_deg=10.0)
    for seed in range(3):
        _, info = env.reset(seed=seed)
        picture = env.render()
        assert (picture.shape, picture.dtype) == ((400, 400, 3), np.uint8)
        pose = env._batch._pose(0)
        x, y = _centre(picture, BLUE)
        target_x, target_y = _centre(picture, GOLD)
        target_m = info["oracle"]["target_m"]
        px_per_m = (target_x - x) / (target_m[0] - pose.x_m)
        assert (y - target_y) / px_per_m == pytest.approx(target_m[1] - pose.z_m, abs=0.15)


def test_the_path_grows_and_a_new_stage_begins_another():
    env = _map_env(max_steps=12)
    env.reset(seed=0)
    started = _num_pixels(env.render(), BLUE)
    for step in range(11):
        env.step(LEFT if step < 2 else AHEAD)
    walked = _num_pixels(env.render(), BLUE)
    assert walked > started + 50
    _, _, _, _, info = env.step(LEFT)
    assert info["stage"] == 2
    assert _num_pixels(env.render(), BLUE) == pytest.approx(started, abs=8)


@pytest.mark.parametrize("mode", ["actions", "waypoints"])
def test_the_map_is_the_same_however_often_it_was_drawn(mode):
    often, once = (_map_env(action_mode=mode, max_steps=20, stop="automatic", success_radius_m=0.01) for _ in range(2))
    for env in (often, once):
        env.action_space.seed(1)
        env.reset(seed=1)
    for _ in range(30):
        often.step(often.action_space.sample())
        often.render()
        once.step(once.action_space.sample())
    assert np.array_equal(often.render(), once.render())
    assert np.array_equal(often.render(), often.render())


def test_a_picture_is_an_array_of_its_own():
    env = _map_env()
    env.reset(seed=0)
    first = env.render()
    before = first.copy()
    first[:] = 0
    assert np.array_equal(env.render(), before)


def test_a_batch_draws_what_single_environments_draw():
    envs = VectorEnv(num_envs=2, observations=("pose",), **MAP)
    alone = [_map_env() for _ in range(2)]
    envs.reset(seed=5)
    for index, env in enumerate(alone):
        env.reset(seed=5 + index)
    for _ in range(4):
        envs.step(np.array([AHEAD, LEFT]))
        alone[0].step(AHEAD)
        alone[1].step(LEFT)
    for ours, theirs in zip(envs.render(), alone, strict=True):
        assert np.array_equal(ours, theirs.render())


def test_rendering_changes_nothing_that_the_agent_sees():
    env, plain = (
        LifelongNavEnv(**(MAP | {"observations": OBSERVATIONS, "max_steps": 4} | more))
        for more in ({}, {"render_view": "camera"})
    )
    for one in (env, plain):
        one.action_space.seed(2)
    assert data_equivalence(env.reset(seed=2), plain.reset(seed=2))
    for _ in range(3):
        env.render()
        assert data_equivalence(env.step(env.action_space.sample()), plain.step(plain.action_space.sample()))


def test_a_frame_is_quick():
    env = _map_env()
    env.reset(seed=0)
    env.render()
    times_s = []
    for step in range(40):
        env.step(LEFT if step % 3 else AHEAD)
        begin = time.thread_time()
        env.render()
        times_s.append(time.thread_time() - begin)
    assert np.median(times_s) < 0.005


def test_wrong_names_are_reported():
    with pytest.raises(InvalidArgumentError, match=r"render_view.*'top'.*'camera' or 'map'"):
        LifelongNavEnv(render_view="top")
    with pytest.raises(InvalidArgumentError, match="map_px"):
        LifelongNavEnv(map_px=0)
    for make in (LifelongNavEnv, VectorEnv):
        with pytest.raises(InvalidArgumentError, match=r"render_mode.*'map'.*choose the picture with `render_view`"):
            make(render_mode="map")
        with pytest.raises(ResetNeeded, match="call reset first"):
            make(**MAP).render()
