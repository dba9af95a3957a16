"""The examples run, and the one that learns learns."""

import importlib.util
from pathlib import Path

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
    weights, curve = example.train(None, 24)
    assert np.mean(curve[-6:]) > np.mean(curve[:6]) + 0.005
    assert weights.shape == (3, example.NUM_FEATURES)
    reward, success, num_stages = example.evaluate(weights, num_steps=40)
    assert np.isfinite(reward)
    assert 0.0 <= success <= 1.0
    assert num_stages > 0
