"""Reward the steps of stages and report their metrics, on the evaluator's own state machine."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav.evaluation.episode.progress import StageProgress
from evonav.evaluation.metrics.scoring import StageScore
from evonav.gym.config import STEP_COST, SUCCESS_REWARD, NavConfig
from evonav.points import Point2
from evonav.world.pose import Pose


class Stages:
    """The running stages of B environments. They hold oracle data: no observation contains any of it.

    Steps are counted and rewarded for all of them at once; the state machine of a stage sees what was counted when the
    stage ends.
    """

    def __init__(self, config: NavConfig, num_envs: int) -> None:
        """Make room for stages, which `begin` begins.

        Args:
            num_envs: Number B of environments.
        """
        self._config, self._budget = config, config.budget
        self._progress: dict[int, StageProgress] = {}
        self._results: list[list[dict[str, Any]]] = [[] for _ in range(num_envs)]
        """Metrics of the stages of each task that are over."""
        self._targets_m = np.zeros((num_envs, 2))
        self.num_steps = np.zeros(num_envs, np.int64)
        self._path_length_m = np.zeros(num_envs)
        self._distance_m = np.zeros(num_envs)
        """Geodesic distances to the ends of the reference paths; infinite without one."""
        self._reference_length_m = np.zeros(num_envs)
        """Lengths L* of the reference paths; NaN without one."""
        self._has_stopped = np.zeros(num_envs, np.bool_)

    def begin(
        self, index: int, stage: int, target_m: Point2, start: Pose, reference_length_m: float | None, distance_m: float
    ) -> None:
        """Begin a stage; stage 1 begins a task.

        Args:
            stage: 1-based.
            target_m: `(x, z)` of the target's centre.
            reference_length_m: Length L* of the reference path; `None` without one.
            distance_m: Geodesic distance to the end of the reference path; infinite without one.
        """
        if stage == 1:
            self._results[index] = []
        self._progress[index] = StageProgress(
            target_m, (start.x_m, start.z_m), reference_length_m, self._budget, self._config.success_radius_m
        )
        self._targets_m[index] = target_m
        self.num_steps[index], self._path_length_m[index], self._distance_m[index] = 0, 0.0, distance_m
        self._reference_length_m[index] = math.nan if reference_length_m is None else reference_length_m

    def advance(
        self,
        ends_m: NDArray[np.float64],
        lengths_m: NDArray[np.float64],
        distances_m: NDArray[np.float64],
        *,
        is_stop: NDArray[np.bool_],
        is_running: NDArray[np.bool_],
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Count a step of each running stage and reward it; the last step's reward includes the stage's own.

        Args:
            ends_m: `(B, 2)`: x and z of the agents after the step.
            lengths_m: `(B,)` lengths of the steps' paths.
            distances_m: `(B,)` geodesic distances that are left.
            is_stop: `(B,)` whether the agent stopped.
            is_running: `(B,)` whether the stage is not over yet; for others nothing is counted.

        Returns:
            Rewards, 0 for those that are not running, and whose stage has ended.
        """
        self.num_steps += is_running
        self._path_length_m += lengths_m
        if self._config.stop == "automatic":
            is_stop = is_stop | self._are_within_radius(ends_m)
        self._has_stopped = is_stop
        has_ended = is_running & (is_stop | (self.num_steps >= self._budget))
        rewards = np.zeros(len(ends_m))
        if self._config.reward == "progress":
            has_path = is_running & np.isfinite(self._distance_m) & np.isfinite(distances_m)
            np.subtract(self._distance_m, distances_m, out=rewards, where=has_path)
            np.subtract(rewards, STEP_COST, out=rewards, where=is_running)
        for index in has_ended.nonzero()[0].tolist():
            rewards[index] += self._end_reward(self._at(index).score(tuple(ends_m[index].tolist())))
        self._distance_m = distances_m
        return rewards, has_ended

    def _end_reward(self, score: StageScore) -> float:
        """Return what the last step of a stage earns beside the steps' own reward."""
        if self._config.reward == "progress":
            return SUCCESS_REWARD if score.is_success else 0.0
        if score.spl is None:
            return 0.0
        return float(score.is_success) if self._config.reward == "sparse" else score.spl

    def _are_within_radius(self, ends_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which stages would be a success if they ended at these points."""
        gaps_m = np.abs(ends_m - self._targets_m)
        are_within = np.zeros(len(ends_m), np.bool_)
        for index in np.flatnonzero((gaps_m <= self._config.success_radius_m).all(axis=1)).tolist():
            are_within[index] = self._at(index).score(tuple(ends_m[index].tolist())).is_success
        return are_within

    def _at(self, index: int) -> StageProgress:
        """Return the state machine of a stage, after what was counted."""
        progress = self._progress[index]
        progress.num_steps, progress.path_length_m = int(self.num_steps[index]), float(self._path_length_m[index])
        progress.has_stopped = bool(self._has_stopped[index])
        return progress

    def oracles(self) -> dict[str, NDArray[np.float64]]:
        """Return `oracle` of all stages as arrays."""
        return {
            "target_m": self._targets_m.copy(),
            "geodesic_distance_m": self._distance_m.copy(),
            "reference_length_m": self._reference_length_m.copy(),
        }

    def oracle(self, index: int) -> dict[str, Any]:
        """Return the target, the geodesic distance to it and the reference length, for `info["oracle"]`."""
        return {
            name: values[index] if values.ndim > 1 else float(values[index]) for name, values in self.oracles().items()
        }

    def end(self, index: int, stage: int, end: Pose, *, is_last: bool) -> dict[str, Any]:
        """Return the infos of a stage's end.

        Args:
            stage: 1-based.
            is_last: Whether the task ends, too.
        """
        results = self._results[index]
        results.append(self._result(index, stage, end))
        ended: dict[str, Any] = {"stage_result": dict(results[-1])}
        return ended | {"task_result": task_result(results)} if is_last else ended

    def _result(self, index: int, stage: int, end: Pose) -> dict[str, Any]:
        """Return a stage's metrics, equal to what `evonav evaluate` records for the same steps."""
        progress = self._at(index)
        score = progress.score((end.x_m, end.z_m))
        is_scored = score.spl is not None
        return {
            "stage": stage,
            "state": "errored" if not is_scored else "success" if score.is_success else "failure",
            "success": score.is_success and is_scored,
            "spl": math.nan if score.spl is None else score.spl,
            "soft_spl": math.nan if score.soft_spl is None else score.soft_spl,
            "has_stopped": progress.has_stopped,
            "num_steps": progress.num_steps,
            "path_length_m": progress.path_length_m,
            "reference_length_m": float(self._reference_length_m[index]),
            "start_distance_m": score.start_distance_m,
            "terminal_distance_m": score.terminal_distance_m,
            "geodesic_distance_m": float(self._distance_m[index]),
        }


def task_result(results: list[dict[str, Any]]) -> dict[str, Any]:
    """Return means over a task's scored stages; NaN if none was scored."""
    scored = [result for result in results if result["state"] != "errored"]
    averages = {
        name: math.fsum(result[name] for result in scored) / len(scored) if scored else math.nan
        for name in ("success", "spl", "soft_spl")
    }
    return {"num_stages": len(results), "num_scored": len(scored), **averages}
