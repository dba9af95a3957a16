"""Compare the goal's picture with what is seen around a remembered object, as a likelihood ratio.

Two distances of colours count: near the object, and in the whole view. The picture shows the goal in its middle. Walls
and floors tell rooms apart, so that the surroundings say more than the object itself.
"""

import math
from dataclasses import dataclass

from evonav.memory.colours import Layout, distance, layouts
from evonav.tasks.public import Goal


@dataclass(frozen=True, slots=True)
class PictureConfig:
    """Numbers of the ratio's logarithm, as `scripts/data/calibrate_goal_pictures.py` fits them on the design houses."""

    constant: float = 3.56
    near: float = -5.39
    """Weight of the distance near the object."""
    whole: float = -12.95
    """Weight of the distance in the whole view."""
    range: tuple[float, float] = (0.05, 20.0)
    """Smallest and largest ratio: a few hundred views do not tell of rarer things."""


def goal_layout(goal: Goal) -> Layout:
    """Return the layout of a goal's picture around its middle."""
    height_px, width_px, _ = goal.reference_image.shape
    return layouts(goal.reference_image, [(width_px / 2.0, height_px / 2.0)])[0]


def picture_ratio(pictured: Layout, seen: Layout, config: PictureConfig) -> float:
    """Return the probability of what is seen if it is the goal, over that if it is another object of its type."""
    near, whole = distance(pictured.near, seen.near), distance(pictured.whole, seen.whole)
    low, high = config.range
    return min(max(math.exp(config.constant + config.near * near + config.whole * whole), low), high)
