"""Run one environment: a batch of one."""

from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from evonav.gym.config import RENDER_MODES, NavConfig
from evonav.gym.spaces import Infos, Observations
from evonav.gym.vector_env import VectorEnv


class LifelongNavEnv(gymnasium.Env[Observations, Any]):
    """Lifelong navigation: an episode is a whole task, with its stages in sequence in a house that changes.

    A stage ends when the agent stops or its steps are used up. The next one begins where the agent stands. Only the
    last one ends the episode (`terminated`; nothing is ever truncated). docs/gym.md describes spaces, rewards and
    infos.

    Examples:
        >>> import evonav.gym, gymnasium
        >>> env = gymnasium.make("evonav/LifelongNav-v0", observations=("depth", "category"))
        >>> observation, info = env.reset(seed=0)
        >>> observation["depth"].shape, info["stage"]
        ((128, 128), 1)
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": list(RENDER_MODES), "render_fps": 10}  # type: ignore[misc]

    def __init__(
        self,
        tasks: Path | str | None = None,
        *,
        houses: Path | str | None = None,
        subset: str | None = None,
        config: NavConfig | None = None,
        render_mode: str | None = None,
        **settings: Any,  # noqa: ANN401 - fields of NavConfig
    ) -> None:
        """Make an environment over some tasks.

        Args:
            tasks: Folder of tasks; by default the bundled ones.
            houses: Houses whose tasks are generated as they are chosen, such as `endless:train`; instead of `tasks`.
            subset: Named subset of the folder, such as `train-90`.
            config: All settings at once.
            render_mode: `rgb_array` for pictures of `render_view` (`NavConfig`), or none.
            **settings: Fields of `NavConfig`, which override those of `config`.

        Raises:
            HouseError: The houses cannot be read.
            InvalidArgumentError: A setting is out of range.
            TaskError: The folder has no tasks, or not the subset.
        """
        self.render_mode = render_mode
        self._batch = VectorEnv(
            tasks,
            houses=houses,
            subset=subset,
            config=config,
            render_mode=render_mode,
            num_threads=1,
            cache_mb=0,
            **settings,
        )
        self.config, self.source = self._batch.config, self._batch.loader.source
        self.observation_space = self._batch.single_observation_space
        self.action_space = self._batch.single_action_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observations, Infos]:
        """Begin a task.

        Args:
            seed: Seed for the choice of this task and all later ones.
            options: `{"task": TASK_ID}` to choose a task; of houses, `{"task": "endless:7:3"}`.

        Raises:
            InvalidArgumentError: The task does not exist.
            TaskError: The task is malformed.
        """
        super().reset(seed=seed)
        self._batch.begin([seed], options)
        return self._observation(), self._batch.info(0)

    def step(self, action: Any) -> tuple[Observations, float, bool, bool, Infos]:  # noqa: ANN401 - of either mode
        """Execute an action; the observation after a stage's last step is the next stage's first.

        Raises:
            InvalidArgumentError: The action is invalid.
            ResetNeeded: The task is over, or was not begun.
        """
        if self._batch.is_over(0):
            raise ResetNeeded("the task is over, or none was begun: call reset first")
        rewards, terminations, ended = self._batch.advance(np.asarray(action)[None])
        info = self._batch.info(0) | ended.get(0, {})
        return self._observation(), float(rewards[0]), bool(terminations[0]), False, info

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture in mode `rgb_array`: the camera's, `(H, W, 3)`, or the map, `(S, S, 3)`.

        Raises:
            ResetNeeded: No task was begun.
        """
        views = self._batch.render()
        return None if views is None else views[0]

    def close(self) -> None:
        """End the thread that builds houses."""
        self._batch.close()

    def _observation(self) -> Observations:
        return {name: values[0] for name, values in self._batch.observations().items()}
