"""Follow a stage from its start to its end: steps, path length, budget and score.

The evaluator's stages and Gymnasium's environments end and score by this one state machine.
"""

from dataclasses import dataclass

from evonav.evaluation.metrics.scoring import StageScore, score_stage
from evonav.points import Point2


@dataclass(slots=True)
class StageProgress:
    """A stage that is running. It holds oracle data: no observation contains any of it."""

    target_m: Point2
    """`(x, z)` of the target's centre as the stage began."""
    start_m: Point2
    """`(x, z)` where the agent began."""
    reference_length_m: float | None
    """Length L* of the planner's path from the start to the target; `None` if there is none."""
    budget: int
    """Steps after which the stage ends."""
    success_radius_m: float
    num_steps: int = 0
    path_length_m: float = 0.0
    has_stopped: bool = False
    """The agent ended the stage itself."""
    moved_target_m: Point2 | None = None
    """`(x, z)` of the target's centre after the house changed during the stage."""

    def advance(self, length_m: float, *, is_stop: bool) -> None:
        """Count a step on which the agent went `length_m`, and with which it may have stopped."""
        self.num_steps += 1
        self.path_length_m += length_m
        self.has_stopped = is_stop

    @property
    def is_over(self) -> bool:
        """True once the agent has stopped or used its budget up."""
        return self.has_stopped or self.num_steps >= self.budget

    def score(self, end_m: Point2) -> StageScore:
        """Score the stage as if it ended at `end_m`."""
        return score_stage(
            self.start_m,
            end_m,
            self.target_m if self.moved_target_m is None else self.moved_target_m,
            path_length_m=self.path_length_m,
            reference_length_m=self.reference_length_m,
            success_radius_m=self.success_radius_m,
            target_at_start_m=self.target_m,
        )
