"""The examples run, and the one that learns learns."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np

EXAMPLES = Path(__file__).parents[2] / "examples"


def _load(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_policy_without_learning_finishes_a_task(capsys):
    _load("gym_policy").main("greedy", "1")
    assert "success" in capsys.readouterr().out


def test_rewards_rise_while_training(monkeypatch):
    example = _load("train_gym")
    monkeypatch.setattr(example, "NUM_ENVS", 16)
    weights, curve = example.train("endless:train", 24)
    assert np.mean(curve[-6:]) > np.mean(curve[:6]) + 0.005
    assert weights.shape == (3, example.NUM_FEATURES)
    reward, success, num_stages = example.evaluate(weights, num_steps=40)
    assert np.isfinite(reward)
    assert 0.0 <= success <= 1.0
    assert num_stages > 0


def test_the_adapter_lists_infos_and_final_observations_as_stable_baselines3_does(monkeypatch):
    """With a stand-in for stable-baselines3's class, which needs torch."""

    class VecEnv:
        def __init__(self, num_envs, observation_space, action_space):
            self.num_envs, self.observation_space, self.action_space = num_envs, observation_space, action_space
            self._seeds = [7, 8]

        def _reset_seeds(self):
            self._seeds = [None] * self.num_envs

    module = ModuleType("stable_baselines3.common.vec_env")
    module.VecEnv = VecEnv
    monkeypatch.setitem(sys.modules, module.__name__, module)
    envs = _load("gym_stable_baselines3").EvonavVecEnv(2, observations="learn", max_steps=2)
    seen = envs.reset()
    assert seen["image"].shape == (2, 84, 84, 4)
    assert envs.reset_infos[0]["stage"] == 1
    for _ in range(20):
        envs.step_async(np.array([2, 2]))
        seen, rewards, dones, infos = envs.step_wait()
        assert rewards.dtype == np.float32
        if dones.any():
            break
    ended, running = infos[dones.argmax()], infos[dones.argmin()]
    assert ended["task_result"]["num_stages"] == ended["stage_result"]["stage"]
    assert ended["terminal_observation"]["state"].tolist() != seen["state"][dones.argmax()].tolist()
    assert dones.all() or "terminal_observation" not in running
    envs.close()
