"""Score one stage: success, SPL and SoftSPL from where it began, where it ended and what lay between (Sec. C.2).

Evaluation, replays, the verification of submissions and Gymnasium all score with `score_stage`.
"""

import math
from dataclasses import dataclass

from evonav.points import Point2

SUCCESS_RADIUS_M = 2.0
"""The paper's success radius."""


@dataclass(frozen=True, slots=True)
class StageScore:
    """Success, straight distances and path efficiency of one stage."""

    is_success: bool
    """The agent ended within the success radius of the target, measured as a straight line."""
    start_distance_m: float
    """Straight distance from the start to the target."""
    terminal_distance_m: float
    """Straight distance from the end to the target."""
    spl: float | None
    """SPL; `None` without a reference path."""
    soft_spl: float | None
    """SoftSPL; `None` without a reference path."""


def score_stage(
    start_m: Point2,
    end_m: Point2,
    target_m: Point2,
    *,
    path_length_m: float,
    reference_length_m: float | None,
    success_radius_m: float = SUCCESS_RADIUS_M,
    target_at_start_m: Point2 | None = None,
) -> StageScore:
    """Score a stage.

    Args:
        start_m: `(x, z)` where the agent began.
        end_m: `(x, z)` where the agent ended.
        target_m: `(x, z)` of the target's centre as the stage ended.
        path_length_m: Length of the path that the agent took.
        reference_length_m: Length L* of the planner's path from the start to the target; `None` if there is none.
        success_radius_m: The stage is a success closer than this.
        target_at_start_m: `(x, z)` of the target's centre as the stage began, if it moved during the stage.
    """
    start_distance_m = math.dist(start_m, target_m if target_at_start_m is None else target_at_start_m)
    terminal_distance_m = math.dist(end_m, target_m)
    is_success = terminal_distance_m < success_radius_m
    spl = soft_spl = None
    if reference_length_m is not None:
        spl = stage_spl(is_success, path_length_m, reference_length_m)
        soft_spl = stage_soft_spl(start_distance_m, terminal_distance_m, path_length_m, reference_length_m)
    return StageScore(is_success, start_distance_m, terminal_distance_m, spl, soft_spl)


def stage_spl(is_success: bool, path_length_m: float, reference_length_m: float) -> float:
    """Return `S L* / max(L, L*)`; 1 for a success that needed no step and took none, where the formula is 0/0."""
    return _efficiency(path_length_m, reference_length_m) if is_success else 0.0


def stage_soft_spl(
    start_distance_m: float, terminal_distance_m: float, path_length_m: float, reference_length_m: float
) -> float:
    """Return SPL with the covered share of the start distance in place of success; 0 if the agent ends farther away."""
    progress = 1.0 if start_distance_m == 0.0 else max(0.0, 1.0 - terminal_distance_m / start_distance_m)
    return progress * _efficiency(path_length_m, reference_length_m)


def _efficiency(path_length_m: float, reference_length_m: float) -> float:
    longest_m = max(path_length_m, reference_length_m)
    return 1.0 if longest_m == 0.0 else reference_length_m / longest_m
