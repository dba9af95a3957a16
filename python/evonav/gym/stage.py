"""Reward the steps of a stage and report its metrics, on the evaluator's own state machine."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from evonav.evaluation.episode.progress import StageProgress
from evonav.gym.config import STEP_COST, SUCCESS_REWARD, NavConfig
from evonav.world.pose import Pose

Point2 = tuple[float, float]


@dataclass(slots=True)
class RewardedStage:
    """A stage of an environment. It holds oracle data: no observation contains any of it."""

    config: NavConfig
    progress: StageProgress
    distance_m: float
    """Geodesic distance to the end of the reference path; infinite without one."""

    @classmethod
    def begin(
        cls, config: NavConfig, target_m: Point2, start: Pose, reference_length_m: float | None, distance_m: float
    ) -> "RewardedStage":
        """Begin a stage.

        Args:
            config: The environment's.
            target_m: `(x, z)` of the target's centre.
            start: Pose of the agent.
            reference_length_m: Length L* of the reference path; `None` without one.
            distance_m: Geodesic distance to the end of the reference path; infinite without one.
        """
        progress = StageProgress(
            target_m, (start.x_m, start.z_m), reference_length_m, config.budget, config.success_radius_m
        )
        return cls(config, progress, distance_m)

    def advance(self, end: Pose, length_m: float, distance_m: float, *, is_stop: bool) -> float:
        """Count a step and return its reward; the last step's includes the stage's own.

        Args:
            end: Pose of the agent after the step.
            length_m: Length of the step's path.
            distance_m: Geodesic distance that is left.
            is_stop: True if the agent stopped.
        """
        self.progress.advance(length_m, is_stop=is_stop)
        score = self.progress.score((end.x_m, end.z_m)) if self.progress.is_over else None
        reward = 0.0
        if self.config.reward == "progress":
            gain_m = self.distance_m - distance_m
            reward = (gain_m if math.isfinite(gain_m) else 0.0) - STEP_COST
            if score is not None and score.is_success:
                reward += SUCCESS_REWARD
        elif score is not None and score.spl is not None:
            reward = float(score.is_success) if self.config.reward == "sparse" else score.spl
        self.distance_m = distance_m
        return reward

    def is_within_radius(self, end: Pose) -> bool:
        """Return whether the stage would be a success if it ended at `end`."""
        return self.progress.score((end.x_m, end.z_m)).is_success

    def oracle(self) -> dict[str, Any]:
        """Return the target, the geodesic distance to it and the reference length, for `info["oracle"]`."""
        length_m = self.progress.reference_length_m
        return {
            "target_m": np.array(self.progress.target_m),
            "geodesic_distance_m": self.distance_m,
            "reference_length_m": math.nan if length_m is None else length_m,
        }

    def result(self, stage: int, end: Pose) -> dict[str, Any]:
        """Return the stage's metrics, equal to what `evonav evaluate` records for the same steps.

        Args:
            stage: 1-based.
            end: Pose of the agent.
        """
        progress, score = self.progress, self.progress.score((end.x_m, end.z_m))
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
            "reference_length_m": math.nan if progress.reference_length_m is None else progress.reference_length_m,
            "start_distance_m": score.start_distance_m,
            "terminal_distance_m": score.terminal_distance_m,
            "geodesic_distance_m": self.distance_m,
        }


def task_result(results: list[dict[str, Any]]) -> dict[str, Any]:
    """Return means over a task's scored stages; NaN if none was scored."""
    scored = [result for result in results if result["state"] != "errored"]
    averages = {
        name: math.fsum(result[name] for result in scored) / len(scored) if scored else math.nan
        for name in ("success", "spl", "soft_spl")
    }
    return {"num_stages": len(results), "num_scored": len(scored), **averages}
