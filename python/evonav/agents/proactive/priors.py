"""Priors of Belief-Weighted Search: how homes change."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ChangePrior:
    """Probabilities of a change between two stages."""

    change: float
    """Probability that a room changes."""
    modes: tuple[float, ...]
    """Probability of each way in which it changes, if it does."""
    moved: tuple[float, ...]
    """Share of the room's objects that move, by that way."""
    visited_weight: float = 1.0
    """Weight of a room that the agent visited in the last stage, relative to others."""
    repeated_weight: float = 1.0
    """Factor of a room that seems to have changed before the last stage."""
    same_room: float = 0.5
    """Probability that an object that moved is still in its room (kappa)."""
    knows_rooms: bool = True
    """Whether it knows which objects are frequent in which rooms."""

    @property
    def mean_moved(self) -> float:
        """Probability that an object of a changed room moved."""
        return sum(mode * moved for mode, moved in zip(self.modes, self.moved, strict=True))


BLIND = ChangePrior(change=0.5, modes=(0.5, 0.5), moved=(0.25, 0.75), knows_rooms=False)
"""Knows nothing of the benchmark: the mean of Beta(1, 1), few or most objects move, all rooms alike."""
FITTED = ChangePrior(change=0.55, modes=(0.45, 0.41, 0.14), moved=(0.26, 0.85, 0.87), same_room=0.99)
"""Counts of 60 training tasks by `scripts/data/fit_priors.py`: 168 transitions, 93 changes, 1,118 moved objects.

The tasks are those of the first 60 houses of `procthor-generated/houses-train`, seed 0. All objects that moved stayed
in their rooms."""
ORACLE_THETA = ChangePrior(
    change=0.5,
    modes=(0.5, 0.4, 0.1),
    moved=(0.26, 0.85, 0.87),
    visited_weight=3.0,
    repeated_weight=0.5,
    same_room=0.99,
)
"""Constants by which tasks are generated (paper, Tab. 5), and shares of objects that move.

The shares are those of docs/studies/task-statistics.md.
"""
