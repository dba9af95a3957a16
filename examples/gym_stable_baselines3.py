"""Train with stable-baselines3 on the vectorised environment, which steps and draws all agents inside Rust.

pip install stable-baselines3
python examples/gym_stable_baselines3.py [TASKS_FOLDER]
"""

import sys
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from evonav.gym import VectorEnv


class EvonavVecEnv(VecEnv):
    """`evonav.gym.VectorEnv` as stable-baselines3's `VecEnv`."""

    def __init__(self, num_envs: int, **settings: object) -> None:
        """Make environments; `settings` are those of `gymnasium.make_vec`."""
        self.envs = VectorEnv(num_envs=num_envs, autoreset_mode="SameStep", **settings)
        super().__init__(num_envs, self.envs.single_observation_space, self.envs.single_action_space)

    def reset(self) -> dict[str, np.ndarray]:
        """Begin a task in every environment, with the seeds that `seed` set."""
        observations, infos = self.envs.reset(seed=self._seeds)
        self.reset_infos = self._listed(infos)
        self._reset_seeds()
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Execute the actions; where an episode ended, the observation is the next one's first."""
        observations, rewards, dones, _, infos = self.envs.step(self._actions)
        return observations, rewards.astype(np.float32), dones, self._listed(infos)

    def _listed(self, infos: dict[str, Any]) -> list[dict[str, Any]]:
        """Return one info for each environment, with the last observation of an episode as `terminal_observation`."""
        listed = [_info(infos, index) for index in range(self.num_envs)]
        for info in listed:
            if "final_obs" in info:
                info |= info.pop("final_info") | {"terminal_observation": info.pop("final_obs")}
        return listed

    def close(self) -> None:
        """End the thread that builds houses."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: int | list[int] | None = None) -> list[Any]:
        """Return an attribute of the environments, which they share."""
        return [getattr(self.envs, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: object, indices: int | list[int] | None = None) -> None:
        """Set an attribute of all environments."""
        setattr(self.envs, attr_name, value)

    def env_method(
        self, method_name: str, *args: object, indices: int | list[int] | None = None, **kwargs: object
    ) -> list[Any]:
        """Call a method of the environments once for all."""
        return [getattr(self.envs, method_name)(*args, **kwargs)] * len(list(self._get_indices(indices)))

    def env_is_wrapped(self, wrapper_class: type, indices: int | list[int] | None = None) -> list[bool]:
        """No environment has a wrapper."""
        return [False] * len(list(self._get_indices(indices)))


def _info(infos: dict[str, Any], index: int) -> dict[str, Any]:
    """Return what Gymnasium's infos of many environments say of one."""
    names = [name for name in infos if not name.startswith("_") and infos[f"_{name}"][index]]
    return {name: _info(infos[name], index) if isinstance(infos[name], dict) else infos[name][index] for name in names}


def main(tasks: str | None = None) -> None:
    """Train PPO for a while; without tasks, on the bundled ones, which are of the test split."""
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecMonitor

    envs = VecMonitor(EvonavVecEnv(16, tasks=tasks, observations="learn", turn_deg=30, max_steps=200))
    PPO("MultiInputPolicy", envs, n_steps=128, verbose=1).learn(200_000)
    envs.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
