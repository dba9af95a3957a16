"""A stage as an environment runs it: steps, reward, and the evaluator's own measures."""

import math
from dataclasses import dataclass
from typing import Any

from evonav.evaluation.metrics.navigation import stage_soft_spl, stage_spl
from evonav.gym.config import STEP_COST, SUCCESS_REWARD, NavConfig
from evonav.world.pose import Pose

Point2 = tuple[float, float]


@dataclass(slots=True)
class StageRun:
    """One stage that is under way. Oracle data: nothing of it is in an observation."""

    config: NavConfig
    target_m: Point2
    """`(x, z)` of the target's centre."""
    start: Pose
    reference_length_m: float | None
    """L*; `None` if there is no way."""
    distance_m: float
    """Geodesic, to where the reference path ends; infinite if there is no way."""
    num_steps: int = 0
    path_length_m: float = 0.0

    def advance(self, end: Pose, length_m: float, distance_m: float, *, is_stop: bool) -> float:
        """Counts a step.

        Args:
            end: Where the agent is now.
            length_m: Of the way it went.
            distance_m: Geodesic distance that is left.
            is_stop: Whether it ended the stage.

        Returns:
            The reward; a stage's end has its own in it.
        """
        self.num_steps += 1
        self.path_length_m += length_m
        is_over = self.is_over(is_stop=is_stop)
        reward = 0.0
        if self.config.reward == "progress":
            gain_m = self.distance_m - distance_m
            reward = (gain_m if math.isfinite(gain_m) else 0.0) - STEP_COST
            if is_over and self._is_success(end):
                reward += SUCCESS_REWARD
        elif is_over and self.reference_length_m is not None:
            is_success = self._is_success(end)
            if self.config.reward == "sparse":
                reward = float(is_success)
            else:
                reward = stage_spl(is_success, self.path_length_m, self.reference_length_m)
        self.distance_m = distance_m
        return reward

    def is_over(self, *, is_stop: bool) -> bool:
        """Whether the stage ends with the step just counted."""
        return is_stop or self.num_steps >= self.config.budget

    def result(self, stage: int, end: Pose, *, is_stop: bool) -> dict[str, Any]:
        """The stage's measures: what `evonav evaluate` records for the same steps.

        Args:
            stage: 1-based.
            end: Where the agent is.
            is_stop: Whether it stopped of its own accord.
        """
        start_distance_m, distance_m = self._straight_m(self.start), self._straight_m(end)
        is_success = self._is_success(end)
        reference_m = self.reference_length_m
        state = "errored" if reference_m is None else "success" if is_success else "failure"
        spl = soft_spl = math.nan
        if reference_m is not None:
            spl = stage_spl(is_success, self.path_length_m, reference_m)
            soft_spl = stage_soft_spl(start_distance_m, distance_m, self.path_length_m, reference_m)
        return {
            "stage": stage,
            "state": state,
            "success": is_success and reference_m is not None,
            "spl": spl,
            "soft_spl": soft_spl,
            "has_stopped": is_stop,
            "num_steps": self.num_steps,
            "path_length_m": self.path_length_m,
            "reference_length_m": math.nan if reference_m is None else reference_m,
            "start_distance_m": start_distance_m,
            "terminal_distance_m": distance_m,
            "geodesic_distance_m": self.distance_m,
        }

    def _straight_m(self, pose: Pose) -> float:
        return math.dist((pose.x_m, pose.z_m), self.target_m)

    def _is_success(self, pose: Pose) -> bool:
        return self._straight_m(pose) < self.config.success_radius_m


def task_result(results: list[dict[str, Any]]) -> dict[str, Any]:
    """Means over a task's scored stages; NaN if none was."""
    scored = [result for result in results if result["state"] != "errored"]
    means = {
        name: math.fsum(result[name] for result in scored) / len(scored) if scored else math.nan
        for name in ("success", "spl", "soft_spl")
    }
    return {"num_stages": len(results), "num_scored": len(scored), **means}
