"""Run one environment: the embedded simulator and the evaluator's motion, one step at a time."""

from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from evonav import _core
from evonav.agents.agent import Move, NavigateTo, Sensing
from evonav.evaluation.episode import motion
from evonav.gym import spaces
from evonav.gym.config import ACTIONS, NavConfig
from evonav.gym.source import NavTask, TaskSource
from evonav.gym.stage import RewardedStage, task_result
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.pose import Pose
from evonav.world.simulator import Action

Observation = dict[str, Any]
Info = dict[str, Any]


class LifelongNavEnv(gymnasium.Env[Observation, Any]):
    """Lifelong navigation: an episode is a whole task, with its stages in sequence in a house that changes.

    A stage ends when the agent stops or its steps are used up. The next one begins where the agent stands. Only the
    last one ends the episode (`terminated`; nothing is ever truncated). docs/gym.md describes spaces, rewards and
    infos.

    Example:
        >>> import evonav.gym, gymnasium
        >>> env = gymnasium.make("evonav/LifelongNav-v0", observations=("depth", "category"))
        >>> observation, info = env.reset(seed=0)
        >>> observation["depth"].shape, info["stage"]
        ((128, 128), 1)
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 10}  # type: ignore[misc]

    def __init__(
        self,
        tasks: Path | str | None = None,
        *,
        subset: str | None = None,
        config: NavConfig | None = None,
        render_mode: str | None = None,
        **settings: Any,  # noqa: ANN401 - fields of NavConfig
    ) -> None:
        """Make an environment over some tasks.

        Args:
            tasks: Folder of tasks; by default the bundled ones.
            subset: Named subset of the folder, such as `train-90`.
            config: All settings at once.
            render_mode: `rgb_array`, or none.
            **settings: Fields of `NavConfig`, which override those of `config`.

        Raises:
            InvalidArgumentError: A setting is out of range.
            TaskError: The folder has no tasks, or not the subset.
        """
        self.config = replace(config or NavConfig(), **settings)
        self.render_mode = render_mode
        self.source = TaskSource(tasks, subset=subset)
        self.observation_space = spaces.observation_space(self.config)
        self.action_space = spaces.action_space(self.config)
        allows = self.config.allow_unknown_assets
        self._simulator = EmbeddedSimulator(self.config.simulator, allow_unknown_assets=allows)
        self._planner = motion.Planner(self._simulator)
        self._task: NavTask | None = None
        self._stage = 0
        self._results: list[Info] = []

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observation, Info]:
        """Begin a task.

        Args:
            seed: Seed for the choice of this task and all later ones.
            options: `{"task": TASK_ID}` to choose a task.

        Raises:
            InvalidArgumentError: The task does not exist.
            TaskError: The task is malformed.
        """
        super().reset(seed=seed)
        number = self.source.draw(self.np_random)
        if options and "task" in options:
            number = self.source.find(options["task"])
        self._task = self.source.task(number)
        self._results = []
        self._begin_stage(1, self._task.start)
        self._origin = as_row(self._simulator.pose)
        return self._observation(motion.Motion((), is_success=True)), self._info()

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, Info]:  # noqa: ANN401 - of either mode
        """Execute an action; the observation after a stage's last step is the next stage's first.

        Raises:
            ResetNeeded: The task is over, or was not begun.
        """
        if self._task is None:
            raise ResetNeeded("the task is over, or none was begun: call reset first")
        done, is_stop = self._carry_out(action)
        end = self._simulator.pose
        reward = self._rewarded.advance(end, done.length_m, self._distance_m(), is_stop=is_stop)
        if not self._rewarded.progress.is_over:
            return self._observation(done), reward, False, False, self._info()
        self._results.append(self._rewarded.result(self._stage, end))
        is_last = self._stage == len(self._task.stages)
        if not is_last:
            self._begin_stage(self._stage + 1, end)
            done = motion.Motion((), is_success=True)
        observation, info = self._observation(done), self._info()
        info["stage_result"] = dict(self._results[-1])
        if is_last:
            info["task_result"] = task_result(self._results)
            self._task = None
        return observation, reward, is_last, False, info

    def render(self) -> NDArray[np.uint8] | None:
        """Return the agent's view, `(H, W, 3)`, in mode `rgb_array`."""
        if self.render_mode != "rgb_array":
            return None
        return self._simulator.render(rgb=True, instances=False).rgb

    def close(self) -> None:
        """Release the house."""
        self._task = None
        self._simulator.close()

    def _begin_stage(self, stage: int, pose: Pose) -> None:
        assert self._task is not None  # set by reset
        self._stage, data = stage, self._task.stages[stage - 1]
        start = self._simulator.reset(data.house_json, pose, name=self._task.task_id)
        self._planner = motion.Planner(self._simulator)
        path_m = self._planner.path_m(data.target_m)
        core = self._simulator.core
        self._field = _core.GeodesicField(core, path_m[-1]) if path_m else None
        self._labels = spaces.body_labels(core.bodies())
        length_m = motion.polyline_length_m(path_m) if path_m else None
        self._rewarded = RewardedStage.begin(self.config, data.target_m, start, length_m, self._distance_m())

    def _distance_m(self) -> float:
        pose = self._simulator.pose
        return float("inf") if self._field is None else self._field.distance_m((pose.x_m, pose.z_m))

    def _carry_out(self, action: Any) -> tuple[motion.Motion, bool]:  # noqa: ANN401 - of either mode
        simulator = self._simulator
        if self.config.action_mode == "actions":
            chosen = ACTIONS[int(action)]
            return motion.move(simulator, Move(chosen)), chosen is Action.STOP
        target_m = spaces.waypoint_m(self.config, np.asarray(action), as_row(simulator.pose), self._origin)
        if target_m is None:
            return motion.move(simulator, Move(Action.STOP)), True
        spacing_m = self.config.protocol.waypoint_m
        travel_m = Sensing().max_travel_m
        done = motion.navigate(
            simulator, self._planner, NavigateTo(target_m), spacing_m=spacing_m, max_travel_m=travel_m
        )
        return done, False

    def _observation(self, last: motion.Motion) -> Observation:
        config = self.config
        assert self._task is not None  # set by reset
        goal = self._task.stages[self._stage - 1].goal
        seen: Observation = {}
        if config.has("depth") or config.has("rgb") or config.has("semantic"):
            frame = self._simulator.render(rgb=config.has("rgb"), instances=config.has("semantic"))
            seen["depth"] = np.where(np.isfinite(frame.depth_m), frame.depth_m, np.float32(config.simulator.far_m))
            seen["rgb"] = frame.rgb
            if config.has("semantic") and frame.instances is not None:
                masks, instances = _core.number_instances(
                    frame.instances, self._labels > 0, min_area_px=config.min_mask_px, max_box_fraction=1.0
                )
                seen["semantic"] = np.append(self._labels[instances], np.uint8(0))[masks]
        seen["pose"] = spaces.relative_poses(as_row(self._simulator.pose)[None], self._origin[None])[0]
        seen["category"] = np.int64(spaces.category_index(goal.category))
        seen["stage"] = np.int64(self._stage)
        seen["steps_left"] = np.int64(config.budget - self._rewarded.progress.num_steps)
        seen["is_action_success"] = np.int64(last.is_success)
        seen["has_arrived"] = np.int64(last.has_arrived)
        if config.has("instruction"):
            seen["instruction"] = spaces.instruction_text(goal)
        if config.has("reference_image"):
            seen["reference_image"] = spaces.reference_image(goal, config.reference_image_px)
        return {name: seen[name] for name in config.observations}

    def _info(self) -> Info:
        assert self._task is not None  # set by reset
        info: Info = {"task_id": self._task.task_id, "stage": self._stage, "num_stages": len(self._task.stages)}
        if self.config.oracle_info:
            info["oracle"] = oracle_info(self._rewarded)
        return info


def as_row(pose: Pose) -> NDArray[np.float64]:
    """Return `(5,)` numbers: x, y, z, yaw, horizon."""
    return np.array([*pose.position_m, pose.yaw_rad, pose.horizon_rad])


def oracle_info(stage: RewardedStage) -> Info:
    """Return the entries that `NavConfig.oracle_info` adds."""
    reference_length_m = stage.progress.reference_length_m
    return {
        "target_m": np.array(stage.progress.target_m),
        "geodesic_distance_m": stage.distance_m,
        "reference_length_m": float("nan") if reference_length_m is None else reference_length_m,
    }
