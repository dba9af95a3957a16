"""Spaces of observations and actions, and what their numbers mean."""

import math
import string
from functools import lru_cache
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from PIL import Image

from evonav import _core
from evonav.gym.config import ACTIONS, NavConfig
from evonav.tasks.public import StageInput

MAX_STAGES = 64
MAX_INSTRUCTION = 2000
"""Longest instruction and most stages that a task file may hold."""
_CHARACTERS = string.ascii_letters + string.digits + string.punctuation + " "
_REACH_M = 1000.0
"""No house is as large."""
_STRUCTURE = ("Doorframe", "Doorway", "Window")


@lru_cache(maxsize=1)
def vocabulary() -> tuple[str, ...]:
    """The closed vocabulary of categories: those of the asset catalogue, and `Other` for all else."""
    names = {category for _, category, _ in _core.assets()}
    return (*sorted(names.difference(_STRUCTURE)), "Other")


@lru_cache(maxsize=1)
def _indices() -> dict[str, int]:
    return {name: index for index, name in enumerate(vocabulary())}


def category_index(category: str) -> int:
    """Index of a category in the vocabulary, that of `Other` if it is not in it."""
    return _indices().get(category, len(vocabulary()) - 1)


def body_labels(bodies: list[tuple[str, str, str, Any, Any]]) -> NDArray[np.uint8]:
    """Labels of `semantic`, `(N,)`: 1 + category of the bodies that are objects, 0 for walls and the like."""
    kinds = ((kind, category) for _, category, kind, _, _ in bodies)
    labels = (1 + category_index(category) if kind == "object" else 0 for kind, category in kinds)
    return np.fromiter(labels, np.uint8, len(bodies))


def observation_space(config: NavConfig) -> spaces.Dict:
    """Of one environment."""
    image = (config.height_px, config.width_px)
    side = config.reference_image_px
    all_spaces: dict[str, spaces.Space[Any]] = {
        "depth": spaces.Box(0.0, config.simulator.far_m, image, np.float32),
        "rgb": spaces.Box(0, 255, (*image, 3), np.uint8),
        "semantic": spaces.Box(0, len(vocabulary()), image, np.uint8),
        "pose": spaces.Box(
            np.array([-_REACH_M, -_REACH_M, -1.0, -1.0], np.float32),
            np.array([_REACH_M, _REACH_M, 1.0, 1.0], np.float32),
        ),
        "category": spaces.Discrete(len(vocabulary())),
        "instruction": spaces.Text(MAX_INSTRUCTION, charset=_CHARACTERS),
        "reference_image": spaces.Box(0, 255, (side, side, 3), np.uint8),
        "stage": spaces.Discrete(MAX_STAGES, start=1),
        "steps_left": spaces.Discrete(config.budget + 1),
        "is_action_success": spaces.Discrete(2),
        "has_arrived": spaces.Discrete(2),
    }
    return spaces.Dict({name: all_spaces[name] for name in config.observations})


def action_space(config: NavConfig) -> spaces.Space[Any]:
    """Of one environment."""
    if config.action_mode == "actions":
        return spaces.Discrete(len(ACTIONS))
    return spaces.Box(-1.0, 1.0, (3,), np.float32)


def relative_poses(poses: NDArray[np.float64], origins: NDArray[np.float64]) -> NDArray[np.float32]:
    """Poses as the task's start sees them.

    Args:
        poses: `(B, 5)`: x, y, z, yaw, horizon.
        origins: `(B, 5)`: the poses that the tasks began at.

    Returns:
        `(B, 4)`: metres to the right of and ahead of the start, sine and cosine of the turn since, clockwise.
    """
    dx_m, dz_m = poses[:, 0] - origins[:, 0], poses[:, 2] - origins[:, 2]
    sin, cos = np.sin(origins[:, 3]), np.cos(origins[:, 3])
    turn_rad = poses[:, 3] - origins[:, 3]
    columns = (dx_m * cos - dz_m * sin, dx_m * sin + dz_m * cos, np.sin(turn_rad), np.cos(turn_rad))
    return np.stack(columns, axis=1).astype(np.float32)


def waypoint_m(
    config: NavConfig, action: NDArray[np.float32], pose: NDArray[np.float64], origin: NDArray[np.float64]
) -> tuple[float, float] | None:
    """The point that a waypoint action asks for.

    Args:
        config: Frame and range.
        action: `(3,)` in -1..1. The stage ends if the third is above 0. The first two are, times the range: metres to
            the right and ahead of the agent (`relative`), or of where the task began (`start`); or (`polar`) distance,
            -1 for none and 1 for the range, and bearing, -1..1 for half a turn to the left and to the right.
        pose: `(5,)`: the agent's x, y, z, yaw, horizon.
        origin: `(5,)`: the pose that the task began at.

    Returns:
        `(x, z)`, or `None` to stop. An action that is not a number is clipped to one that is.
    """
    a, b, stop = np.nan_to_num(np.clip(action.astype(np.float64), -1.0, 1.0)).tolist()
    if stop > 0.0:
        return None
    frame = origin if config.waypoint_frame == "start" else pose
    x_m, z_m, yaw_rad = float(frame[0]), float(frame[2]), float(frame[3])
    if config.waypoint_frame == "polar":
        bearing_rad, range_m = b * math.pi, (a + 1.0) / 2.0 * config.waypoint_range_m
        right_m, ahead_m = range_m * math.sin(bearing_rad), range_m * math.cos(bearing_rad)
    else:
        right_m, ahead_m = a * config.waypoint_range_m, b * config.waypoint_range_m
    sin, cos = math.sin(yaw_rad), math.cos(yaw_rad)
    return x_m + right_m * cos + ahead_m * sin, z_m - right_m * sin + ahead_m * cos


def instruction_text(goal: StageInput) -> str:
    """The instruction as an element of its space: other characters than ASCII's become `?`."""
    text = goal.unified_instruction[:MAX_INSTRUCTION]
    return "".join(character if character in _CHARACTERS else "?" for character in text)


def reference_image(goal: StageInput, side_px: int) -> NDArray[np.uint8]:
    """The goal's image, `(S, S, 3)`, a copy."""
    if goal.reference_image.shape[:2] == (side_px, side_px):
        return goal.reference_image.copy()
    resized = Image.fromarray(goal.reference_image).resize((side_px, side_px), Image.Resampling.BOX)
    return np.array(resized, np.uint8)
