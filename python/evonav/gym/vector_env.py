"""Run many environments at once: Rust moves and renders all agents in parallel, without Python's lock."""

import math
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from evonav import _core
from evonav.agents.agent import SensorConfig
from evonav.errors import InvalidArgumentError
from evonav.evaluation.episode import motion
from evonav.gym import spaces
from evonav.gym.config import RENDER_MODES, STOP, NavConfig, check_render_mode, checked_mode
from evonav.gym.map_view import MapView
from evonav.gym.sources import task_source
from evonav.gym.spaces import Infos, Observations
from evonav.gym.stage import Stages
from evonav.gym.worlds import StageWorld, WorldLoader
from evonav.parallel.local import num_cores
from evonav.tasks.public import Goal
from evonav.world.appearance import Change
from evonav.world.pose import Pose

_Moved = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]
"""Path lengths, remaining distances, and who stopped."""


@dataclass(slots=True)
class _Episode:
    """One agent's task."""

    random: np.random.Generator
    number: int
    """Number of the task in the source."""
    next_number: int
    at: StageWorld
    look: tuple[Change, ...]


class VectorEnv(gymnasium.vector.VectorEnv[Observations, Any, Any]):
    """B environments of `LifelongNavEnv`, each with a seed of its own.

    An episode that has ended restarts at the next step (`AutoresetMode.NEXT_STEP`), whose action is ignored and whose
    reward is 0, or in the same step (`SAME_STEP`). A background thread builds the next houses in the meantime.

    Examples:
        >>> import evonav.gym, gymnasium
        >>> envs = gymnasium.make_vec("evonav/LifelongNav-v0", num_envs=4, observations=("depth", "category"))
        >>> observations, infos = envs.reset(seed=0)
        >>> observations["depth"].shape
        (4, 128, 128)
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        "render_modes": list(RENDER_MODES),
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        tasks: Path | str | None = None,
        *,
        num_envs: int = 1,
        houses: Path | str | None = None,
        subset: str | None = None,
        config: NavConfig | None = None,
        render_mode: str | None = None,
        num_threads: int | None = None,
        copy: bool = True,
        cache_mb: int = 512,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **settings: Any,  # noqa: ANN401 - fields of NavConfig
    ) -> None:
        """Make environments over some tasks.

        Args:
            tasks: Folder of tasks; by default the bundled ones.
            num_envs: Number B of environments.
            houses: Houses whose tasks are generated as they are chosen, such as `endless:train`; instead of `tasks`.
            subset: Named subset of the folder, such as `train-90`.
            config: All settings at once.
            render_mode: `rgb_array` for pictures of `render_view` (`NavConfig`), or none.
            num_threads: Threads that move and render; by default one per core. Results do not depend on it.
            copy: Whether every step returns arrays of its own. Otherwise a step overwrites the images of the previous
                one, which saves the allocation of their memory.
            cache_mb: Memory for houses without an agent.
            autoreset_mode: Step that begins the next episode, `NEXT_STEP` or `SAME_STEP`. With the latter the last
                observation and info of an episode are `final_obs` and `final_info` of the infos.
            **settings: Fields of `NavConfig`, which override those of `config`.

        Raises:
            EvonavError: A setting is out of range, or the tasks or houses cannot be read.
        """
        check_render_mode(render_mode)
        given = {name: getattr(config, name) for name in config.model_fields_set} if config else {}
        self.config = NavConfig(**(given | settings))
        self.metadata = self.metadata | {"autoreset_mode": checked_mode(autoreset_mode)}  # type: ignore[misc]
        self.num_envs, self.render_mode, self._copies = num_envs, render_mode, copy
        self.single_observation_space = spaces.observation_space(self.config)
        self.single_action_space = spaces.action_space(self.config)
        camera = self.config.simulator
        self._batch = _core.BatchSimulator(
            num_envs,
            image_px=(camera.width_px, camera.height_px),
            empty_depth_m=camera.far_m,
            move_m=camera.move_m,
            turn_rad=math.radians(camera.turn_deg),
            grid_m=camera.grid_m,
            min_area_px=self.config.min_mask_px,
            num_threads=num_threads or num_cores(),
        )
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.loader = WorldLoader(task_source(tasks, houses, subset), self.config, cache_mb * 2**20)
        self._images: dict[str, NDArray[Any]] = {}
        self._episodes: list[_Episode] = []
        self._maps: dict[int, MapView] = {}
        """Maps of all agents; empty if they are not rendered."""
        self._randoms: list[np.random.Generator] = [seeding.np_random()[0] for _ in range(num_envs)]
        self._poses = np.zeros((num_envs, 5))
        self._origins = np.zeros((num_envs, 5))
        self._has_succeeded = np.ones(num_envs, np.int64)
        self._has_arrived = np.zeros(num_envs, np.int64)
        self._is_over = np.zeros(num_envs, np.bool_)
        self._stages = Stages(self.config, num_envs)
        kinds = {"task_id": object, "stage": np.int64, "num_stages": np.int64}
        self._shared_infos = {name: np.zeros(num_envs, kind) for name, kind in kinds.items()}
        """Infos of all agents."""
        self._categories = np.zeros(num_envs, np.int64)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, Infos]:
        """Begin a task in every environment.

        Args:
            seed: Seed of environment 0; environment `i` has `seed + i`. Or one seed for each.
            options: `{"task": TASK_ID}` to choose one task for all of them.
        """
        if seed is None or isinstance(seed, int):
            seed = [None if seed is None else seed + index for index in range(self.num_envs)]
        self.begin(seed, options)
        return self.observations(), self._infos({})

    def begin(self, seeds: Sequence[int | None], options: dict[str, Any] | None) -> None:
        """Begin a task in every environment, with a seed for each; see `reset`."""
        if len(seeds) != self.num_envs:
            raise InvalidArgumentError(f"argument `seed` has {len(seeds)} seeds, expected {self.num_envs}")
        source = self.loader.source
        numbers = [episode.next_number for episode in self._episodes] or [-1] * self.num_envs
        for index, one in enumerate(seeds):
            if one is not None:
                self._randoms[index] = seeding.np_random(one)[0]
            if one is not None or not self._episodes:
                numbers[index] = source.draw(self._randoms[index])
        if options and "task" in options:
            numbers = [source.find(options["task"])] * self.num_envs
        self.loader.forget()
        for number in numbers:
            self.loader.prefetch(number, 1)
        self._episodes = []
        for index, (number, random) in enumerate(zip(numbers, self._randoms, strict=True)):
            self._episodes.append(self._begin_task(index, number, random))
        self._poses = self._batch.poses()

    def step(
        self,
        actions: Any,  # noqa: ANN401 - of either mode
    ) -> tuple[Observations, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], Infos]:
        """Execute an action in every environment.

        Raises:
            InvalidArgumentError: The number of actions is wrong, or an action is invalid.
            ResetNeeded: No task was begun.
        """
        rewards, terminations, ended = self.advance(np.asarray(actions))
        if self.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP and terminations.any():
            self._restart(np.flatnonzero(terminations).tolist(), ended)
        return self.observations(), rewards, terminations, np.zeros(self.num_envs, np.bool_), self._infos(ended)

    def _restart(self, indices: list[int], ended: dict[int, Infos]) -> None:
        """Begin new episodes where one ended; `ended` receives how it ended."""
        last = self.observations()
        for index in indices:
            final_obs = {name: deepcopy(values[index]) for name, values in last.items()}
            ended[index] = {"final_obs": final_obs, "final_info": self.info(index) | ended[index]}
            self._begin_next(index)
        self._poses = self._batch.poses()

    def advance(self, actions: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.bool_], dict[int, Infos]]:
        """Execute an action in every environment; see `step`.

        Returns:
            Rewards, who has ended an episode, and the infos of those that ended a stage, by number.
        """
        if not self._episodes:
            raise ResetNeeded("no task was begun: call reset first")
        if len(actions) != self.num_envs:
            raise InvalidArgumentError(f"argument `actions` has {len(actions)} elements, expected {self.num_envs}")
        is_reset = self._is_over.copy()
        move = self._move if self.config.action_mode == "actions" else self._navigate
        lengths_m, distances_m, is_stop = move(actions, is_reset)
        ends_m = self._poses[:, 0:3:2]
        for index, view in self._maps.items():
            if not is_reset[index]:
                view.walk([tuple(ends_m[index].tolist())])
        rewards, has_ended = self._stages.advance(ends_m, lengths_m, distances_m, is_stop=is_stop, is_running=~is_reset)
        changed = (has_ended | is_reset).nonzero()[0].tolist()
        ended: dict[int, Infos] = {}
        for index in changed:
            if is_reset[index]:
                self._begin_next(index)
            else:
                ended[index] = self._end_stage(index, self._pose(index))
        if changed:
            self._poses = self._batch.poses()
        return rewards, has_ended & self._is_over, ended

    def is_over(self, index: int) -> bool:
        """Return whether an environment's task is over, or was not begun."""
        return not self._episodes or bool(self._is_over[index])

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return a picture of each agent in mode `rgb_array`: its camera's `(H, W, 3)`, or a map `(S, S, 3)`.

        Raises:
            ResetNeeded: No task was begun.
        """
        if self.render_mode is None:
            return None
        if not self._episodes:
            raise ResetNeeded("no task was begun: call reset first")
        if self.config.render_view == "map":
            return tuple(self._maps[index].draw(self._pose(index)) for index in range(self.num_envs))
        rgb = np.empty((self.num_envs, self.config.height_px, self.config.width_px, 3), np.uint8)
        self._batch.render(depth_m=None, rgb=rgb, labels=None)
        return tuple(rgb)

    def close_extras(self, **_: Any) -> None:  # noqa: ANN401 - Gymnasium's signature
        """End the background thread."""
        self.loader.close()

    def _begin_next(self, index: int) -> None:
        episode = self._episodes[index]
        self._episodes[index] = self._begin_task(index, episode.next_number, episode.random)

    def _begin_task(self, index: int, number: int, random: np.random.Generator) -> _Episode:
        at = self.loader.get(number, 1)
        # Each task is drawn one task ahead, so that its house can be built in the meantime.
        next_number = self.loader.source.draw(random)
        look = self.config.draw_appearance(random)
        start = self._begin_stage(index, (number, next_number), at, at.task.start_pose, look)
        self._origins[index] = (*start.position_m, start.yaw_rad, start.horizon_rad)
        return _Episode(random, number, next_number, at, look)

    def _begin_stage(
        self, index: int, numbers: tuple[int, int], at: StageWorld, pose: Pose, look: tuple[Change, ...]
    ) -> Pose:
        """Put an agent into a stage, and return its pose; `numbers` are those of this task and the next."""
        simulator = at.world.entered(look)
        start = simulator.enter(pose)
        self._batch.place(index, simulator.core, start, at.world.labels)
        if path_m := at.reference_path_m(simulator, self._batch.plan_one(index, at.target_m)):
            self._batch.aim(index, _core.GeodesicField(simulator.core, path_m[-1]))
        if self.render_mode is not None and self.config.render_view == "map":
            self._maps[index] = MapView(self.config, at, start)
        is_last = at.stage == at.task.num_stages
        self.loader.prefetch(numbers[is_last], 1 if is_last else at.stage + 1)
        length_m = motion.polyline_length_m(path_m) if path_m else None
        self._stages.begin(index, at.stage, at.target_m, start, length_m, self._batch.distance_m(index))
        self._shared_infos["task_id"][index] = at.task.task_id
        self._shared_infos["stage"][index], self._shared_infos["num_stages"][index] = at.stage, at.task.num_stages
        self._categories[index] = spaces.category_index(at.task.public(at.stage).category)
        self._has_succeeded[index], self._has_arrived[index], self._is_over[index] = 1, 0, False
        return start

    def _end_stage(self, index: int, end: Pose) -> Infos:
        """Measure a stage and begin the next one, if there is one."""
        episode, at = self._episodes[index], self._episodes[index].at
        self._is_over[index] = is_last = at.stage == at.task.num_stages
        ended = self._stages.end(index, at.stage, end, is_last=is_last)
        if not is_last:
            episode.at = self.loader.get(episode.number, at.stage + 1)
            self._begin_stage(index, (episode.number, episode.next_number), episode.at, end, episode.look)
        return ended

    def _move(self, actions: NDArray[Any], is_reset: NDArray[np.bool_]) -> _Moved:
        """Execute discrete actions; return path lengths, remaining distances, and who stopped."""
        largest = STOP if self.config.stop == "explicit" else STOP - 1
        if not (is_reset | (actions >= 0) & (actions <= largest)).all():
            raise InvalidArgumentError(f"argument `actions` holds {actions.tolist()}, expected 0 to {largest}")
        numbers = np.where(is_reset, STOP, actions)
        before = self._poses[:, 0:3:2].tolist()
        is_success, distances_m = self._batch.step(numbers.astype(np.uint8))
        self._poses = self._batch.poses()
        self._has_succeeded[:] = is_success
        after = self._poses[:, 0:3:2].tolist()
        lengths_m = [0.0 if a == b else math.dist(a, b) for a, b in zip(before, after, strict=True)]
        return np.array(lengths_m), distances_m, numbers == STOP

    def _navigate(self, actions: NDArray[Any], is_reset: NDArray[np.bool_]) -> _Moved:
        """Execute waypoint actions: Rust finds the paths, which agents follow as in an evaluation."""
        targets_m = [
            None if skips else spaces.waypoint_m(self.config, action, pose, origin)
            for action, pose, origin, skips in zip(actions, self._poses, self._origins, is_reset, strict=True)
        ]
        lengths_m = [0.0] * self.num_envs
        self._has_succeeded[:], self._has_arrived[:] = 1, 0
        for index, corners in enumerate(self._batch.plan(targets_m)):
            if targets_m[index] is not None:
                lengths_m[index] = self._follow(index, corners)
        self._poses = self._batch.poses()
        _, distances_m = self._batch.step(np.full(self.num_envs, STOP, np.uint8))
        return np.array(lengths_m), distances_m, np.array([target is None for target in targets_m])

    def _follow(self, index: int, corners: list[tuple[float, float]]) -> float:
        here: tuple[float, float] = (float(self._poses[index, 0]), float(self._poses[index, 2]))
        if not corners:
            self._has_succeeded[index] = 0
            return 0.0
        spacing_m = self.config.protocol.waypoint_m
        points, is_end = motion.waypoints([here, *corners], spacing_m, SensorConfig().max_travel_m)
        way = [here, *points]
        stops = [
            (there, math.atan2(there[0] - from_m[0], there[1] - from_m[1]))
            for from_m, there in zip(way, points, strict=False)
        ]
        num_passed = self._batch.follow(index, stops)
        self._has_succeeded[index] = num_passed == len(points)
        self._has_arrived[index] = is_end and num_passed == len(points)
        if index in self._maps:
            self._maps[index].walk(points[:num_passed])
        return motion.polyline_length_m(way[: num_passed + 1])

    def _pose(self, index: int) -> Pose:
        return Pose(*self._poses[index].tolist())

    def observations(self) -> Observations:
        """Return the observations of all environments."""
        config, seen = self.config, self._drawn()
        seen["pose"] = spaces.relative_poses(self._poses, self._origins)
        seen["category"], seen["stage"] = self._categories.copy(), self._shared_infos["stage"].copy()
        seen["steps_left"] = config.budget - self._stages.num_steps
        seen["is_action_success"], seen["has_arrived"] = self._has_succeeded.copy(), self._has_arrived.copy()
        if config.has("image"):
            seen["image"] = spaces.rgbd(seen["rgb"], seen["depth"])
        if config.has("state"):
            seen["state"] = spaces.states(seen["pose"], seen["steps_left"] / config.budget, self._has_succeeded)
        if config.has("instruction"):
            seen["instruction"] = tuple(spaces.instruction_text(goal) for goal in self._goals())
        if config.has("reference_image"):
            side_px = config.reference_image_px
            seen["reference_image"] = np.stack([spaces.reference_image(goal, side_px) for goal in self._goals()])
        return {name: seen[name] for name in config.observations}

    def _goals(self) -> list[Goal]:
        return [episode.at.task.public(episode.at.stage) for episode in self._episodes]

    def _drawn(self) -> Observations:
        """Render the images of all agents directly into the returned arrays."""
        shape = (self.num_envs, self.config.height_px, self.config.width_px)
        kinds = {"depth": (shape, np.float32), "rgb": ((*shape, 3), np.uint8), "semantic": (shape, np.uint8)}
        names = {*self.config.observations, *(("rgb", "depth") if self.config.has("image") else ())}
        wanted = {name: kind for name, kind in kinds.items() if name in names}
        if not wanted:
            return {}
        if self._copies or not self._images:
            self._images = {name: np.empty(*kind) for name, kind in wanted.items()}
        images = self._images
        self._batch.render(depth_m=images.get("depth"), rgb=images.get("rgb"), labels=images.get("semantic"))
        return dict(images)

    def _infos(self, ended: dict[int, Infos]) -> Infos:
        """Return the infos of all environments, as Gymnasium puts those of single ones together."""
        infos = spaces.with_masks({name: values.copy() for name, values in self._shared_infos.items()}, self.num_envs)
        if self.config.oracle_info:
            oracles = spaces.with_masks(self._stages.oracles(), self.num_envs)
            infos |= spaces.with_masks({"oracle": oracles}, self.num_envs)
        for index, info in ended.items():
            infos = self._add_info(infos, info, index)
        return infos

    def info(self, index: int) -> Infos:
        """Return the info of one environment, without what the end of a stage adds."""
        info: Infos = {name: values[index : index + 1].tolist()[0] for name, values in self._shared_infos.items()}
        if self.config.oracle_info:
            info["oracle"] = self._stages.oracle(index)
        return info
